"""The classes and families of methods with memory, which belong to `integrators`, in one place with what reads them."""

from integrators.methods.kinds.memory import GeneralLinear as GeneralLinear
from integrators.methods.kinds.memory import LinearMultistep as LinearMultistep
from integrators.methods.kinds.memory import TwoStepRungeKutta as TwoStepRungeKutta
from integrators.methods.kinds.multistep_families import adams_bashforth as adams_bashforth
from integrators.methods.kinds.multistep_families import adams_moulton as adams_moulton
from integrators.methods.kinds.multistep_families import bdf as bdf
from integrators.methods.kinds.multistep_families import milne_simpson as milne_simpson
from integrators.methods.kinds.multistep_families import nystrom as nystrom
from integrators.methods.kinds.multistep_families import symmetric_multistep as symmetric_multistep
from integrators.methods.kinds.optimisers import momentum as momentum
from integrators.methods.kinds.optimisers import nesterov as nesterov
from integrators.methods.kinds.root_conditions import ParasiticMode as ParasiticMode
