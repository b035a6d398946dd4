from .audit import Audit as Audit
from .audit import audit as audit
from .claims import claims_of as claims_of
from .comparison import Comparison as Comparison
from .comparison import Difference as Difference
from .comparison import compare as compare
from .corrections import Correction as Correction
from .corrections import corrections as corrections
