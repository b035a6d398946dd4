"""Explicit Runge–Kutta methods, embedded pairs, and two symbolic families.

The first weights of a pair advance the solution, the embedded weights estimate its error. The digits of a name such as
``fehlberg45`` are customary; the description states the order of the advancing weights.
"""

from __future__ import annotations

from fractions import Fraction
from functools import partial

from integrators.core.errors import IntegratorError
from integrators.exact.entries import Entry, cancels
from integrators.methods.catalogue.registry import MethodEntry, lower_rows
from integrators.methods.tableaux.runge_kutta import RungeKutta

HEUN = "K. Heun, Z. Math. Phys. 45 (1900) 23–38"
KUTTA = "W. Kutta, Z. Math. Phys. 46 (1901) 435–453"
HALF = Fraction(1, 2)
PEP = "G. A. Barrios de León, D. I. Ketcheson, H. Ranocha, arXiv:2407.15365 (2024)"
RALSTON = "A. Ralston, Math. Comp. 16 (1962) 431–437, doi:10.1090/S0025-5718-1962-0150954-0"


def explicit_entry(
    name: str, order: int, rows: tuple[str, ...], weights: str, description: str, reference: str, *,
    aliases: tuple[str, ...] = (), embedded: tuple[str, ...] = (), nodes: str = "", digits: int | None = None,
    title: str = "",
) -> MethodEntry:  # fmt: skip
    """Entry of an explicit method given by its printed tableau, with entries separated by spaces.

    `rows` are those of A from the second on, below the diagonal; `nodes` are by default their sums, which for rounded
    decimals have errors that the printed nodes have not. `embedded` holds the weights of each embedded method.
    """
    stages = len(rows) + 1
    kind = "embedded pair" if embedded else "explicit"
    extra = [row.split() for row in embedded]
    A, c = lower_rows(("", *rows), stages), nodes.split() or None
    build = partial(RungeKutta, A, weights.split(), c, embedded=extra, digits=digits)
    return MethodEntry(name, kind, stages, order, description, reference, build, aliases, title=title)


def _two_stages(*, name: str, reference: str, alpha: Entry) -> RungeKutta:
    """Σ b_i = 1 and Σ b_i c_i = 1/2 with c = (0, α)."""
    if cancels([alpha], 0):
        raise IntegratorError(f"parameter alpha of explicit2 must not be 0, but was {alpha}")
    last = 1 / (2 * alpha)
    return RungeKutta([[0, 0], [alpha, 0]], [1 - last, last], name=name, reference=reference)


def _three_stages(*, name: str, reference: str, c2: Entry, c3: Entry) -> RungeKutta:
    """Solve Σ b_i c_i^(k−1) = 1/k, k = 1, 2, 3, for b and b_3 a_32 c_2 = 1/6 for a_32, with c = (0, c2, c3)."""
    # The last case is b_3 = 0, for which a_32 is free or does not exist.
    if any(cancels(terms, 0) for terms in ([c2], [c3], [c2, -c3], [3 * c2, -2])):
        raise IntegratorError(
            "parameters c2 and c3 of explicit3 must differ from 0 and from each other, and c2 from 2/3, "
            f"but were {c2!s:.60} and {c3!s:.60}"
        )
    b2 = (3 * c3 - 2) / (6 * c2 * (c3 - c2))
    b3 = (2 - 3 * c2) / (6 * c3 * (c3 - c2))
    a32 = c3 * (c3 - c2) / (c2 * (2 - 3 * c2))
    matrix = [[0, 0, 0], [c2, 0, 0], [c3 - a32, a32, 0]]
    return RungeKutta(matrix, [1 - b2 - b3, b2, b3], name=name, reference=reference)


def _ees25(*, name: str, reference: str, x: Entry = Fraction(1, 10)) -> RungeKutta:
    """The only method with b_1 = x: order 2, and Φ_h ∘ Φ_(−h) is the identity to order 5."""
    if any(cancels([x, -y], 0) for y in (1, HALF, -HALF)):
        raise IntegratorError(f"parameter x of ees25 must not be 1, 1/2 or -1/2, but was {x!s:.60}")
    a21 = (1 + 2 * x) / (4 * (1 - x))
    a31 = (6 * a21 - 8 * x - 1) / (8 * x**2 - 2)
    matrix = [[0, 0, 0], [a21, 0, 0], [a31, a21 + HALF - a31, 0]]
    return RungeKutta(matrix, [x, HALF, HALF - x], name=name, reference=reference)


