"""Steps of any method by definition, evaluation by evaluation, in doubles or any precision.

Slow; the oracle that compiled steppers are compared with.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from integrators.core.errors import IntegratorError, shown
from integrators.methods.program.evaluations import LinearForm
from integrators.methods.program.program import Average, Derivative, Evaluation, Field, Flow, Method, Program, operands
from integrators.reference.plain_arithmetic import Arithmetic, size
from integrators.reference.plain_fields import Fields
from integrators.reference.plain_fields import block_parts as block_parts
from integrators.reference.plain_flows import average, fixed_point, flow_increment, newton

if TYPE_CHECKING:
    from integrators.reference.plain_arithmetic import Vector
    from integrators.reference.plain_fields import ByPart


def plain_step(
    method: Method,
    field: ByPart,
    y: Sequence[Any],
    h: Any,
    *,
    derivative: ByPart | None = None,
    flows: ByPart | None = None,
    digits: int | None = None,
) -> Vector:
    """One step of a method, computed from its definition.

    Implicit stages are found by fixed-point iteration, or else by Newton's method, until the increments stagnate; flows
    and averages of the field are computed numerically until they no longer change.

    Args:
        method: A method of any kind, without symbols.
        field: The field, a function of y that returns a sequence of numbers; for a method with several parts a function
            for each part, as a mapping or in their order. Parts that are blocks of variables are zero elsewhere:
            `block_parts` makes them. A kind of method for special fields (`max_children`) needs such a field.
        y: The start of the step.
        h: The step size, of any sign.
        derivative: f′(y)v as a function of y and v, like `field`; parts may be left out. A missing one is computed by
            complex steps for doubles, so that f must be analytic and accept complex numbers, and by differences with
            twice the digits for mpmath.
        flows: The exact flow of a part as a function of y and the time, like `field`; parts may be left out.
        digits: None for doubles; else the number of digits, and `field` must compute with mpmath.

    Returns:
        The end of the step: an array of doubles, or of mpmath numbers.

    Raises:
        IntegratorError: An argument is invalid, the stages cannot be found, or a result is not finite.

    Example:
        >>> from integrators import method
        >>> print(plain_step(method("rk4"), lambda y: [-y[1], y[0]], [1, 0], 0.1))
        [0.99500417 0.09983333]
        >>> verlet, field = method("stormer-verlet"), lambda y: [-y[1], y[0]]
        >>> print(plain_step(verlet, block_parts(field, {"p": [0], "q": [1]}), [1, 0], "1/10", digits=30))
        [mpf('0.995') mpf('0.1')]
    """
    stepper = Stepper(method, field, y, h, derivative, flows, digits)
    with stepper.arithmetic.working():
        return stepper.step(stepper.start)


def plain_steps(
    method: Method,
    field: ByPart,
    y: Sequence[Any],
    h: Any,
    steps: int,
    *,
    derivative: ByPart | None = None,
    flows: ByPart | None = None,
    digits: int | None = None,
) -> Vector:
    """Several steps of a method, each computed as by `plain_step`.

    Args:
        method: A method of any kind, without symbols.
        field: The field, or its parts.
        y: The start.
        h: The step size.
        steps: The number of steps.
        derivative: The derivative of the field, or of its parts.
        flows: The exact flows of parts.
        digits: None for doubles; else the number of digits.

    Returns:
        An array with one row for each component of y, and one column for the start and each step.

    Raises:
        IntegratorError: As for `plain_step`; the message names the step.

    Example:
        >>> from integrators import method
        >>> print(plain_steps(method("explicit-euler"), lambda y: -y, [1], 0.5, 3))
        [[1.    0.5   0.25  0.125]]
    """
    if isinstance(steps, bool) or not isinstance(steps, int) or steps < 0:
        raise IntegratorError(f"steps must be 0, 1, 2, …, but was {shown(steps)}")
    import numpy as np

    stepper = Stepper(method, field, y, h, derivative, flows, digits)
    columns = [stepper.start]
    with stepper.arithmetic.working():
        for n in range(1, steps + 1):
            try:
                columns.append(stepper.step(columns[-1]))
            except IntegratorError as error:
                raise IntegratorError(f"{error}, in step {n}") from None
    return np.array(columns).T


class Stepper:
    """A method, a field, and a step size."""

    def __init__(
        self,
        method: Method,
        field: ByPart,
        y: Any,
        h: Any,
        derivative: ByPart | None,
        flows: ByPart | None,
        digits: int | None,
    ) -> None:
        self.arithmetic = arithmetic = Arithmetic(digits)
        if not isinstance(method, Method):
            raise IntegratorError(f"method must be a method, but was {shown(method)}")
        program = method.rational_program(arithmetic.decimals)
        if program.parameters:
            raise IntegratorError(f"parameters must have values before a step, but {program.parameters[0]} had none")
        self.name = program.name
        self.components = _components(program)
        with arithmetic.working():
            self.start = arithmetic.rounded(arithmetic.read(y, "y"))
            self.h = arithmetic.number(h, "h")
            self.evaluations: list[Evaluation] = [self._in_numbers(evaluation) for evaluation in program.evaluations]
            self.result = self._form_in_numbers(program.result)
        self.fields = Fields(arithmetic, program.names, field, derivative, flows, len(self.start))

    def _form_in_numbers(self, form: LinearForm) -> LinearForm:
        return form.map(lambda x: self.arithmetic.number(x, "coefficient"))

    def _in_numbers(self, evaluation: Evaluation) -> Evaluation:
        """The evaluation with converted coefficients."""
        form = self._form_in_numbers
        match evaluation:
            case Field(part, at):
                return Field(part, form(at))
            case Derivative(part, at, along):
                return Derivative(part, form(at), form(along))
            case Flow(part, at, time, forcing):
                return Flow(part, form(at), self.arithmetic.number(time, "time"), tuple(map(form, forcing)))
            case Average(part, path, power):
                return Average(part, tuple(map(form, path)), power)

    def step(self, y: Vector) -> Vector:
        """y₁ = y₀ + Σ b_e k_e, with the k_e of one strongly connected component at a time."""
        k: dict[int, Vector] = {}
        for members in self.components:
            if len(members) == 1 and members[0] not in _registers(self.evaluations[members[0]]):
                found = [self._evaluate(members[0], y, k)]
            elif self._is_linear(members):
                found = self._solve_linear(members, y, k)
            else:
                found = self._solve(members, y, k)
            k.update(zip(members, found, strict=True))
            for e in members:
                self._check_finite(f"k{e + 1}", k[e])
        end = self._point(self.result, y, k)
        self._check_finite("the end of the step", end)
        return self.arithmetic.rounded(end)

    def _check_finite(self, what: str, vector: Vector) -> None:
        if not self.arithmetic.is_finite(vector):
            shown = ", ".join(map(self.arithmetic.text, vector[:3])) + ", …" * (len(vector) > 3)
            raise IntegratorError(f"{what} of {self.name} must be finite, but was {shown} with h = {self._h}")

    def _point(self, form: LinearForm, y: Vector, k: dict[int, Vector]) -> Vector:
        """start · y + Σ x_e k_e."""
        total = y * form.start
        for e, x in form.terms.items():
            total = total + k[e] * x
        return total

    def _evaluate(self, e: int, y: Vector, k: dict[int, Vector]) -> Vector:
        """k_e by the definitions in `integrators.methods.program.evaluations`."""
        h, fields = self.h, self.fields
        match self.evaluations[e]:
            case Field(part, at):
                return fields.value(part, self._point(at, y, k)) * h
            case Derivative(part, at, along):
                return fields.derivative(part, self._point(at, y, k), self._point(along, y, k)) * h
            case Flow(part, at, time, forcing):
                return self._flow(part, self._point(at, y, k), time, [self._point(form, y, k) for form in forcing])
            case Average(part, path, power):
                points = [self._point(form, y, k) for form in path]
                scale = max(map(size, points))
                return average(
                    lambda θ: fields.value(part, _polynomial(points, θ)) * (h * θ**power), scale, self.arithmetic
                )

    def _flow(self, part: int | None, start: Vector, time: Any, forcing: list[Vector]) -> Vector:
        """z(1) − z(0) for z′ = time · h f^[part](z) + Σ_j θ^j forcing[j]."""
        end = None if forcing else self.fields.exact_flow(part, start, time * self.h)
        if end is not None:
            return end - start

        def right(θ: Any, z: Vector) -> Vector:
            derivative = self.fields.value(part, z) * (time * self.h)
            return derivative + _polynomial(forcing, θ) if forcing else derivative

        return flow_increment(right, start, self.arithmetic)

    def _is_linear(self, members: Sequence[int]) -> bool:
        """Whether the members are derivatives at known points: their equations are linear."""
        evaluations = [self.evaluations[e] for e in members]
        return all(isinstance(e, Derivative) and not e.at.terms.keys() & set(members) for e in evaluations)

    def _solve_linear(self, members: Sequence[int], y: Vector, k: dict[int, Vector]) -> list[Vector]:
        """Solve k_e = h J_e along_e with J_e = f′(at_e), that is (I − M) k = r with the blocks h x J_e in M."""
        n, arithmetic = len(y), self.arithmetic
        right, matrix = arithmetic.zeros(n * len(members)), _identity(arithmetic, n * len(members))
        for i, e in enumerate(members):
            evaluation: Any = self.evaluations[e]
            part, at, along = evaluation
            point = self._point(at, y, k)
            columns = [self.fields.derivative(part, point, unit) * self.h for unit in _identity(arithmetic, n)]
            known = LinearForm.of_entries(along.start, {m: x for m, x in along.terms.items() if m not in members})
            rows = slice(n * i, n * (i + 1))
            right[rows] = sum(column * x for column, x in zip(columns, self._point(known, y, k), strict=True))
            for j, member in enumerate(members):
                for c, column in enumerate(columns):
                    matrix[rows, n * j + c] -= column * along.terms.get(member, 0)
        found = arithmetic.solve(matrix, right)
        if found is None:
            raise IntegratorError(f"h must leave the system of {self._named(members)} regular, but was {self._h}")
        return list(found.reshape(-1, n))

    def _solve(self, members: Sequence[int], y: Vector, k: dict[int, Vector]) -> list[Vector]:
        """Solve for evaluations that depend on one another."""

        def update(x: Vector) -> Vector:
            import numpy as np

            known = {**k, **dict(zip(members, x.reshape(-1, len(y)), strict=True))}
            return np.concatenate([self._evaluate(e, y, known) for e in members])

        zeros = self.arithmetic.zeros(len(members) * len(y))
        first = update(zeros)
        for e, vector in zip(members, first.reshape(-1, len(y)), strict=True):
            self._check_finite(f"k{e + 1}", vector)
        reason = "neither fixed-point iteration nor Newton's method converged"
        for solver, start in ((fixed_point, first), (newton, zeros)):
            try:
                found = solver(update, start, size(y), self.arithmetic)
            except IntegratorError as error:  # in a flow or an average at some iterate
                found, reason = None, str(error)
            if found is not None:
                return list(found.reshape(-1, len(y)))
        raise IntegratorError(
            f"h must be small enough to solve for {self._named(members)}, but was {self._h}: {reason}"
        )

    @property
    def _h(self) -> str:
        return self.arithmetic.text(self.h)

    def _named(self, members: Sequence[int]) -> str:
        return f"{', '.join(f'k{e + 1}' for e in members[:3])}{', …' * (len(members) > 3)} of {self.name}"


def _polynomial(coefficients: Sequence[Vector], θ: Any) -> Vector:
    """Σ_j θ^j coefficients[j]."""
    total = coefficients[-1]
    for vector in coefficients[-2::-1]:
        total = total * θ + vector
    return total


def _identity(arithmetic: Arithmetic, n: int) -> Vector:
    matrix = arithmetic.zeros(n, n)
    for i in range(n):
        matrix[i, i] += 1
    return matrix


def _registers(evaluation: Evaluation) -> set[int]:
    """The evaluations that an evaluation depends on."""
    return {e for form in operands(evaluation) for e in form.terms}


def _components(program: Program) -> list[list[int]]:
    """The strongly connected components of the evaluations, in the order of their dependence."""
    import networkx as nx

    graph = nx.DiGraph()
    graph.add_nodes_from(range(len(program.evaluations)))
    graph.add_edges_from((other, e) for e, form in enumerate(program.evaluations) for other in _registers(form))
    condensed = nx.condensation(graph)
    return [sorted(condensed.nodes[c]["members"]) for c in nx.topological_sort(condensed)]
