from .compiling import CompiledConditions as CompiledConditions
from .listing import OrderCondition as OrderCondition
from .listing import OrderConditions as OrderConditions
from .listing import order_conditions as order_conditions
