"""Low-storage and Shu–Osher forms of explicit Runge–Kutta methods, in which they are stepped.

Each is given by the coefficients of its source, and its digits are those for which the order conditions hold.
"""

from __future__ import annotations

from functools import partial

from integrators.methods.catalogue.registry import MethodEntry, lower_rows
from integrators.methods.tableaux.registers import KINDS, RegisterForm
from integrators.methods.tableaux.runge_kutta import RungeKutta

CARPENTER_KENNEDY = "M. H. Carpenter, C. A. Kennedy, Fourth-order 2N-storage Runge–Kutta schemes, NASA TM 109112 (1994)"
KENNEDY = "C. A. Kennedy et al., Appl. Numer. Math. 35 (2000) 177–219, doi:10.1016/S0168-9274(99)00141-5"
KETCHESON = "D. I. Ketcheson, SIAM J. Sci. Comput. 30 (2008) 2113–2136, doi:10.1137/07070485X"
PARSANI = "M. Parsani et al., SIAM J. Sci. Comput. 35 (2013) A957–A986, doi:10.1137/120885899"


def form_entry(
    name: str, kind: str, order: int, description: str, reference: str, *coefficients: str, title: str,
    digits: int | None = None,
) -> MethodEntry:  # fmt: skip
    """Entry of a method given by its form: numbers separated by spaces, and rows of matrices by semicolons.

    The coefficients have the order of `KINDS`; rows are padded with zeros, and a form Shu–Osher begins with row 2.
    """
    first, *_ = coefficients
    stages = len(first.split(";")) if kind == "Shu-Osher" else len(first.split())
    given: dict[str, object] = {}
    for (label, shape), text in zip(KINDS[kind].shapes.items(), coefficients, strict=True):
        rows = ["", *text.split(";")] if kind == "Shu-Osher" else text.split(";")
        given[label] = text.split() if len(shape) == 1 else lower_rows(rows, stages if kind == "Shu-Osher" else 3)
    build = partial(_build, kind, given, digits)
    return MethodEntry(name, "explicit", stages, order, description, reference, build, title=title)


def _build(kind: str, given: dict[str, object], digits: int | None, *, name: str, reference: str) -> RungeKutta:
    return RungeKutta.from_form(RegisterForm(kind, given, digits=digits), name=name, reference=reference)


