"""A canonical scene with variables for its energies, which are elementary differentials then."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

from bseries.fields.scene_trees import flat_fields
from integrators.scenes.model.blocks import Block
from integrators.scenes.model.local_terms import VALUE, Output, Place
from integrators.scenes.model.system import System
from integrators.scenes.particles.degrees import Piece
from integrators.scenes.particles.local_form import constant_terms

if TYPE_CHECKING:
    import sympy

    from integrators import Scene
    from integrators.scenes.model.local_terms import LocalTerm


class EnergyScene(System):
    """A canonical scene with a variable for each energy that the pieces of its field come from.

    Where each term of H belongs to one piece, as in a splitting, or in H = T(p) + U(q) with the blocks p and q as
    pieces, there is an energy for each piece; otherwise there is one, H.

    Args:
        scene: The scene.
        pieces: The pieces of its field that colours of trees stand for.

    Attributes:
        scene: The scene.
        field_pieces: The pieces of its field.
        separated: Whether each term of H belongs to one piece.
        twins: For each energy, the colour of the piece that comes from it (of one of them, if there are several).
        pieces: The pieces of the field, and after them those of the energies.

    Example:
        >>> import bseries as bs
        >>> pendulum = bs.scene("pendulum")
        >>> separable = EnergyScene(pendulum, [Piece(frozenset("p")), Piece(frozenset("q"))])
        >>> separable.variables, separable.twins, separable.energies
        (('p', 'q', 'energy1', 'energy2'), (0, 1), (-cos(q), p**2/2))
        >>> EnergyScene(pendulum, [Piece()]).energies
        (p**2/2 - cos(q),)
    """

    scene: Scene
    field_pieces: tuple[Piece, ...]
    separated: bool
    twins: tuple[int, ...]
    pieces: tuple[Piece, ...]
    _places: list[Place]

    def __init__(self, scene: Scene, pieces: Sequence[Piece]):
        owners = [[k for k, piece in enumerate(pieces) if piece.outputs(term, scene)] for term in scene.local_terms]
        separated = all(len(found) == 1 for found in owners)
        owner = [found[0] for found in owners] if separated else [0] * len(owners)
        twins = tuple(sorted(set(owner)))
        name = "energy"
        taken = {*scene.variables, *scene.parameter_values, *(block.name for block in scene.blocks)}
        while any(used.startswith(name) for used in taken):
            name += "_"
        start = scene.dimension
        added = [Block(f"{name}{k}", (f"{name}{k}",), start + k - 1, 0, ()) for k in range(1, len(twins) + 1)]
        self.__dict__.update(
            name=scene.name,
            parameters=scene.parameters,
            scene=scene,
            blocks=(*scene.blocks, *added),
            field_pieces=tuple(pieces),
            separated=separated,
            twins=twins,
            pieces=(*pieces, *(Piece(frozenset([block.name])) for block in added)),
            _places=[Place(0, start + twins.index(color), 0) for color in owner],
        )

    @property
    def _data(self) -> tuple[Any, ...]:
        return self.scene, self.field_pieces

    def __reduce__(self) -> tuple[Any, ...]:
        return EnergyScene, self._data

    @cached_property
    def local_terms(self) -> tuple[LocalTerm, ...]:
        """The terms of the scene, which also add their values to energies; constants are left out."""
        return tuple(
            term._replace(outputs=(*term.outputs, Output(VALUE, place, 1)))
            for term, place in zip(self.scene.local_terms, self._places, strict=True)
        )

    @cached_property
    def constant(self) -> sympy.Expr:
        """The constant of H, which is in none of the energies."""
        import sympy

        return sympy.Add(*(_written_out(term, self.scene) for term in constant_terms(self.scene)))

    @cached_property
    def energies(self) -> tuple[sympy.Expr, ...]:
        """The energies written out flat."""
        import sympy

        terms = [
            (place.offset, _written_out(term, self.scene))
            for term, place in zip(self.scene.local_terms, self._places, strict=True)
        ]
        places = range(self.scene.dimension, self.dimension)
        return tuple(sympy.Add(*(formula for at, formula in terms if at == place)) for place in places)

    @cached_property
    def field(self) -> tuple[sympy.Expr, ...]:
        """The field of the scene, and e' = H."""
        return *self.scene.field, *self.energies

    @cached_property
    def fields(self) -> list[tuple[sympy.Expr, ...]]:
        """The field of each piece, one formula for each variable; an energy's is the energy, in its own place."""
        import sympy

        zero, size = sympy.Integer(0), len(self.energies)
        fields = [(*field, *[zero] * size) for field in flat_fields(self.scene, self.field_pieces)]
        for k, energy in enumerate(self.energies):
            fields.append((*[zero] * (self.scene.dimension + k), energy, *[zero] * (size - k - 1)))
        return fields


def _written_out(term: LocalTerm, scene: Scene) -> sympy.Expr:
    """The sum of a term's formula over its sites, in the variables of the scene."""
    import sympy

    symbols, formulas = scene.symbols, []
    for row in term.sites.rows():
        here: dict[Any, Any] = {sympy.Symbol(f"d{k}"): data.values[row[data.role]] for k, data in enumerate(term.data)}
        for k, (plus, minus) in enumerate(term.arguments):
            value = symbols[plus.at(row)]
            here[sympy.Symbol(f"x{k}")] = value if minus is None else value - symbols[minus.at(row)]
        formulas.append(term.formula.xreplace(here))
    return sympy.Add(*formulas)
