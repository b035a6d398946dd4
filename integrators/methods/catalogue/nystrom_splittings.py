"""Splitting methods for q'' = g(q): kicks of the momenta p, drifts of the positions q."""

from __future__ import annotations

from typing import TYPE_CHECKING

from integrators.methods.catalogue.entry import MethodEntry
from integrators.methods.catalogue.splitting import BLANES_MOAN, symmetric_flows

if TYPE_CHECKING:
    from collections.abc import Callable

    from integrators.methods.kinds.nystrom_splitting import NystromSplitting

MCLACHLAN_ATELA = "R. I. McLachlan, P. Atela, Nonlinearity 5 (1992) 541–562, doi:10.1088/0951-7715/5/2/011"
OKUNBOR_SKEEL = (
    "D. I. Okunbor, R. D. Skeel, J. Comput. Appl. Math. 51 (1994) 375–382, doi:10.1016/0377-0427(92)00119-T; "
    "R. I. McLachlan, SIAM J. Sci. Comput. 16 (1995) 151–168, doi:10.1137/0916010"
)
BLANES_CASAS = "S. Blanes, F. Casas, A. Escorihuela-Tomàs (2022), doi:10.48550/arXiv.2202.01541"


def _kicks_and_drifts(kicks: str, drifts: str, *, digits: int) -> Callable[..., NystromSplitting]:
    """The builder of a method with kicks and drifts in turn, given all of them."""

    def build(*, name: str, reference: str) -> NystromSplitting:
        from integrators.methods.kinds.nystrom_splitting import NystromSplitting

        pairs = zip(kicks.split(), drifts.split(), strict=True)
        flows = [flow for b, a in pairs for flow in (("p", b), ("q", a))]
        return NystromSplitting(flows, name=name, reference=reference, digits=digits)

    return build


def _symmetric(first: str, x: str, y: str, *, digits: int) -> Callable[..., NystromSplitting]:
    """The builder of a palindromic method, see `symmetric_flows`."""

    def build(*, name: str, reference: str) -> NystromSplitting:
        from integrators.methods.kinds.nystrom_splitting import NystromSplitting

        flows = symmetric_flows(first, "q" if first == "p" else "p", x, y)
        return NystromSplitting(flows, name=name, reference=reference, digits=digits)

    return build


# The methods of Blanes and Moan are printed with 15 or 16 digits. As many of their numbers as the order conditions
# leave free are as printed here, the others are the solution of the conditions next to the printed ones; the method of
# Okunbor and Skeel is an isolated solution.
METHODS = (
    MethodEntry(
        "mclachlan-atela4",
        "nystrom splitting",
        8,
        4,
        "four forces and small errors, not symmetric, as 18-digit decimals",
        MCLACHLAN_ATELA,
        _kicks_and_drifts(
            "0.1344961992774310892 -0.2248198030794208058 0.7563200005156682911 0.3340036032863214255",
            "0.5153528374311229364 -0.085782019412973646 0.4415830236164665242 0.1288461583653841854",
            digits=17,
        ),
    ),
    MethodEntry(
        "blanes-moan-rkn4",
        "nystrom splitting",
        13,
        4,
        "six forces and very small errors, as 15-digit decimals refined to 32; recommended for order 4",
        BLANES_MOAN,
        _symmetric(
            "p",
            "0.0829844064174048729189656253433127 0.396309801498368 -0.0390563049223483952772822867670530",
            "0.245298957184271 0.604872665711080",
            digits=32,
        ),
        ("srkn6b",),
    ),
    MethodEntry(
        "mclachlan-atela5",
        "nystrom splitting",
        12,
        5,
        "six forces, not symmetric, as 17-digit decimals",
        MCLACHLAN_ATELA,
        _kicks_and_drifts(
            "0.1193900292875672758 0.6989273703824752308 -0.1713123582716007754 0.4012695022513534480 "
            "0.0107050818482359840 -0.0589796254980311632",
            "0.339839625839110000 -0.088601336903027329 0.5858564768259621188 -0.603039356536491888 "
            "0.3235807965546976394 0.4423637942197494587",
            digits=16,
        ),
    ),
    MethodEntry(
        "okunbor-skeel6",
        "nystrom splitting",
        15,
        6,
        "the fewest forces for order 6, seven, as 19-digit decimals refined to 32",
        OKUNBOR_SKEEL,
        _symmetric(
            "q",
            "-1.0130879789171747298149045784889559 1.1874295737325427070242933206374022 "
            "-0.0183358520964605903443874884097306",
            "0.0001660069265000989421747072427970 -0.3796242142637736060819469079990921 "
            "0.6891374118518106367408016646578030",
            digits=29,
        ),
    ),
    MethodEntry(
        "blanes-moan-rkn6",
        "nystrom splitting",
        29,
        6,
        "fourteen forces and very small errors, as 15-digit decimals refined to 32; recommended for order 6",
        BLANES_MOAN,
        _symmetric(
            "q",
            "0.0378593198406112130445478858122580 0.102635633102435 -0.0258678882665576356567479605658334 "
            "0.314241403071447 -0.130144459517415 0.106417700369543 -0.0087942431285100469743295414980519",
            "0.09171915262446165 0.183983170005006 -0.0565343658328904459050907390129056 "
            "0.0049146887747116556462100123840291 0.1437611271683631211334211026097398 0.328567693746804",
            digits=31,
        ),
        ("srkn14a",),
    ),
    MethodEntry(
        "blanes-moan-rkn6-11",
        "nystrom splitting",
        23,
        6,
        "eleven forces and very small errors, as 15-digit decimals refined to 32",
        BLANES_MOAN,
        _symmetric(
            "p",
            "0.0414649985182632264944041748381757 0.198128671918067 -0.0400061921041524120577599260588067 "
            "0.0752539843015800630713085428162013 -0.0115113874206877895274713990696617",
            "0.1232297759462719267843141580037645 0.290553797799558 -0.1270492126254174480393202678221216 "
            "-0.246331761062075 0.357208872795928",
            digits=31,
        ),
        ("srkn11b",),
    ),
    MethodEntry(
        "blanes-casas-rkn8",
        "nystrom splitting",
        39,
        8,
        "nineteen forces, as 30-digit decimals; recommended for order 8",
        BLANES_CASAS,
        _symmetric(
            "q",
            "0.0505805 0.149999 -0.0551795510771615573511026950361 0.423755898835337951482264998051 "
            "-0.213495353584659048059672194633 -0.0680769774574032619111630736274 0.227917056974013435948887201671 "
            "-0.235373619381058906524740047732 0.387413869179878047816794031058",
            "0.129478606560536730662493794395 0.222257260092671143423043559581 -0.0577514893325147204757023246320 "
            "-0.0578312262103924910221345032763 0.103087297437175356747933252265 -0.140819612554090768205554103887 "
            "0.0234462603492826276699713718626 0.134854517356684096617882205068 0.0287973821073779306345172160211",
            digits=28,
        ),
    ),
)
