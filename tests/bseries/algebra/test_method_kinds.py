"""Every kind of method: its series against the power series of the step as its source defines it, and its orders."""

from fractions import Fraction

import method_definitions as definitions
import pytest
import sympy
from power_series_oracle import ORDER, coefficients, partial, value

import bseries as bs
from integrators.methods.catalogue.registry import RECOMMENDED, recommended
from integrators.methods.programs.program import Program


def differentials(table, fields, names, y):
    """F(τ)(y) for every tree, from the definition: derivatives of the polynomials along the children's vectors."""
    found = {}

    def along(polynomial, vector):
        total = {}
        for i, x in enumerate(vector):
            for key, factor in partial(polynomial, i).items():
                total[key] = total.get(key, 0) + factor * x
        return total

    for tree in table:
        field = fields[names[tree.color]]
        for child in tree.children:
            field = [along(p, found[child]) for p in field]
        found[tree] = [x.terms.get((0, 0), Fraction(0)) for x in value(field, y)]
    return found


def evaluated(series, fields, y):
    """Σ h^|τ|/σ(τ) a(τ) F(τ)(y) by powers of h, for each component."""
    total = [[x.terms.get((0, 0), Fraction(0)), *[Fraction(0)] * ORDER] for x in y]
    known = differentials(series.table, fields, series.names or ("",), y)
    for tree, a in series.items():
        for component, x in zip(total, known[tree], strict=True):
            component[tree.order] += a * x / tree.symmetry
    return total


@pytest.mark.few(5)
@pytest.mark.parametrize("name", definitions.CASES)
def test_series_against_the_power_series_of_the_step(name):
    case = definitions.CASES[name]
    y = definitions.start(case)
    found = evaluated(bs.series(case.method, ORDER), case.fields, y)
    assert found == coefficients(case.step(case.fields, y))
    assert found != coefficients(case.wrong(case.fields, y))


@pytest.mark.few(5)
@pytest.mark.parametrize("name", definitions.CASES)
def test_trees_that_cannot_contribute_may_be_left_out(name):
    case = definitions.CASES[name]
    y = definitions.start(case)
    restricted = bs.series(case.method, ORDER, max_children=getattr(case.method, "max_children", None))
    assert evaluated(restricted, case.fields, y) == coefficients(case.step(case.fields, y))


ENTRIES = [entry for entry in bs.catalogue() if not entry.is_tableau and not entry.is_family]
# There are too many trees in two colours for splittings of orders 8 and 10: test_high_order_compositions has words.
BY_TREES = [entry for entry in ENTRIES if not (entry.kind == "splitting" and int(entry.order) > 6)]


def residuals(method, order):
    """The largest |a(τ) − e(τ)| among trees of each number of nodes; with an auxiliary part e is 0 on its trees."""
    children = getattr(method, "max_children", None)
    s = bs.series(method, order, max_children=children)
    exact = bs.exact_flow(order, colors=len(method.names), max_children=children)
    auxiliary = [method.names.index(name) for name in method.program.auxiliary]
    found = [0.0] * (order + 1)
    for tree, a in s.items():
        wanted = 0 if any(color in auxiliary for color in tree.colors) else exact[tree]
        found[tree.order] = max(found[tree.order], abs(float(a - wanted)))
    return found


@pytest.mark.few(15)
@pytest.mark.parametrize("entry", BY_TREES, ids=lambda entry: entry.name)
def test_catalogue_orders_hold_and_end_there(entry):
    method = bs.method(entry.name, **dict.fromkeys(entry.parameters, "2/7"))
    if method.domain == "algebraic" and isinstance(method, bs.Splitting):  # in number fields this takes minutes
        flows = [(part, Fraction(str(sympy.N(x, 40)))) for part, x in method.flows]
        method = bs.Splitting(flows, parts=method.names)
    found = residuals(method, int(entry.order) + 1)
    tolerance = 10.0 ** (2 - method.digits) if method.digits else 1e-14
    assert max(found[:-1]) <= tolerance
    assert found[-1] > 1e-6


