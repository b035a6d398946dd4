from .counting import count_trees as count_trees
from .drawing import draw as draw
from .drawing import svg as svg
from .errors import TreeError as TreeError
from .table import TreeTable as TreeTable
from .tree import Tree as Tree
