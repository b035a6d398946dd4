from .compiling import CompiledConditions as CompiledConditions
from .condition import OrderCondition as OrderCondition
from .generating import order_conditions as order_conditions
from .listing import OrderConditions as OrderConditions