@pytest.mark.parametrize("order", RECOMMENDED["nystrom splitting"])
def test_recommended_nystrom_splittings_have_the_smallest_effective_error(order):
    def effective_error(entry):
        method = bs.method(entry.name)
        s = bs.series(method, order + 1, max_children=method.max_children)
        exact = bs.exact_flow(order + 1, colors=2, max_children=method.max_children)
        last = [float(a - exact[tree]) / tree.symmetry for tree, a in s.items() if tree.order == order + 1]
        return method.stages // 2 * sum(x * x for x in last) ** (1 / (2 * order))

    entries = [entry for entry in ENTRIES if entry.kind == "nystrom splitting" and entry.order == order]
    assert min(entries, key=effective_error).name == recommended(order, "nystrom splitting")


@pytest.mark.parametrize("stages", [1, 2, 3])
def test_order_of_energy_preserving_collocation(stages):
    assert bs.order_of(bs.series(bs.method(f"energy-collocation{stages}"), 2 * stages + 1)) == 2 * stages


def test_averaged_vector_field_on_the_linear_equation():
    """y' = −y: y − hy + h²y/2 − h³y/4, so the coefficients of tall trees are 1, 1/2, 1/4, …"""
    s = bs.series(bs.method("avf"), 4)
    assert [s[f"[{','.join(map(str, range(n)))}]"] for n in range(1, 5)] == [Fraction(1, 2**n) for n in range(4)]


@pytest.mark.parametrize("name", ["rk4", "tsit5", "implicit-midpoint", "radau-iia2", "stormer-verlet", "kahan"])
def test_program_of_a_tableau_has_the_series_of_the_tableau(name):
    method = bs.method(name)
    assert isinstance(method.program, Program)
    assert dict(bs.series(method.program, 5).items()) == dict(bs.series(method, 5).items())


@pytest.mark.parametrize("name", ["gauss2", "sdirk2", "crouzeix3"])
def test_program_of_a_tableau_with_roots_or_symbols(name):
    method = bs.method(name)
    difference = bs.series(method.program, 4) - bs.series(method, 4)
    assert not any(difference.coefficients())


def test_kahan_is_more_than_its_tableau_only_for_quadratic_fields():
    """Celledoni et al. (2013): for quadratic fields the method is linearly implicit, conjugate to energy-preserving."""
    full, quadratic = (bs.series(bs.method("kahan"), 4, max_children=k) for k in (None, 2))
    assert all(quadratic[tree] == full[tree] for tree in quadratic)
    assert len(quadratic) < len(full)


def test_takahashi_imada_changes_one_term_of_the_h2_term_of_verlet():
    """The lecture, section 4: α h² f' f is added to the force, and nothing else changes at this order."""
    improved = bs.modified_equation(bs.method("takahashi-imada"), 3, max_children=[[0, None], [1, 0]])
    plain = bs.modified_equation(bs.method("rkn-verlet"), 3, max_children=[[0, None], [1, 0]])
    changes = {str(tree): (improved[tree] - plain[tree]) / tree.symmetry for tree in plain}
    assert {tree: x for tree, x in changes.items() if x} == {"p[q[p]]": Fraction(1, 12)}


def test_decimals_keep_their_digits():
    assert bs.series(bs.method("grk4a"), 4).digits == 12
    assert bs.series(bs.methods.repeat(bs.method("grk4a"), 2), 3).digits == 12


@pytest.mark.parametrize("name", ["rk4", "gauss2", "sdirk2", "rosenbrock-shampine4", "tdrk4", "symplectic-euler-p"])
def test_repeated_steps_are_powers(name):
    method = bs.method(name)
    repeated = bs.methods.repeat(method, 3)
    composed = bs.composition([(method, Fraction(1, 3))] * 3)
    for function in (bs.series, bs.modified_equation):
        assert function(repeated, 5) == function(composed, 5)
        assert function(repeated, 5) != function(bs.methods.repeat(method, 2), 5)
        assert function(repeated, 2).label == repeated.name
    assert repeated.evaluations == composed.program.evaluations
    assert repeated.stages == composed.stages


def test_a_thousand_steps_cost_as_little_as_ten():
    repeated = bs.methods.repeat(bs.method("rk4"), 1000)
    assert bs.series(repeated, 5)["[[[[τ]]]]"] == Fraction(1, 120) - Fraction(1, 120 * 1000**4)
    assert (repeated.stages, bs.order_of(repeated)) == (4000, 4)
