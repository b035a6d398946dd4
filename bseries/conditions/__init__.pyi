from .compiling import CompiledConditions as CompiledConditions
from .generating import order_conditions as order_conditions
from .listing import OrderCondition as OrderCondition
from .listing import OrderConditions as OrderConditions
