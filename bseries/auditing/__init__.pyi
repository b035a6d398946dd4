from .corrections import Correction as Correction
from .corrections import corrections as corrections
