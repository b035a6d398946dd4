from .energy_log import EnergyLog as EnergyLog
from .energy_log import energy_log as energy_log
from .formulas import ShadowFormula as ShadowFormula
from .formulas import shadow_formula as shadow_formula
from .report import ShadowReport as ShadowReport
from .trajectory_energies import shadow_energy as shadow_energy
