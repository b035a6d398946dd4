from integrators import IntegratorError as IntegratorError
from integrators import PartitionedRungeKutta as PartitionedRungeKutta
from integrators import RungeKutta as RungeKutta
from integrators import StageAlgebra as StageAlgebra
from integrators import TableauWarning as TableauWarning
from integrators import catalogue as catalogue
from integrators import load_method as load_method
from integrators import method as method
from integrators import save_method as save_method
from trees import Tree as Tree
from trees import TreeError as TreeError
from trees import TreeTable as TreeTable
from trees import count_trees as count_trees
from trees import draw as draw
from trees import svg as svg

from .algebra import compose as compose
from .algebra import lie_derivative as lie_derivative
from .conditions import check as check
from .conditions import error_coefficients as error_coefficients
from .conditions import order_of as order_of
from .exceptions import SeriesError as SeriesError
from .modified import exact_flow as exact_flow
from .modified import modified_equation as modified_equation
from .modified import series as series
from .truncated import BSeries as BSeries

errors: tuple[type[TreeError], type[IntegratorError], type[SeriesError]]
