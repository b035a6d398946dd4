from .audit import Audit as Audit
from .audit import audit as audit
from .claims import claims_of as claims_of
from .corrections import Correction as Correction
from .corrections import corrections as corrections
