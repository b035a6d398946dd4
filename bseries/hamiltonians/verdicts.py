"""Order to which the modified equation of a method is Hamiltonian: for a class of Hamiltonians, and on a scene.

Trees decide for a class of Hamiltonians. A field f preserves the structure B(y) if Df B + B Dfᵀ = DB[f]; for an
invertible B this means that B^(−1) f is a gradient on simply connected domains. On a scene this is tested in high
precision at a random point, with random vectors u and v:

    u · Df[B v] − v · Df[B u] = u · DB[f] v.

Both sides are analytic functions: with probability one they agree there only if they agree everywhere. Two directional
derivatives suffice in any dimension. With symbolic parameters, formulas decide.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from random import Random
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import mpmath

from bseries.algebra.bseries import BSeries
from bseries.algebra.modified import modified_equation
from bseries.algebra.stages import check_method, is_chain
from bseries.analysis.order import Verdict, decidable, order_of, trusted
from bseries.analysis.structure import SEPARABLE, hamiltonian_field
from bseries.exact.domains import make_values
from bseries.fields.inputs import MpNumber
from bseries.fields.modified_fields import SceneSeries, modified_field
from bseries.fields.modified_invariants import covector, inverse_structure, is_gradient, structure_matrix
from bseries.scene_text import with_effects
from bseries_base.table import Column, Table, as_frame, as_html
from integrators import PartitionedRungeKutta, RungeKutta
from integrators.exact.functions import as_function
from integrators.methods.catalogue.registry import as_method
from integrators.methods.programs.program import Method, common_bounds
from integrators.scenes.catalogue.registry import as_scene
from integrators.scenes.particles.parts import Parts, degrees
from integrators.scenes.scene import Scene
from trees.table import tree_table

if TYPE_CHECKING:
    import sympy

Rows: TypeAlias = list[list[MpNumber]]

DIGITS = 100
STEP = "1e-33"
NOISE = 1e-50
"""Relative size of a zero defect: difference quotients leave about 1e-66, and small masses or distances leave more."""
FURTHER = 3  # orders beyond that of the method that are tested by default


class HamiltonianVerdict(NamedTuple):
    """Order to which a modified equation is Hamiltonian on a scene, with the verdict for a class of Hamiltonians.

    Attributes:
        method: The name of the method, or of the series.
        scene: The name of the scene.
        general: The verdict for a class of Hamiltonians, with the first violating tree; None if the structure of the
            scene is not canonical, where trees do not decide.
        kind: The class in words.
        names: The names of the colours of the violating tree; empty for one colour.
        order: The largest n such that the terms with h^0, …, h^(n−1) are Hamiltonian on the scene.
        tested_to: The largest order tested.

    Example:
        >>> import bseries as bs
        >>> method, pendulum = bs.method("simplified-takahashi-imada"), bs.scene("pendulum")
        >>> verdict = bs.hamiltonians.hamiltonian_verdict(method, pendulum, 6)
        >>> print(verdict)
        simplified-takahashi-imada is Hamiltonian for all H = T(p) + U(q) with quadratic T to order 4, where
        p[q[p[q[p]]]] breaks it, and on pendulum to order 6, as far as tested
        >>> verdict.holds, verdict.general.holds
        (True, False)
    """

    method: str
    scene: str
    general: Verdict | None
    kind: str
    names: tuple[str, ...]
    order: int
    tested_to: int

    @property
    def holds(self) -> bool:
        """Whether the modified equation is Hamiltonian on the scene to the order tested."""
        return self.order == self.tested_to

    def __str__(self) -> str:
        end = "as far as tested" if self.holds else f"where the term with h^{self.order} breaks it"
        here = f"on {self.scene} to order {self.order}, {end}"
        if self.general is None:
            return f"{self.method} is Hamiltonian {here}"
        end = "as far as tested" if self.broken_tree is None else f"where {self.broken_tree} breaks it"
        return f"{self.method} is Hamiltonian for {self.kind} to order {self.general.order}, {end}, and {here}"

    @property
    def exists_through(self) -> int | None:
        """The last power of h to which a modified Hamiltonian exists on the scene; None without a known limit."""
        return None if self.holds else self.order - 1

    def limit(self, *, latex: bool = False) -> str:
        """A sentence on the power of h to which a modified Hamiltonian exists; empty without a known limit."""
        if self.exists_through is None:
            return ""
        H, last, violated, scene = "H~", f"h^{self.exists_through}", f"h^{self.order}", self.scene
        general = f"; the first tree to break it for {self.kind} is {self.broken_tree}" if self.broken_tree else ""
        if latex:
            H, last, violated = r"$\widetilde{H}$", f"$h^{{{self.exists_through}}}$", f"$h^{{{self.order}}}$"
            scene, general = "this scene", general.replace("_", r"\_").replace("τ", r"$\tau$")
        return f"{H} exists through {last} only: on {scene} the term with {violated} has no Hamiltonian{general}."

    @property
    def broken_tree(self) -> str | None:
        """The first violating tree for the class of Hamiltonians, as text; None if there is none."""
        if self.general is None or self.general.breaks is None:
            return None
        return self.general.breaks.text(self.names or None)

    def to_dict(self) -> dict[str, Any]:
        """The verdict as plain data."""
        general = self.general and {"hamiltonians": self.kind, "order": self.general.order, "breaks": self.broken_tree}
        return {"tested_to": self.tested_to, "general": general, "order": self.order, "holds": self.holds}

    def to_table(self, effects: Sequence[str] = ()) -> Table:
        """The verdict as a table, which is text, Markdown, CSV, LaTeX, HTML or JSON.

        Args:
            effects: The effects of the scene that are on.
        """
        here, general = with_effects(self.scene, effects), self.general
        rows = [] if general is None else [(self.kind, general.order, self.broken_tree)]
        rows.append((here, self.order, "" if self.holds else f"h^{self.order}"))
        notes = ["Order n: the terms with h^0 to h^(n-1) have a Hamiltonian."]
        if self.holds and general is not None and not general.holds:
            notes.append("It has one on this scene, although not for all Hamiltonians; see `bseries drift`.")
        heads = {"schema": 1, "kind": "hamiltonian-verdict", "method": self.method, "scene": self.scene}
        return Table(
            f"Modified equation of {self.method} on {here}: Hamiltonian to order {self.order}, "
            f"tested to {self.tested_to}",
            (Column("Hamiltonian for"), Column("order", True), Column("broken by")),
            rows,
            notes,
            data=lambda: {**heads, "effects": list(effects), **self.to_dict()},
        )

    _repr_html_, to_pandas = as_html, as_frame

    def __repr__(self) -> str:
        return f"<HamiltonianVerdict of {self.method} on {self.scene}: order {self.order} of {self.tested_to}>"


def hamiltonian_verdict(
    method: Method | BSeries | str, scene: Scene | str, order: int | None = None, *, parts: Parts | None = None
) -> HamiltonianVerdict:
    """The order to which the modified equation of a method is Hamiltonian, for all H and on one scene.

    It may be Hamiltonian on a scene although the method is not symplectic: with one degree of freedom every
    divergence-free field is locally Hamiltonian. Then H̃ need not have the periods of H: for the simplified
    Takahashi–Imada method on a pendulum, the term with h^4 is a function on the cylinder only if ∫ U'''U'² dq = 0 over
    a period.

    Args:
        method: A method, or a field series.
        scene: A canonical scene, or a Poisson system. (Preservation of the Casimir functions of a singular structure is
            not tested.)
        order: The largest number of nodes; by default the order of a series, or three more than the order of a method.
        parts: As for `modified_field`.

    Raises:
        SeriesError: The scene has no structure matrix, or an argument is out of range.

    Example:
        >>> import bseries as bs
        >>> print(bs.hamiltonians.hamiltonian_verdict(bs.method("rk4"), bs.scene("pendulum"), 6))
        rk4 is Hamiltonian for all H to order 4, where [τ,[[τ]]] breaks it, and on pendulum to order 5, where the term
        with h^5 breaks it

    References:
        HLW, theorems IX.3.1 and IX.9.8; E. Hairer, lecture on long-time behaviour, sections 3 and 4.
    """
    method = as_method(method)
    scene = as_scene(scene)
    if not isinstance(method, BSeries):
        method = trusted(check_method(method))
        order = order_of(method) + FURTHER if order is None else order
    field = modified_field(method, scene, order, parts=parts)
    general, kind = _general(method, field) if scene.poisson is None else (None, "")
    proved = general is not None and general.holds and scene.is_hamiltonian
    here = field.order if proved else hamiltonian_order(field)
    names = tuple(method.names) if len(method.names) > 1 else ()
    return HamiltonianVerdict(name_of(method), scene.name, general, kind, names, here, field.order)


def is_proved_symplectic(method: Method, field: SceneSeries) -> bool:
    """Whether a method is symplectic on a scene at all orders, by HLW, theorems VI.4.3 and VI.4.6, or as flows."""
    pieces, scene = field.trees.pieces, field.scene
    in_blocks = pieces[0].blocks is not None
    if not scene.is_hamiltonian or (in_blocks and scene.poisson is not None):
        return False
    if isinstance(method, RungeKutta):
        return method.is_symplectic and scene.poisson is None
    if isinstance(method, PartitionedRungeKutta):
        return method.is_symplectic and in_blocks
    separable = not in_blocks or all(row[k] == 0 for k, row in enumerate(degrees(scene, pieces)))
    return separable and is_chain(method)


def name_of(method: Method | BSeries) -> str:
    """The name of a method, or the label of a series."""
    return (method.label or "a series") if isinstance(method, BSeries) else method.name


def _general(method: Method | BSeries, field: SceneSeries) -> tuple[Verdict, str]:
    """The verdict by trees, and the class of Hamiltonians in words."""
    pieces = field.trees.pieces
    in_blocks = len(pieces) > 1 and pieces[0].blocks is not None
    if isinstance(method, BSeries):
        return hamiltonian_field(field.series, colors_are="blocks" if in_blocks else "parts"), "all H"
    if len(method.names) == 1:
        return hamiltonian_field(modified_equation(trusted(method), field.order)), "all H"
    if not in_blocks:
        whole = modified_equation(trusted(method), field.order)
        return hamiltonian_field(whole, colors_are="parts"), f"all H = {' + '.join(method.names)}"
    limits, kind = None, "all H"
    bounds = degrees(field.scene, pieces)
    if bounds[0][0] == bounds[1][1] == 0:
        own = method.max_children
        limits, kind = common_bounds(SEPARABLE, own), "all H = T(p) + U(q)" + (" with quadratic T" if own else "")
    whole = modified_equation(trusted(method), tree_table(field.order, 2, limits))
    return hamiltonian_field(whole, colors_are="blocks"), kind


def hamiltonian_order(f: SceneSeries) -> int:
    """The largest n for which the terms of a field with h^0, …, h^(n−1) are Hamiltonian on its scene."""
    structure = structure_matrix(f.scene)
    numbers = [*f.scene.parameter_values.values(), *f.weights]
    if not any(getattr(x, "free_symbols", ()) for x in numbers):
        with mpmath.workdps(DIGITS):  # the first term with a defect at a random point
            found = _defects(f, structure)
            bounds = [NOISE * size for _, size in found]
            uncertainty = decidable(f.series, None).uncertainty
            for change in () if uncertainty is None else uncertainty.changes.T.tolist():
                s = BSeries(f.series.table, make_values(f.series.table, map(Fraction, change)), f.series.empty)
                moved = _defects(SceneSeries(f.scene, f.trees, s), structure)
                bounds = [bound + abs(x) for bound, (x, _) in zip(bounds, moved, strict=True)]
            exceeded = (abs(x) > bound for (x, _), bound in zip(found, bounds, strict=True))
            return next((k for k, exceeds in enumerate(exceeded) if exceeds), f.order)
    inverse = inverse_structure(f)
    holds = (is_gradient(f.formulas.ring, covector(f, inverse, k)) for k in range(f.order))
    return next((k for k, holds_here in enumerate(holds) if not holds_here), f.order)


def _defects(f: SceneSeries, structure: Sequence[Sequence[sympy.Expr | int]]) -> list[tuple[MpNumber, MpNumber]]:
    """The defects u · Df[B v] − v · Df[B u] − u · DB[f] v at a random point, with the sizes of their terms."""
    terms, entries = f.at_digits(DIGITS).terms, as_function(f.scene.symbols, structure, "mpmath")
    random, step = Random(1), mpmath.mpf(STEP)
    centre = [1.0] * f.dimension if f.scene.start is None else f.scene.y0.tolist()
    y = [mpmath.mpf(x) + (1 + abs(x)) * random.uniform(-1, 1) / 8 for x in centre]
    u, v = ([mpmath.mpf(random.uniform(-1, 1)) for _ in y] for _ in range(2))

    def derivative(function: Callable[[list[MpNumber]], Rows], direction: Sequence[MpNumber]) -> Rows:
        ahead, behind = ([a + s * d for a, d in zip(y, direction, strict=True)] for s in (step, -step))
        return [
            [(a - b) / (2 * step) for a, b in zip(*rows, strict=True)]
            for rows in zip(function(ahead), function(behind), strict=True)
        ]

    bv, bu = ([mpmath.fdot(row, x) for row in entries(*y)] for x in (v, u))
    found = []
    for value, first, second in zip(terms(y), derivative(terms, bv), derivative(terms, bu), strict=True):
        varied = [mpmath.fdot(row, v) for row in derivative(lambda y: entries(*y), value)]
        parts = mpmath.fdot(u, first), -mpmath.fdot(v, second), -mpmath.fdot(u, varied)
        found.append((mpmath.fsum(parts), mpmath.fsum(parts, absolute=True)))
    return found
