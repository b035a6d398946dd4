"""Compilation of a step, from a method and a scene to machine code. Read this file first."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from integrators.compile.lowering import SOURCES
from integrators.compile.modules import load_module
from integrators.scenes.particles.degrees import Piece
from integrators.scenes.particles.parts import check_kind, pieces_of
from integrators.steppers.nodes import Nodes
from integrators.steppers.plan import plan
from integrators.steppers.source import KERNELS, StepSource, step_source
from integrators.steppers.structure import Structure

if TYPE_CHECKING:
    from integrators.methods.program.program import Method
    from integrators.scenes.scene import Scene
    from integrators.steppers.step_model import Options


def compile_step(method: Method, scene: Scene, parts: Mapping[str, Any] | None, options: Options) -> CompiledStep:
    """Compile one step of a method on a scene.

    ::

        method, scene
            │   analysis        structure.py       blocks of variables, and what each piece of the field does to them
            │                   nodes.py           evaluations by block, without duplicates, rational coefficients
            ▼
          Nodes
            │   plan            plan.py            order of evaluations, implicit groups, reuse in the next step
            ▼
          Plan
            │   source          source.py          the loop over steps, registers, memory
            │                   writer.py          arrays and functions; calls of the field and its derivatives
            │                   averages.py, flows.py, implicit_stages.py    the other kinds of evaluations
            ▼
        StepSource
            │   machine code    compile.modules    module from source
            │                   compile.lowering   LLVM code of the module; LLVM's code is cached on disk
            ▼
        int64_t advance(double *state, ...)

    Args:
        method: The method.
        scene: The scene.
        parts: The pieces of the field for the parts of the method, as for `stepper`.
        options: The options of the source.
    """
    structure = Structure(scene, method_pieces(method, scene, parts))
    nodes = Nodes(method, structure)
    step = plan(nodes, stagger=options.control is None)
    source = step_source(nodes, step, options)
    return CompiledStep(source)


class CompiledStep:
    """A step as source and, from its first use, as machine code."""

    def __init__(self, source: StepSource):
        self.source = source

    @cached_property
    def address(self) -> int:
        """The address of the machine code (see `integrators.compile.machine.steps_in_c`)."""
        helpers = [str(find_spec(module).origin) for module in (*KERNELS, "integrators.steppers.adaptive")]  # pyright: ignore[reportOptionalMemberAccess]
        return load_module(self.source.text, helpers=[*helpers, *SOURCES]).in_c.address


def method_pieces(method: Method, scene: Scene, parts: Any) -> list[Piece]:
    """The pieces of the field for the parts of a method; an auxiliary matrix is the Jacobian of the whole field."""
    auxiliary = method.program.auxiliary
    names = [name for name in method.names if name not in auxiliary]
    own = dict(zip(names, pieces_of(names, scene, parts), strict=True))
    pieces = [own.get(name, Piece()) for name in method.names]
    if not auxiliary:  # an auxiliary matrix has no B-series
        check_kind(method.name, method.program.max_children, pieces, scene)
    return pieces if len(pieces) == 1 else [*pieces, Piece()]