METHODS = (
    form_entry("williamson3", "2N", 3, "three stages of order 3 in 2N storage",
        "J. H. Williamson, J. Comput. Phys. 35 (1980) 48–56, doi:10.1016/0021-9991(80)90033-9",
        "0 -5/9 -153/128", "1/3 15/16 8/15", title="Williamson 3"),
    form_entry("carpenter-kennedy54", "2N", 4, "five stages of order 4 in 2N storage",
        CARPENTER_KENNEDY,
        "0 -567301805773/1357537059087 -2404267990393/2016746695238 -3550918686646/2091501179385 "
        "-1275806237668/842570457699",
        "1432997174477/9575080441755 5161836677717/13612068292357 1720146321549/2090206949498 "
        "3134564353537/4481467310338 2277821191437/14882151754819",
        title="Carpenter–Kennedy 54", digits=25),
    form_entry("berland64", "2N", 4, "six stages of order 4 in 2N storage with little dispersion: RK46-NL",
        "J. Berland, C. Bogey, C. Bailly, Comput. Fluids 35 (2006) 1459–1463, doi:10.1016/j.compfluid.2005.04.003",
        "0 -0.737101392796 -1.634740794343 -0.74473900378 -1.469897351522 -2.813971388035",
        "0.032918605146 0.8232569982 0.3815309489 0.200092213184 1.718581042715 0.27",
        title="Berland 64", digits=12),
    form_entry("toulorge-desmet84", "2N", 4,
        "eight stages of order 4 in 2N storage for discontinuous Galerkin methods: RKC84",
        "T. Toulorge, W. Desmet, J. Comput. Phys. 231 (2012) 2067–2091, doi:10.1016/j.jcp.2011.11.024",
        "0 -0.721296248227924 -0.0107733657161298 -0.516258469893097 -1.730100286632201 -5.200129304403076 "
        "0.783705894541642 -0.544583609433219",
        "0.2165936736758085 0.1773950826411583 0.0180253861162329 0.0847347637254149 0.8129106974622483 "
        "1.90341603042276 0.1314841743399048 0.2082583170674149",
        title="Toulorge–Desmet 84", digits=15),
    form_entry("niegemann124", "2N", 4,
        "twelve stages of order 4 in 2N storage with a large region of stability for waves",
        "J. Niegemann, R. Diehl, K. Busch, J. Comput. Phys. 231 (2012) 364–372, doi:10.1016/j.jcp.2011.09.003",
        "0 -0.0923311242368072 -0.9441056581158819 -4.3271273247576394 -2.1557771329026072 -0.9770727190189062 "
        "-0.7581835342571139 -1.7977525470825499 -2.691566797270077 -4.6466798960268143 -0.1539613783825189 "
        "-0.5943293901830616",
        "0.0650008435125904 0.0161459902249842 0.5758627178358159 0.1649758848361671 0.3934619494248182 "
        "0.0443509641602719 0.2074504268408778 0.6914247433015102 0.3766646883450449 0.0757190350155483 "
        "0.2027862031054088 0.2167029365631842",
        title="Niegemann 124", digits=16),
    form_entry("kennedy43", "2R", 3,
        "four stages of order 3 in two registers: RK3(2)4[2R+]C without its embedded weights",
        KENNEDY,
        "1017324711453/9774461848756 8237718856693/13685301971492 57731312506979/19404895981398 "
        "-101169746363290/37734290219643",
        "11847461282814/36547543011857 3943225443063/7078155732230 -346793006927/4029903576067",
        title="Kennedy 43", digits=25),
    form_entry("kennedy54", "2R", 4,
        "five stages of order 4 in two registers: RK4(3)5[2R+]C without its embedded weights",
        KENNEDY,
        "1153189308089/22510343858157 1772645290293/4653164025191 -1672844663538/4480602732383 "
        "2114624349019/3568978502595 5198255086312/14908931495163",
        "970286171893/4311952581923 6584761158862/12103376702013 2251764453980/15575788980749 "
        "26877169314380/34165994151039",
        title="Kennedy 54", digits=25),
    form_entry("calvo64", "2R", 4, "six stages of order 4 in two registers with little dispersion",
        "M. Calvo, J. M. Franco, L. Rández, J. Comput. Phys. 201 (2004) 1–12, doi:10.1016/j.jcp.2004.05.012",
        "0.10893125722541 0.13201701492152 0.38911623225517 -0.59203884581148 0.47385028714844 0.48812405426094",
        "0.28878526699679 0.27283594644263 0.47167254854945 0.06600540453183 0.79248022128095",
        title="Calvo 64", digits=14),
    form_entry("parsani53", "3S*", 3, "five stages of order 3 in 3S* storage for spectral differences",
        PARSANI,
        "0.23002859824852059 0.30214498165167158 0.80256010238856679 0.43621618871511753 0.11292705979513513",
        "0 1 0; 0.25876919610938998 0.55284013909611196 0; -0.13243708384977859 0.67318513326032769 0; "
        "0.050556648948362981 0.28031054965521607 0.27525797946334213; 0.56705507883024708 0.55215115815918758 "
        "-0.89505445022148511",
        "1 0.34076878915216791 0.34143871647890728 0.72292984084963252 0",
        title="Parsani 53", digits=16),
    form_entry("ssprk33", "Shu-Osher", 3, "optimal strong-stability-preserving method with three stages",
        "C.-W. Shu, S. Osher, J. Comput. Phys. 77 (1988) 439–471, doi:10.1016/0021-9991(88)90177-5",
        "1; 3/4 1/4; 1/3 0 2/3", "1; 0 1/4; 0 0 2/3", title="SSPRK33"),
    form_entry("ssprk43", "Shu-Osher", 3, "strong-stability-preserving method with four stages, SSP coefficient 2",
        "R. J. Spiteri, S. J. Ruuth, SIAM J. Numer. Anal. 40 (2002) 469–491, doi:10.1137/S0036142901389025",
        "1; 0 1; 2/3 0 1/3; 0 0 0 1", "1/2; 0 1/2; 0 0 1/6; 0 0 0 1/2", title="SSPRK43"),
    form_entry("ssprk54", "Shu-Osher", 4, "strong-stability-preserving method of order 4 with five stages",
        "R. J. Spiteri, S. J. Ruuth, SIAM J. Numer. Anal. 40 (2002) 469–491, doi:10.1137/S0036142901389025",
        "1; 0.444370493651235 0.555629506348765; 0.620101851488403 0 0.379898148511597; 0.178079954393132 0 0 "
        "0.821920045606868; 0 0 0.517231671970585 0.096059710526147 0.386708617503269",
        "0.391752226571890; 0 0.368410593050371; 0 0 0.251891774271694; 0 0 0 0.544974750228521; 0 0 0 "
        "0.063692468666290 0.226007483236906",
        title="SSPRK54", digits=15),
    form_entry("ssprk104", "3S*", 4, "strong-stability-preserving method with ten stages, in low storage",
        KETCHESON,
        "1/6 1/6 1/6 1/6 1/15 1/6 1/6 1/6 1/6 1/10",
        "1; 1; 1; 1; 2/5 0 3/5; 1; 1; 1; 1; 3/5 1 -1/2",
        "0 0 0 0 0 9/10 0 0 0 0",
        title="SSPRK104"),
)  # fmt: skip
