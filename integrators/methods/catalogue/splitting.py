"""Splitting methods for y' = f^a(y) + f^b(y) and for q'' = g(q), and symmetric compositions of the Strang splitting.

A symmetric composition has steps γ_1 h, …, γ_s h with γ_(s+1−i) = γ_i, at least 7 for order 6, 15 for order 8 and 31
for order 10. Schemes with more steps have smaller |γ_i|, and errors that decrease by more than the extra work costs.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from functools import partial
from itertools import zip_longest

from integrators.methods.catalogue.registry import MethodEntry
from integrators.methods.kinds.compositions import (
    FOREST_RUTH,
    MCLACHLAN,
    SCHEMES,
    SUZUKI,
    YOSHIDA,
    Scheme,
    symmetric_composition,
)
from integrators.methods.kinds.splitting import NystromSplitting, Splitting, strang

HLW = "Hairer, Lubich, Wanner, Geometric Numerical Integration (2006), §II.5, doi:10.1007/3-540-30666-8"
BLANES_MOAN = "S. Blanes, P. C. Moan, J. Comput. Appl. Math. 142 (2002) 313–330, doi:10.1016/S0377-0427(01)00492-7"
MCLACHLAN_ATELA = "R. I. McLachlan, P. Atela, Nonlinearity 5 (1992) 541–562, doi:10.1088/0951-7715/5/2/011"
OKUNBOR_SKEEL = (
    "D. I. Okunbor, R. D. Skeel, J. Comput. Appl. Math. 51 (1994) 375–382, doi:10.1016/0377-0427(92)00119-T; "
    f"{MCLACHLAN}"
)
LASKAR_ROBUTEL = (
    "J. Laskar, P. Robutel, Celest. Mech. Dyn. Astron. 80 (2001) 39–62, doi:10.1023/A:1012098603882; R. I. McLachlan, "
    "BIT 35 (1995) 258–268, doi:10.1007/BF01737165"
)
BLANES_CASAS = "S. Blanes, F. Casas, A. Escorihuela-Tomàs (2022), doi:10.48550/arXiv.2202.01541"


def symmetric_flows(first: str, second: str, x: str, y: str) -> list[tuple[str, Fraction]]:
    """The flows x_1, y_1, x_2, y_2, … of a palindromic method; the last number occurs once, in the middle of the step.

    The last x_i and the last y_i are left out, since they follow from the sum 1 over the step.

    Example:
        >>> [(part, str(time)) for part, time in symmetric_flows("a", "b", "1/8", "")]
        [('a', '1/8'), ('b', '1/2'), ('a', '3/4'), ('b', '1/2'), ('a', '1/8')]
    """
    outer, inner = ([Fraction(number) for number in text.split()] for text in (x, y))
    single, paired = (outer, inner) if len(outer) > len(inner) else (inner, outer)
    single.append(1 - 2 * sum(single, Fraction(0)))
    paired.append(Fraction(1, 2) - sum(paired))
    pairs = zip_longest(((first, time) for time in outer), ((second, time) for time in inner))
    there = [flow for pair in pairs for flow in pair if flow is not None]
    return [*there, *there[-2::-1]]


def _symmetric(first: str, x: str, y: str, *, digits: int) -> Callable[..., Splitting]:
    """Builder of a palindromic method in the parts a, b or p, q."""
    kind, parts = (Splitting, ("a", "b")) if first in "ab" else (NystromSplitting, ("p", "q"))
    (second,) = set(parts) - {first}
    return partial(kind, symmetric_flows(first, second, x, y), parts=parts, digits=digits)


def _between(outer: str, inner: str) -> list[tuple[str, str]]:
    """The flows a, b, a, …, b, a with these times."""
    first, *others = (("a", time) for time in outer.split())
    return [first, *(flow for b, a in zip(inner.split(), others, strict=True) for flow in (("b", b), a))]


def _mclachlan4(*, name: str, reference: str) -> Splitting:
    """Alternating Lie–Trotter steps Φ and adjoint steps: Φ_(α5 h) ∘ Φ*_(β5 h) ∘ … ∘ Φ_(α1 h) ∘ Φ*_(β1 h)."""
    beta = ["(14-sqrt(19))/108", "(-23-20*sqrt(19))/270", "1/5", "(-2+10*sqrt(19))/135", "(146+5*sqrt(19))/540"]
    flows = [flow for x, y in zip(beta, beta[::-1], strict=True) for flow in (("b", x), ("a", x), ("a", y), ("b", y))]
    return Splitting(flows, parts=("a", "b"), name=name, reference=reference)


def _kicks_and_drifts(kicks: str, drifts: str, *, digits: int) -> Callable[..., NystromSplitting]:
    """Builder of a method from all its kicks and drifts."""
    pairs = zip(kicks.split(), drifts.split(), strict=True)
    return partial(NystromSplitting, [flow for b, a in pairs for flow in (("p", b), ("q", a))], digits=digits)


def _composed(scheme: str, **labels: str) -> Splitting:
    """A composition of the Strang splitting."""
    composed = symmetric_composition(strang(), scheme)
    assert isinstance(composed, Splitting)
    return Splitting(composed.flows, digits=composed.digits, **labels)


def _composition_entry(name: str, scheme: Scheme) -> MethodEntry:
    about = f"{scheme.steps} Strang steps, {scheme.about}"
    flows = 2 * scheme.steps + 1
    build, title = partial(_composed, name), scheme.title
    return MethodEntry(name, "splitting", flows, scheme.order, about, scheme.reference, build, title=title)


METHODS = (
    MethodEntry("lie-trotter", "splitting", 2, 1, "a step of a, then a step of b", HLW,
        partial(Splitting, [("a", "1"), ("b", "1")]), title="Lie–Trotter"),
    MethodEntry("strang", "splitting", 3, 2, "half a step of a, a step of b, half a step of a",
        f"G. Strang, SIAM J. Numer. Anal. 5 (1968) 506–517, doi:10.1137/0705041; {HLW}",
        partial(Splitting, [("a", "1/2"), ("b", "1"), ("a", "1/2")]), ("strang-splitting", "marchuk"), title="Strang"),
    MethodEntry("ruth3", "splitting", 6, 3, "three steps of each part, with rational coefficients",
        "R. D. Ruth, IEEE Trans. Nucl. Sci. 30 (1983) 2669–2671, doi:10.1109/TNS.1983.4332919",
        partial(Splitting, [("a", "7/24"), ("b", "2/3"), ("a", "3/4"), ("b", "-2/3"), ("a", "-1/24"), ("b", "1")]),
        title="Ruth 3"),
    MethodEntry("mclachlan4", "splitting", 11, 4, "ten Lie-Trotter steps, every other one adjoint, with small errors",
        MCLACHLAN, _mclachlan4, title="McLachlan 4"),
    MethodEntry("saba2", "splitting", 5, 2, "for perturbed systems, generalised order (4, 2): Gauss nodes for f^a",
        LASKAR_ROBUTEL,
        partial(Splitting, _between("1/2-sqrt(3)/6 sqrt(3)/3 1/2-sqrt(3)/6", "1/2 1/2")), title="SABA2"),
    MethodEntry("saba3", "splitting", 7, 2, "for perturbed systems, generalised order (6, 2): Gauss nodes for f^a",
        LASKAR_ROBUTEL,
        partial(Splitting, _between("1/2-sqrt(15)/10 sqrt(15)/10 sqrt(15)/10 1/2-sqrt(15)/10", "5/18 4/9 5/18")),
        title="SABA3"),
    MethodEntry("aba864", "splitting", 15, 4,
        "for perturbed systems, generalised order (8, 6, 4), as 40-digit decimals",
        "S. Blanes, F. Casas, A. Farrés, J. Laskar, J. Makazaga, A. Murua, Appl. Numer. Math. 68 (2013) 58–72, "
        "doi:10.1016/j.apnum.2013.01.003",
        _symmetric("a",
            "0.0711334264982231177779387300061549964174 0.241153427956640098736487795326289649618 "
            "0.521411761772814789212136078067994229991",
            "0.183083687472197221961703757166430291072 0.310782859898574869507522291054262796375 "
            "-0.0265646185119588006972121379164987592663", digits=38), title="ABA(8,6,4)"),
    MethodEntry("pefrl4", "splitting", 9, 4,
        "Forest and Ruth's method with one more stage and smaller errors, as 16-digit decimals",
        "I. P. Omelyan, I. M. Mryglod, R. Folk, Comput. Phys. Commun. 146 (2002) 188–202, "
        "doi:10.1016/S0010-4655(02)00451-4",
        _symmetric("b", "0.1786178958448091 -0.06626458266981849", "0.7123418310626054", digits=15),
        ("pefrl", "omelyan4"), title="PEFRL4"),
    MethodEntry("blanes-moan4", "splitting", 13, 4,
        "six stages with very small errors, as 15-digit decimals; recommended for order 4", BLANES_MOAN,
        _symmetric("a", "0.0792036964311957 0.353172906049774 -0.0420650803577195",
            "0.209515106613362 -0.143851773179818", digits=15), title="Blanes–Moan 4"),
    # Printed with 15 digits. The order conditions leave one free parameter, the second number, used as printed. The
    # other coefficients are the solution of the conditions nearest to the printed values.
    MethodEntry("blanes-moan6", "splitting", 21, 6,
        "ten stages, as 15-digit decimals refined to 32; recommended for order 6", BLANES_MOAN,
        _symmetric("a",
            "0.0502627644003926658937494455486448 0.413514300428344 0.0450798897943980363898651731542663 "
            "-0.1880548538195690771124424466686314 0.5419606784507802019155816322331577",
            "0.1488164479010432053333931406648383 -0.1323858657677835879043958615671915 "
            "0.0673076046921844904199612816920070 0.4326664025781735350222165239488431",
            digits=32),
        ("blanes-moan-s10",), title="Blanes–Moan 6"),
    MethodEntry("triple-jump4", "splitting", 7, 4, "three Strang steps with 1/(2 - 2^(1/3)); Forest and Ruth's method",
        f"{FOREST_RUTH}; {SUZUKI}; {YOSHIDA}", partial(_composed, "triple-jump4"),
        ("triple-jump", "forest-ruth", "yoshida4"), title="triple jump 4"),
    MethodEntry("suzuki4", "splitting", 11, 4,
        "five Strang steps with 1/(4 - 4^(1/3)); recommended to compose for order 4", SUZUKI,
        partial(_composed, "suzuki4"), ("suzuki-fractal4",), title="Suzuki 4"),
    *(_composition_entry(name, scheme) for name, scheme in SCHEMES.items()),
    # Blanes and Moan print 15 or 16 digits. Their free parameters are used as printed; the other coefficients are the
    # solution of the order conditions nearest to the printed values. Okunbor and Skeel's method is an isolated one.
    MethodEntry("mclachlan-atela4", "nystrom splitting", 8, 4,
        "four forces and small errors, not symmetric, as 18-digit decimals", MCLACHLAN_ATELA,
        _kicks_and_drifts("0.1344961992774310892 -0.2248198030794208058 0.7563200005156682911 0.3340036032863214255",
            "0.5153528374311229364 -0.085782019412973646 0.4415830236164665242 0.1288461583653841854", digits=17),
        title="McLachlan–Atela 4"),
    MethodEntry("blanes-moan-rkn4", "nystrom splitting", 13, 4,
        "six forces and very small errors, as 15-digit decimals refined to 32; recommended for order 4", BLANES_MOAN,
        _symmetric("p", "0.0829844064174048729189656253433127 0.396309801498368 -0.0390563049223483952772822867670530",
            "0.245298957184271 0.604872665711080", digits=32),
        ("srkn6b",), title="Blanes–Moan RKN4"),
    MethodEntry("mclachlan-atela5", "nystrom splitting", 12, 5, "six forces, not symmetric, as 17-digit decimals",
        MCLACHLAN_ATELA,
        _kicks_and_drifts(
            "0.1193900292875672758 0.6989273703824752308 -0.1713123582716007754 0.4012695022513534480 "
            "0.0107050818482359840 -0.0589796254980311632",
            "0.339839625839110000 -0.088601336903027329 0.5858564768259621188 -0.603039356536491888 "
            "0.3235807965546976394 0.4423637942197494587",
            digits=16), title="McLachlan–Atela 5"),
    MethodEntry("okunbor-skeel6", "nystrom splitting", 15, 6,
        "the fewest forces for order 6, seven, as 19-digit decimals refined to 32", OKUNBOR_SKEEL,
        _symmetric("q",
            "-1.0130879789171747298149045784889559 1.1874295737325427070242933206374022 "
            "-0.0183358520964605903443874884097306",
            "0.0001660069265000989421747072427970 -0.3796242142637736060819469079990921 "
            "0.6891374118518106367408016646578030",
            digits=29), title="Okunbor–Skeel 6"),
    MethodEntry("blanes-moan-rkn6", "nystrom splitting", 29, 6,
        "fourteen forces and very small errors, as 15-digit decimals refined to 32; recommended for order 6",
        BLANES_MOAN,
        _symmetric("q",
            "0.0378593198406112130445478858122580 0.102635633102435 -0.0258678882665576356567479605658334 "
            "0.314241403071447 -0.130144459517415 0.106417700369543 -0.0087942431285100469743295414980519",
            "0.09171915262446165 0.183983170005006 -0.0565343658328904459050907390129056 "
            "0.0049146887747116556462100123840291 0.1437611271683631211334211026097398 0.328567693746804",
            digits=31),
        ("srkn14a",), title="Blanes–Moan RKN6"),
    MethodEntry("blanes-moan-rkn6-11", "nystrom splitting", 23, 6,
        "eleven forces and very small errors, as 15-digit decimals refined to 32", BLANES_MOAN,
        _symmetric("p",
            "0.0414649985182632264944041748381757 0.198128671918067 -0.0400061921041524120577599260588067 "
            "0.0752539843015800630713085428162013 -0.0115113874206877895274713990696617",
            "0.1232297759462719267843141580037645 0.290553797799558 -0.1270492126254174480393202678221216 "
            "-0.246331761062075 0.357208872795928",
            digits=31),
        ("srkn11b",), title="Blanes–Moan RKN6 (11)"),
    MethodEntry("blanes-casas-rkn8", "nystrom splitting", 39, 8,
        "nineteen forces, as 30-digit decimals; recommended for order 8", BLANES_CASAS,
        _symmetric("q",
            "0.0505805 0.149999 -0.0551795510771615573511026950361 0.423755898835337951482264998051 "
            "-0.213495353584659048059672194633 -0.0680769774574032619111630736274 0.227917056974013435948887201671 "
            "-0.235373619381058906524740047732 0.387413869179878047816794031058",
            "0.129478606560536730662493794395 0.222257260092671143423043559581 -0.0577514893325147204757023246320 "
            "-0.0578312262103924910221345032763 0.103087297437175356747933252265 -0.140819612554090768205554103887 "
            "0.0234462603492826276699713718626 0.134854517356684096617882205068 0.0287973821073779306345172160211",
            digits=28), title="Blanes–Casas RKN8"),
)  # fmt: skip
