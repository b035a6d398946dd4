"""Methods made of methods: compositions and schemes that raise the order, adjoints, repetitions, extrapolations."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from functools import reduce
from math import prod
from typing import NamedTuple

from bseries_base.child_bounds import ChildBounds
from bseries_base.errors import shorten, shown
from integrators.core.arguments import is_listed, items, read_whole
from integrators.core.errors import IntegratorError
from integrators.exact import entries
from integrators.exact.entries import Entry
from integrators.methods.kinds.splitting import NystromSplitting, Splitting
from integrators.methods.programs.evaluations import Evaluation, LinearForm
from integrators.methods.programs.program import (
    Method,
    Program,
    RepeatedProgram,
    appended,
    common_bounds,
    reversed_step,
)

MAX_STEPS = 1000


def composition(steps: Iterable[tuple[Method, object]], *, name: str | None = None) -> Program | Splitting:
    """Composition of methods, each with a fraction of the step.

    Args:
        steps: pairs (method, fraction) in the order of application, with the step fraction · h. The methods must have
            the same parts; fractions are numbers or formulas such as "1/(2-root(2,3))" and may be negative.

    Returns:
        The composition Φ^s_(γ_s h) ∘ … ∘ Φ^1_(γ_1 h): a `Splitting` if all methods are, otherwise a program.

    Raises:
        IntegratorError: a pair is invalid, or the methods differ in their parts.

    Example:
        Half a step of the explicit Euler method, then of the implicit one, is the implicit trapezoidal rule:

        >>> import bseries as bs
        >>> print(bs.composition([(bs.method("explicit-euler"), "1/2"), (bs.method("implicit-euler"), "1/2")]))
        k1 = h f(y)
        k2 = h f(y + 1/2*k1 + 1/2*k2)
        y1 = y + 1/2*k1 + 1/2*k2

    References:
        Hairer, Lubich, Wanner, *Geometric Numerical Integration*, II.4.
    """
    return _composed(steps, name)


def _composed(
    steps: Iterable[tuple[Method, object]], name: str | None, digits: int | None = None
) -> Program | Splitting:
    """The composition, whose fractions have this number of correct digits (None: exact)."""
    pairs = _read_pairs(steps, "steps", "fraction")
    methods = [method for method, _ in pairs]
    name, digits = name or f"composition of {_names(methods)}", _fewest([digits, *(m.digits for m in methods)])
    splittings = [(method, x) for method, x in pairs if isinstance(method, Splitting)]
    if len(splittings) == len(pairs):
        flows = [(part, entries.multiply_entries(x, fraction)) for one, fraction in splittings for part, x in one.flows]
        return Splitting(flows, parts=methods[0].names, name=name, digits=digits)
    evaluations: list[Evaluation] = []
    end = LinearForm(1)
    for method, fraction in pairs:
        end = _append(evaluations, method.program, fraction, end, methods[0])
    return _finish(evaluations, end, methods, name, digits)


def adjoint_method(method: Method, *, name: str | None = None) -> Program | Splitting:
    """The adjoint Φ*_h = Φ_(−h)⁻¹ of a method.

    It has the flows in reverse order for a `Splitting`, otherwise it is a program with the same evaluations.

    Example:
        >>> import bseries as bs
        >>> print(bs.methods.adjoint_method(bs.method("explicit-euler")))
        k1 = h f(y + k1)
        y1 = y + k1

    References:
        Hairer, Lubich, Wanner, *Geometric Numerical Integration*, definition II.3.1.
    """
    method = _read_method(method, "method")
    name = name or f"adjoint of {method.name}"
    if isinstance(method, Splitting):
        return Splitting(method.flows[::-1], parts=method.names, name=name, digits=method.digits)
    return _finish(*reversed_step(method.program), [method], name, method.digits)


def repeat(method: Method, count: int, *, name: str | None = None) -> Program | Splitting:
    """From 1 to 1,000 steps of length h / count as one method.

    Example:
        >>> import bseries as bs
        >>> print(bs.methods.repeat(bs.method("explicit-euler"), 2))
        k1 = h f(y)
        k2 = h f(y + 1/2*k1)
        y1 = y + 1/2*k1 + 1/2*k2
    """
    count = _read_count(count, "count")
    method = _read_method(method, "method")
    name = name or f"{count} steps of {method.name}"
    if isinstance(method, Splitting):
        return _composed([(method, Fraction(1, count))] * count, name)
    return RepeatedProgram(method.program, count, name)


def linear_combination(terms: Iterable[tuple[Method, object]], *, name: str | None = None) -> Program:
    """Weighted mean of the results of several methods, y1 = Σ_j w_j Φ^j_h(y0).

    Args:
        terms: pairs (method, weight); the weights sum to 1. The methods must have the same parts.

    Raises:
        IntegratorError: a pair is invalid, the methods differ in their parts, or the weights do not sum to 1.

    Example:
        >>> import bseries as bs
        >>> explicit, implicit = bs.method("explicit-euler"), bs.method("implicit-euler")
        >>> print(bs.methods.linear_combination([(explicit, "1/2"), (implicit, "1/2")]))
        k1 = h f(y)
        k2 = h f(y + k2)
        y1 = y + 1/2*k1 + 1/2*k2
    """
    pairs = _read_pairs(terms, "terms", "weight")
    methods, weights = [method for method, _ in pairs], [weight for _, weight in pairs]
    total = entries.sum_entries(weights)
    if entries.certainly_differs(total, 1, entries.relative_error("float" if isinstance(total, float) else "QQ", None)):
        raise IntegratorError(f"terms must have weights that sum to 1, but they sum to {total!s:.60}")
    evaluations: list[Evaluation] = []
    ends = [_append(evaluations, method.program, Fraction(1), LinearForm(1), methods[0]) for method in methods]
    increments = (end - LinearForm(1) for end in ends)
    end = sum((increment.times(w) for increment, w in zip(increments, weights, strict=True)), LinearForm(1))
    name = name or f"combination of {_names(methods)}"
    return _finish(evaluations, end, methods, name, _fewest(method.digits for method in methods))


def extrapolation(
    method: Method, order: int, steps: Sequence[int] = (1, 2), *, symmetric: bool = False, name: str | None = None
) -> Program:
    """Richardson extrapolation: a linear combination of the results of n_j steps of length h / n_j for several n_j.

    With m numbers of steps the weights remove the powers h^p, …, h^(p+m−2) from the error of a method of order p. The
    error of a symmetric method has only the powers h^p, h^(p+2), …, so each further number of steps gains two orders.

    Args:
        order: its order p.
        steps: the numbers of steps n_j, all different.
        symmetric: whether the error has only powers h^p, h^(p+2), ….

    Returns:
        A method of order p + m − 1, or p + 2(m − 1) if `symmetric`.

    Raises:
        IntegratorError: `order` is not a positive integer, or `steps` are not distinct positive integers.

    Example:
        >>> import bseries as bs
        >>> print(bs.methods.extrapolation(bs.method("explicit-euler"), order=1))  # the explicit midpoint rule
        k1 = h f(y)
        k2 = h f(y)
        k3 = h f(y + 1/2*k2)
        y1 = y - k1 + k2 + k3

    References:
        Hairer, Nørsett, Wanner, *Solving Ordinary Differential Equations I*, II.9.
    """
    method, order = _read_method(method, "method"), _read_count(order, "order")
    counts = [_read_count(n, f"steps[{j}]") for j, n in enumerate(items(steps, "steps"), 1)]
    if not counts or len(set(counts)) < len(counts):
        raise IntegratorError(f"steps must be different numbers, but were {shorten(str(counts))}")
    # Σ w_j = 1 and Σ w_j n_j^−(p + gap·i) = 0 for i < m − 1: with x_j = n_j^−gap the numbers w_j n_j^−p annihilate
    # polynomials of degree below m − 1 in x_j, as the coefficients 1 / Π_(i≠j) (x_j − x_i) of a divided difference do.
    x = [Fraction(1, n ** (2 if symmetric else 1)) for n in counts]
    weights = [n**order / prod((a - b for b in x if b != a), start=Fraction(1)) for n, a in zip(counts, x, strict=True)]
    terms = [(repeat(method, n), weight / sum(weights)) for n, weight in zip(counts, weights, strict=True)]
    return linear_combination(terms, name=name or f"extrapolation of {method.name}")


def _append(
    evaluations: list[Evaluation], program: Program, factor: Entry, start: LinearForm, first: Method
) -> LinearForm:
    """Append a step from `start`, with parts numbered as in the first method; return its end point."""
    parts = [first.names.index(part) for part in program.names]
    added, end = appended(program, factor, first=len(evaluations), start=start, parts=parts)
    evaluations += added
    return end


def _finish(
    evaluations: Sequence[Evaluation], end: LinearForm, methods: Sequence[Method], name: str, digits: int | None
) -> Program:
    bounds = reduce(common_bounds, (_bounds(method.program, methods[0].names) for method in methods))
    changes = {"name": name, "reference": None, "digits": digits, "max_children": bounds}
    return methods[0].program.changed(evaluations=evaluations, result=end, **changes)


def _bounds(program: Program, names: Sequence[str]) -> ChildBounds | None:
    """The bounds of a method with its parts in the order of `names`."""
    if program.max_children is None:
        return None
    order = [program.names.index(name) for name in names]
    rows = [program.max_children[part] for part in order]
    return tuple((*(row[part] for part in order), *row[len(names) :]) for row in rows)


def _fewest(digits: Iterable[int | None]) -> int | None:
    return min((count for count in digits if count is not None), default=None)


def _names(methods: Iterable[Method]) -> str:
    return shorten(", ".join(method.name for method in methods))


def _read_pairs(pairs: object, argument: str, number: str) -> list[tuple[Method, Entry]]:
    """The methods and numbers of a sequence of pairs, all with the same parts."""
    read: list[tuple[Method, Entry]] = []
    for i, pair in enumerate(items(pairs, argument), 1):
        if not is_listed(pair) or len(pair) != 2:
            raise IntegratorError(f"{argument}[{i}] must be a method and its {number}, but was {shown(pair)}")
        method = _read_method(pair[0], f"{argument}[{i}]")
        read.append((method, entries.read_entry(pair[1], f"{number} of {argument}[{i}]")))
        first, program = read[0][0].program, method.program
        if set(program.names) != set(first.names) or set(program.auxiliary) != set(first.auxiliary):
            found = [
                f"{shorten(x.name)} has {', '.join(filter(None, x.names)) or 'no parts'}" for x in (first, program)
            ]
            raise IntegratorError(f"{argument} must be methods with the same parts, but {' and '.join(found)}")
    if not read:
        raise IntegratorError(f"{argument} must have at least one pair, but was empty")
    return read


def _read_method(method: object, argument: str) -> Method:
    if not isinstance(method, Method):
        raise IntegratorError(f"{argument} must be a method, but was {shown(method)}")
    return method


def _read_count(count: object, argument: str) -> int:
    return read_whole(count, argument, f"an integer from 1 to {MAX_STEPS}", 1, MAX_STEPS)


MAX_ORDER = 30


def triple_jump(method: Method, order: int, *, name: str | None = None) -> Program | Splitting:
    """Three steps of γh, (1−2γ)h, γh with γ = 1/(2 − 2^(1/(p+1))).

    Args:
        method: a method of even order p.
        order: its order p.

    Returns:
        A method of order p + 1; a symmetric one of order p + 2 if `method` is symmetric.

    Raises:
        IntegratorError: `method` is not a method, or `order` is not an even number.

    Example:
        >>> import bseries as bs
        >>> [round(float(x), 4) for _, x in bs.methods.triple_jump(bs.method("strang"), 2).flows]
        [0.6756, 1.3512, -0.1756, -1.7024, -0.1756, 1.3512, 0.6756]

    References:
        M. Suzuki, Phys. Lett. A 146 (1990) 319–323, doi:10.1016/0375-9601(90)90962-N; H. Yoshida, Phys. Lett. A 150
        (1990) 262–268, doi:10.1016/0375-9601(90)90092-3; Hairer, Lubich, Wanner, *Geometric Numerical Integration*,
        formula (II.4.4).
    """
    return _steps_around_a_remainder(method, order, 1, name or f"triple jump of {_name(method)}")


def suzuki_fractal(method: Method, order: int, *, name: str | None = None) -> Program | Splitting:
    """Five steps of γh, γh, (1−4γ)h, γh, γh with γ = 1/(4 − 4^(1/(p+1))), all shorter than h.

    The arguments, the order of the result and the errors raised are those of `triple_jump`.

    Example:
        >>> import bseries as bs
        >>> [round(float(x), 4) for _, x in bs.methods.suzuki_fractal(bs.method("strang"), 2).flows]
        [0.2072, 0.4145, 0.4145, 0.4145, -0.1217, -0.658, -0.1217, 0.4145, 0.4145, 0.4145, 0.2072]

    References:
        M. Suzuki, Phys. Lett. A 146 (1990) 319–323, doi:10.1016/0375-9601(90)90962-N; Hairer, Lubich, Wanner,
        *Geometric Numerical Integration*, formula (II.4.5).
    """
    return _steps_around_a_remainder(method, order, 2, name or f"Suzuki's fractal of {_name(method)}")


def _steps_around_a_remainder(method: Method, order: object, count: int, name: str) -> Program | Splitting:
    """Steps γh, `count` times before and after the remainder to h, with γ = 1/(m − m^(1/(p+1))), m = 2 · count.

    γ is written as Σ_k m^(p−k) x^k / (m^(p+1) − m) with x = m^(1/(p+1)), a normal form with a rational denominator.
    """
    if isinstance(order, bool) or not isinstance(order, int) or order % 2 or not 2 <= order <= MAX_ORDER:
        raise IntegratorError(f"order must be an even number from 2 to {MAX_ORDER}, but was {shown(order)}")
    import sympy

    m, n = 2 * count, order + 1
    x = sympy.root(m, n)
    terms = (sympy.Rational(m ** (n - 1 - k), m**n - m) * x**k for k in range(n))
    gamma = entries.read_entry(sympy.Add(*terms), "gamma")
    outer = [gamma] * count
    rest = entries.sum_entries((Fraction(1), entries.multiply_entries(gamma, Fraction(-m))))
    return _composed([(method, step) for step in (*outer, rest, *outer)], name)


def symmetric_composition(method: Method, scheme: str, *, name: str | None = None) -> Program | Splitting:
    """Composition with the steps γ_1 h, …, γ_s h of a published scheme, γ_(s+1−i) = γ_i.

    Args:
        method: a symmetric method of order 2.
        scheme: the name of a composition in the catalogue, such as "kahan-li8"; see `recommended`.

    Returns:
        A symmetric method of the order of the scheme.

    Raises:
        IntegratorError: `method` is not a method, or `scheme` is unknown.

    Example:
        Splittings that begin with different parts give different compositions; this one begins with the drift:

        >>> import bseries as bs
        >>> verlet = bs.Splitting([("q", "1/2"), ("p", 1), ("q", "1/2")], parts=("p", "q"))
        >>> bs.methods.symmetric_composition(verlet, "kahan-li8")
        <Splitting kahan-li8 of custom: p, q, 35 stages>

    References:
        Hairer, Lubich, Wanner, *Geometric Numerical Integration*, V.3.2.
    """
    exact = {"triple-jump4": triple_jump, "suzuki4": suzuki_fractal}
    key = scheme.lower().replace("_", "-") if isinstance(scheme, str) else ""
    title = name or f"{key} of {_name(method)}"
    if key in exact:
        return exact[key](method, 2, name=title)
    if key not in SCHEMES:
        raise IntegratorError(f"scheme must be one of {', '.join((*exact, *SCHEMES))}, but was {shown(scheme)}")
    outer = [Fraction(step) for step in SCHEMES[key].outer.split()]
    steps = [*outer, 1 - 2 * sum(outer), *outer[::-1]]
    return _composed([(method, x) for x in steps], title, SCHEMES[key].digits)


def adjoint_composition(method: Method, splitting: Splitting, *, name: str | None = None) -> Program | Splitting:
    """Alternating steps of a first-order method and its adjoint, derived from a splitting method in two parts.

    From the flows c_1, c_2, … of the splitting method, the steps are d_1 = c_1, d_k = c_k − d_(k−1). For the
    Lie–Trotter method in these parts the composition is the splitting method itself, and both have the same order
    conditions. Splitting methods in two parts thus apply to three or more parts, and to any first-order method.

    Args:
        method: a method of order 1, such as the symplectic Euler method or `lie_trotter` with any number of parts.
        splitting: a splitting method in two arbitrary parts.

    Returns:
        A method of the order of the splitting, symmetric if the splitting is.

    Raises:
        IntegratorError: `method` is not a method, or `splitting` is not such a splitting method.

    Example:
        >>> import bseries as bs
        >>> three = bs.methods.adjoint_composition(bs.methods.lie_trotter(["a", "b", "c"]), bs.method("strang"))
        >>> [(part, str(x)) for part, x in three.flows]
        [('a', '1/2'), ('b', '1/2'), ('c', '1'), ('b', '1/2'), ('a', '1/2')]

    References:
        R. I. McLachlan, SIAM J. Sci. Comput. 16 (1995) 151–168, doi:10.1137/0916010; Hairer, Lubich, Wanner,
        *Geometric Numerical Integration*, II.5 and III.3.3.
    """
    suitable = isinstance(splitting, Splitting) and not isinstance(splitting, NystromSplitting)
    if not suitable or len(splitting.names) != 2 or splitting.issues:
        raise IntegratorError(
            f"splitting must be a consistent splitting method in two parts of any kind, but was {_name(splitting)}"
        )
    steps: list[Entry] = [Fraction(0)]
    for _, coefficient in splitting.flows[:-1]:
        steps.append(entries.sum_entries((coefficient, entries.multiply_entries(steps[-1], Fraction(-1)))))
    pair = method, adjoint_method(method)
    alternating = [(pair[k % 2], x) for k, x in enumerate(steps[1:])]
    return _composed(alternating, name or f"{splitting.name} of {_name(method)}", splitting.digits)


def _name(method: object) -> str:
    return shorten(str(getattr(method, "name", method)))


SUZUKI = "M. Suzuki, Phys. Lett. A 146 (1990) 319–323, doi:10.1016/0375-9601(90)90962-N"
YOSHIDA = "H. Yoshida, Phys. Lett. A 150 (1990) 262–268, doi:10.1016/0375-9601(90)90092-3"
FOREST_RUTH = "E. Forest, R. D. Ruth, Physica D 43 (1990) 105–117, doi:10.1016/0167-2789(90)90019-L"
SUZUKI_UMENO = (
    "M. Suzuki, K. Umeno, in: Computer Simulation Studies in Condensed-Matter Physics VI (1993) 74–86, "
    "doi:10.1007/978-3-642-78448-4_7"
)
MCLACHLAN = "R. I. McLachlan, SIAM J. Sci. Comput. 16 (1995) 151–168, doi:10.1137/0916010"
KAHAN_LI = "W. Kahan, R.-C. Li, Math. Comp. 66 (1997) 1089–1099, doi:10.1090/S0025-5718-97-00873-9"
SOFRONIOU_SPALETTA = "M. Sofroniou, G. Spaletta, Optim. Methods Softw. 20 (2005) 597–613, doi:10.1080/10556780500140664"
HLW = "Hairer, Lubich, Wanner, Geometric Numerical Integration (2006), formula"


class Scheme(NamedTuple):
    """The steps of a symmetric composition."""

    order: int  # the order of the composition of a symmetric method of order 2
    digits: int  # the number of correct significant digits of the steps
    outer: str  # the steps before the middle one, which follows from the sum 1
    about: str  # its distinguishing property, in one line
    reference: str
    title: str  # its name in titles and legends

    @property
    def steps(self) -> int:
        """The number s of steps."""
        return 2 * len(self.outer.split()) + 1


# Suzuki and Umeno's scheme is an isolated solution of the order conditions; so are McLachlan's for given first steps
# (0.1867 and 25/194). Their coefficients, printed with about 20 digits, were recomputed from the conditions.
SCHEMES = {
    "yoshida6": Scheme(6, 26, "0.78451361047755726381949763 0.23557321335935813368479318 -1.17767998417887100694641568",
        "the fewest for order 6, as 26-digit decimals", f"{YOSHIDA}; {HLW} (V.3.11)", title="Yoshida 6"),
    "kahan-li6": Scheme(6, 25,
        "0.39216144400731413927925056 0.33259913678935943859974864 -0.70624617255763935980996482 "
        "0.08221359629355080023149045",
        "as 26-digit decimals", f"{KAHAN_LI}; {HLW} (V.3.12)", title="Kahan–Li 6"),
    "mclachlan6": Scheme(6, 32,
        "0.1867 0.5554970237124783991569135436283912 0.1294669489134753580560452092102048 "
        "-0.8432656233877346085491427813848150",
        "as 20-digit decimals refined to 32", MCLACHLAN, title="McLachlan 6"),
    "sofroniou-spaletta6": Scheme(6, 30,
        "0.21375583945878254555518066964857 0.18329381407425713911385974425217 0.17692819473098943794898811709929 "
        "-0.44329082681170215849622829626258 0.11728560432865935385403585669136",
        "with small errors, as 32-digit decimals; recommended to compose for order 6", SOFRONIOU_SPALETTA,
        title="Sofroniou–Spaletta 6"),
    "sofroniou-spaletta6-13": Scheme(6, 30,
        "0.13861930854051695245808013042625 0.13346562851074760407046858832209 0.13070531011449225190542755785015 "
        "0.12961893756907034772505366537091 -0.35000324893920896516170830911323 0.11805530653002387170273438954049",
        "as 32-digit decimals", SOFRONIOU_SPALETTA, title="Sofroniou–Spaletta 6 (13)"),
    "suzuki-umeno8": Scheme(8, 32,
        "0.7416703643506129534482278017838063 -0.4091008258000315939973000958935634 "
        "0.1907547102962383799538762564503717 -0.5738624711160822666563877266355357 "
        "0.2990641813036559238444635406886030 0.3346249182452981837849579798821822886 "
        "0.3152930923967665966320566638110024",
        "the fewest for order 8, as 26-digit decimals refined to 32", f"{SUZUKI_UMENO}; {MCLACHLAN}; {HLW} (V.3.13)",
        title="Suzuki–Umeno 8"),
    "kahan-li8": Scheme(8, 25,
        "0.13020248308889008087881763 0.56116298177510838456196441 -0.38947496264484728640807860 "
        "0.15884190655515560089621075 -0.39590389413323757733623154 0.18453964097831570709183254 "
        "0.25837438768632204729397911 0.29501172360931029887096624",
        "as 26-digit decimals", f"{KAHAN_LI}; {HLW} (V.3.14)", title="Kahan–Li 8"),
    "mclachlan8": Scheme(8, 32,
        "25/194 0.5815140871052509624302422782038137 -0.4101753714698501375324061500890487 "
        "0.1851469357165877326532719498634895 -0.4095523434208514193398451736889093 "
        "0.1444059410800120410600751871569277 0.2783355003936796513091070628124172 "
        "0.3149566839162948578902813119729508819",
        "as 20-digit decimals refined to 32", MCLACHLAN, title="McLachlan 8"),
    "sofroniou-spaletta8": Scheme(8, 30,
        "0.10647728984550031823931967854896 0.10837408645835726397433410591546 0.35337821052654342419534541324080 "
        "-0.23341414023165082198780281128319 -0.24445266791528841269462171413216 0.11317848435755633314700952515599 "
        "0.11892905625000350062692972283951 0.12603912321825988140305670268365 0.12581718736176041804392391641587 "
        "0.11699135019217642180722881433533",
        "with small errors, as 32-digit decimals; recommended for order 8", SOFRONIOU_SPALETTA,
        title="Sofroniou–Spaletta 8"),
    "kahan-li10": Scheme(10, 24,
        "0.09040619368607278492161150 0.53591815953030120213784983 0.35123257547493978187517736 "
        "-0.31116802097815835426086544 -0.52556314194263510431065549 0.14447909410225247647345695 "
        "0.02983588609748235818064083 0.17786179923739805133592238 0.09826906939341637652532377 "
        "0.46179986210411860873242126 -0.33377845599881851314531820 0.07095684836524793621031152 "
        "0.23666960070126868771909819 -0.49725977950660985445028388 -0.30399616617237257346546356 "
        "0.05246957188100069574521612",
        "as 26-digit decimals", f"{KAHAN_LI}; {HLW.replace('2006', '2002')} (V.3.15)", title="Kahan–Li 10"),
    "sofroniou-spaletta10": Scheme(10, 30,
        "0.078795722521686419263907679337684 0.31309610341510852776481247192647 0.027918383235078066109520273275299 "
        "-0.22959284159390709415121339679655 0.13096206107716486317465685927961 -0.26973340565451071434460973222411 "
        "0.074973343155891435666137105641410 0.11199342399981020488957508073640 0.36613344954622675119314812353150 "
        "-0.39910563013603589787862981058340 0.10308739852747107731580277001372 0.41143087395589023782070411897608 "
        "-0.0048663605831352617621956593099771 -0.39203335370863990644808193642610 "
        "0.051942502962449647037182904015976 0.050665090759924496335874344156866 0.049674370639729879054568800279461",
        "with small errors, as 32-digit decimals; recommended for order 10", f"{SOFRONIOU_SPALETTA}; {HLW} (V.3.15)",
        title="Sofroniou–Spaletta 10"),
}  # fmt: skip