METHODS = (
    explicit_entry("explicit-euler", 1, (), "1", "Euler's polygon method",
        "L. Euler, Institutionum calculi integralis (1768), §650", aliases=("forward-euler",), title="explicit Euler"),
    explicit_entry("explicit-midpoint", 2, ("1/2",), "0 1", "Runge's midpoint rule",
        "C. Runge, Math. Ann. 46 (1895) 167–178, doi:10.1007/BF01446807", title="explicit midpoint"),
    explicit_entry("heun2", 2, ("1",), "1/2 1/2", "Heun's method, the explicit trapezoidal rule", HEUN,
        aliases=("heun", "ssprk22"), title="Heun 2"),
    explicit_entry("ralston2", 2, ("2/3",), "1/4 3/4", "two stages of order 2 with the least error bound", RALSTON,
        title="Ralston 2"),
    explicit_entry("kutta3", 3, ("1/2", "-1 2"), "1/6 2/3 1/6", "Kutta's method of order 3", KUTTA, aliases=("rk3",),
        title="Kutta 3"),
    explicit_entry("heun3", 3, ("1/3", "0 2/3"), "1/4 0 3/4", "Heun's method of order 3", HEUN, title="Heun 3"),
    explicit_entry("ralston3", 3, ("1/2", "0 3/4"), "2/9 1/3 4/9", "three stages of order 3 with the least error bound",
        RALSTON, title="Ralston 3"),
    explicit_entry("rk4", 4, ("1/2", "0 1/2", "0 0 1"), "1/6 1/3 1/3 1/6", "the classical Runge–Kutta method", KUTTA,
        aliases=("classical-rk4",), title="RK4"),
    explicit_entry("rk38", 4, ("1/3", "-1/3 1", "1 -1 1"), "1/8 3/8 3/8 1/8", "Kutta's 3/8 rule", KUTTA, title="RK38"),
    explicit_entry("ralston4", 4,
        ("2/5",
         "(-2889+1428*sqrt(5))/1024 (3785-1620*sqrt(5))/1024",
         "(-3365+2094*sqrt(5))/6040 (-975-3046*sqrt(5))/2552 (467040+203968*sqrt(5))/240845"),
        "(263+24*sqrt(5))/1812 (125-1000*sqrt(5))/3828 (3426304+1661952*sqrt(5))/5924787 (30-4*sqrt(5))/123",
        "four stages of order 4 with the least error bound", RALSTON, title="Ralston 4"),
    explicit_entry("nystrom5", 5,
        ("1/3", "4/25 6/25", "1/4 -3 15/4", "2/27 10/9 -50/81 8/81", "2/25 12/25 2/15 8/75 0"),
        "23/192 0 125/192 0 -27/64 125/192", "Kutta's method of order 5 as corrected by Nyström",
        "E. J. Nyström, Acta Soc. Sci. Fenn. 50 (1925) no. 13", aliases=("nystrom",), title="Nyström 5"),
    MethodEntry("explicit2", "explicit", 2, 2,
        "all explicit methods of order 2 with two stages; alpha is the second node",
        "J. C. Butcher, Numerical Methods for Ordinary Differential Equations (2016), §232, doi:10.1002/9781119121534",
        _two_stages, parameters=("alpha",), title="explicit 2"),
    MethodEntry("explicit3", "explicit", 3, 3,
        "explicit methods of order 3 with three stages and distinct nodes 0, c2, c3",
        "J. C. Butcher, Numerical Methods for Ordinary Differential Equations (2016), §233, doi:10.1002/9781119121534",
        _three_stages, parameters=("c2", "c3"), title="explicit 3"),
    explicit_entry("merson4", 4, ("1/3", "1/6 1/6", "1/8 0 3/8", "1/2 0 -3/2 2"), "1/6 0 0 2/3 1/6",
        "order 4 with embedded order 3, or 5 on linear problems with constant coefficients",
        "R. H. Merson, Proc. Symp. Data Processing, Salisbury (1957); Hairer, Nørsett, Wanner, "
        "Solving Ordinary Differential Equations I, Table II.4.1, doi:10.1007/978-3-540-78862-1",
        aliases=("merson", "kutta-merson"), embedded=("1/10 0 3/10 2/5 1/5",), title="Merson 4"),
    explicit_entry("bogacki-shampine32", 3, ("1/2", "0 3/4", "2/9 1/3 4/9"), "2/9 1/3 4/9 0",
        "order 3 with embedded order 2; the last stage is the next step's first",
        "P. Bogacki, L. F. Shampine, Appl. Math. Lett. 2 (1989) 321–325, doi:10.1016/0893-9659(89)90079-7",
        aliases=("bs32", "RK23", "ode23", "BS3", "Bosh3"), embedded=("7/24 1/4 1/3 1/8",), title="Bogacki–Shampine 32"),
    explicit_entry("fehlberg45", 4,
        ("1/4",
         "3/32 9/32",
         "1932/2197 -7200/2197 7296/2197",
         "439/216 -8 3680/513 -845/4104",
         "-8/27 2 -3544/2565 1859/4104 -11/40"),
        "25/216 0 1408/2565 2197/4104 -1/5 0", "order 4, as Fehlberg advances it, with embedded order 5",
        "E. Fehlberg, NASA TR R-315 (1969)", aliases=("rkf45",),
        embedded=("16/135 0 6656/12825 28561/56430 -9/50 2/55",), title="Fehlberg 45"),
    explicit_entry("cash-karp45", 5,
        ("1/5",
         "3/40 9/40",
         "3/10 -9/10 6/5",
         "-11/54 5/2 -70/27 35/27",
         "1631/55296 175/512 575/13824 44275/110592 253/4096"),
        "37/378 0 250/621 125/594 0 512/1771", "order 5, as Cash and Karp advance it, with embedded order 4",
        "J. R. Cash, A. H. Karp, ACM Trans. Math. Softw. 16 (1990) 201–222, doi:10.1145/79505.79507",
        aliases=("cash-karp54", "cash-karp"), embedded=("2825/27648 0 18575/48384 13525/55296 277/14336 1/4",),
        title="Cash–Karp 45"),
    explicit_entry("dormand-prince54", 5,
        ("1/5",
         "3/40 9/40",
         "44/45 -56/15 32/9",
         "19372/6561 -25360/2187 64448/6561 -212/729",
         "9017/3168 -355/33 46732/5247 49/176 -5103/18656",
         "35/384 0 500/1113 125/192 -2187/6784 11/84"),
        "35/384 0 500/1113 125/192 -2187/6784 11/84 0",
        "order 5 with embedded order 4; the last stage is the next step's first",
        "J. R. Dormand, P. J. Prince, J. Comput. Appl. Math. 6 (1980) 19–26, doi:10.1016/0771-050X(80)90013-3",
        aliases=("dopri5", "RK45", "ode45", "DP5", "dormand-prince"),
        embedded=("5179/57600 0 7571/16695 393/640 -92097/339200 187/2100 1/40",), title="Dormand–Prince 54"),
    explicit_entry("verner65", 6,
        ("1/6",
         "4/75 16/75",
         "5/6 -8/3 5/2",
         "-165/64 55/6 -425/64 85/96",
         "12/5 -8 4015/612 -11/36 88/255",
         "-8263/15000 124/75 -643/680 -81/250 2484/10625 0",
         "3501/1720 -300/43 297275/52632 -319/2322 24068/84065 0 3850/26703"),
        "3/40 0 875/2244 23/72 264/1955 0 125/11592 43/616",
        "order 6 with embedded order 5: Verner's pair of 1978 with eight stages, used in the code DVERK",
        "J. H. Verner, SIAM J. Numer. Anal. 15 (1978) 772–790, doi:10.1137/0715051", aliases=("dverk",),
        embedded=("13/160 0 2375/5984 5/16 12/85 3/44 0 0",), title="Verner 65"),
    # Table 1 of the paper heads its last column with the embedded weights but prints their differences from the
    # weights, the last with the wrong sign; the embedded weights below are the weights minus those differences.
    explicit_entry("tsit5", 5,
        ("0.161",
         "-0.008480655492356989 0.3354806554923570",
         "2.897153057105493 -6.359448489975075 4.362295432869581",
         "5.325864828439257 -11.74888356406283 7.495539342889836 -0.09249506636175525",
         "5.861455442946420 -12.92096931784711 8.159367898576159 -0.07158497328140100 -0.02826905039406838",
         "0.09646076681806523 0.01 0.4798896504144996 1.379008574103742 -3.290069515436081 2.324710524099774"),
        "0.09646076681806523 0.01 0.4798896504144996 1.379008574103742 -3.290069515436081 2.324710524099774 0",
        "order 5 with embedded order 4, as 16-digit decimals; the last stage is the next step's first",
        "Ch. Tsitouras, Comput. Math. Appl. 62 (2011) 770–775, doi:10.1016/j.camwa.2011.06.002",
        aliases=("tsitouras5", "tsitouras54"), nodes="0 0.161 0.327 0.9 0.9800255409045097 1 1", digits=16,
        embedded=(
            "0.09468075576583946 0.009183565540343253 0.4877705284247616 1.234297566930479 -2.707712349983525 "
            "1.866628418170587 1/66",), title="Tsit5"),
    # The three weights of order 3 and the error weights of order 5 (b minus the embedded weights) are printed in
    explicit_entry("dormand-prince87", 8,
        ("1/18",
         "1/48 1/16",
         "1/32 0 3/32",
         "5/16 0 -75/64 75/64",
         "3/80 0 0 3/16 3/20",
         "29443841/614563906 0 0 77736538/692538347 -28693883/1125000000 23124283/1800000000",
         "16016141/946692911 0 0 61564180/158732637 22789713/633445777 545815736/2771057229 -180193667/1043307555",
         "39632708/573591083 0 0 -433636366/683701615 -421739975/2616292301 100302831/723423059 790204164/839813087 "
         "800635310/3783071287",
         "246121993/1340847787 0 0 -37695042795/15268766246 -309121744/1061227803 -12992083/490766935 "
         "6005943493/2108947869 393006217/1396673457 123872331/1001029789",
         "-1028468189/846180014 0 0 8478235783/508512852 1311729495/1432422823 -10304129995/1701304382 "
         "-48777925059/3047939560 15336726248/1032824649 -45442868181/3398467696 3065993473/597172653",
         "185892177/718116043 0 0 -3185094517/667107341 -477755414/1098053517 -703635378/230739211 "
         "5731566787/1027545527 5232866602/850066563 -4093664535/808688257 3962137247/1805957418 65686358/487910083",
         "403863854/491063109 0 0 -5068492393/434740067 -411421997/543043805 652783627/914296604 "
         "11173962825/925320556 -13158990841/6184727034 3936647629/1978049680 -160528059/685178525 "
         "248638103/1413531060"),
        "14005451/335480064 0 0 0 0 -59238493/1068277825 181606767/758867731 561292985/797845732 "
        "-1041891430/1371343529 760417239/1151165299 118820643/751138087 -528747749/2220607170 1/4",
        "pair 8(7) with the least error of order 8, in rational approximations",
        "P. J. Prince, J. R. Dormand, J. Comput. Appl. Math. 7 (1981) 67–75, doi:10.1016/0771-050X(81)90010-3",
        aliases=("dp87",), digits=17,
        nodes="0 1/18 1/12 1/8 5/16 3/8 59/400 93/200 5490023248/9719169821 13/20 1201146811/1299019798 1 1",
        embedded=(
            "13451932/455176623 0 0 0 0 -808719846/976000145 1757004468/5645159321 656045339/265891186 "
            "-3867574721/1518517206 465885868/322736535 53011238/667516719 2/45 0",), title="Dormand–Prince 8(7)"),
    # dop853.f; the error weights have 28 significant digits, everything else 30.
    explicit_entry("dop853", 8,
        ("0.0526001519587677318785587544488",
         "0.0197250569845378994544595329183 0.0591751709536136983633785987549",
         "0.0295875854768068491816892993775 0 0.0887627564304205475450678981324",
         "0.241365134159266685502369798665 0 -0.884549479328286085344864962717 0.924834003261792003115737966543",
         "0.037037037037037037037037037037 0 0 0.170828608729473871279604482173 0.125467687566822425016691814123",
         "0.037109375 0 0 0.170252211019544039314978060272 0.0602165389804559606850219397283 -0.017578125",
         "0.0370920001185047927108779319836 0 0 0.170383925712239993810214054705 "
         "0.107262030446373284651809199168 -0.0153194377486244017527936158236 "
         "0.00827378916381402288758473766002",
         "0.624110958716075717114429577812 0 0 -3.36089262944694129406857109825 "
         "-0.868219346841726006818189891453 27.5920996994467083049415600797 20.1540675504778934086186788979 "
         "-43.4898841810699588477366255144",
         "0.477662536438264365890433908527 0 0 -2.48811461997166764192642586468 "
         "-0.590290826836842996371446475743 21.2300514481811942347288949897 15.2792336328824235832596922938 "
         "-33.2882109689848629194453265587 -0.0203312017085086261358222928593",
         "-0.93714243008598732571704021658 0 0 5.18637242884406370830023853209 "
         "1.09143734899672957818500254654 -8.14978701074692612513997267357 -18.5200656599969598641566180701 "
         "22.7394870993505042818970056734 2.49360555267965238987089396762 -3.0467644718982195003823669022",
         "2.27331014751653820792359768449 0 0 -10.5344954667372501984066689879 "
         "-2.00087205822486249909675718444 -17.9589318631187989172765950534 27.9488845294199600508499808837 "
         "-2.85899827713502369474065508674 -8.87285693353062954433549289258 12.3605671757943030647266201528 "
         "0.643392746015763530355970484046"),
        "0.0542937341165687622380535766363 0 0 0 0 4.45031289275240888144113950566 "
        "1.89151789931450038304281599044 -5.8012039600105847814672114227 0.31116436695781989440891606237 "
        "-0.152160949662516078556178806805 0.201365400804030348374776537501 "
        "0.0447106157277725905176885569043",
        "order 8 with embedded orders 5 and 3, as 30-digit decimals: the pair of Dormand and Prince in the code DOP853",
        "E. Hairer, S. P. Nørsett, G. Wanner, Solving Ordinary Differential Equations I (1993), §II.5 and §II.10 and "
        "the code dop853.f, doi:10.1007/978-3-540-78862-1",
        aliases=("dormand-prince853",), digits=28,
        nodes="0 0.0526001519587677318785587544488 0.0789002279381515978178381316732 0.11835034190722739672675719751 "
        "0.28164965809277260327324280249 0.333333333333333333333333333333 0.25 0.307692307692307692307692307692 "
        "0.651282051282051282051282051282 0.6 0.857142857142857142857142857142 1",
        embedded=(
            "0.0411736891223738815055525466763 0 0 0 0 5.67546933912861332216170925866 "
            "2.38727684897175057456422398564 -7.4655811424655713184287418377 0.66149321570779357609756479137 "
            "-0.486340068375533557585910690905 0.119442194318914635909069111371 "
            "0.0670659235916588857765328353543",
            "0.244094488188976377952755905512 0 0 0 0 0 0 0 0.733846688281611857341361741547 0 0 "
            "0.0220588235294117647058823529412"), title="DOP853"),
    explicit_entry("pep425", 2,
        ("1/10", "-35816/35721 56795/35721", "11994761/5328000 -11002961/4420800 215846127/181744000"),
        "-17/222 6250/15657 5250987/10382126 4000/23307", "energy is preserved to order 5", PEP, title="PEP (4,2,5)"),
    explicit_entry("pep526", 2,
        ("0.193445628056365", "-0.090431947690469 0.646659568003039",
         "-0.059239621354435 0.598571867726670 -0.010476084304794",
         "0.173154586278662 0.043637751980064 0.949323298732961 -0.262838451019868"),
        "0.054828314201395 0.310080077556546 0.531276882919990 -0.135494569336049 0.239309294658118",
        "energy is preserved to order 6", PEP, digits=15, title="PEP (5,2,6)"),
    MethodEntry("ees25", "explicit", 3, 2,
        "explicit and effectively symmetric: a step back undoes a step to order 5; x = 1/10 by default",
        "Explicit and effectively symmetric Runge–Kutta methods, arXiv:2507.21006 (2025)", _ees25,
        options=("x",), title="EES(2,5)"),
)  # fmt: skip
