"""Blocks of variables: the partition of a state and the names of its entries."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from bseries_base.errors import shorten, shown
from integrators.core.arguments import as_lists, canonical_names, identifier, is_listed
from integrators.core.errors import IntegratorError
from integrators.exact.expressions import check_names

AXES = "xyz"
MAX_VARIABLES = 1_000_000
ROLES = ("i", "j", "k", "l")
"""The site indices of a term: ``q_i``, ``q_j``, …"""
TIME = "t"


class Block(NamedTuple):
    """A contiguous block of variables."""

    name: str
    variables: tuple[str, ...]  # the names of its entries, in the order of the state
    offset: int  # the index of its first entry in the state
    sites: int  # the number of sites (particles, masses, …); 0 for individually named variables
    components: tuple[str, ...]  # the components at each site: ``("q",)``, or ``("qx", "qy")`` in two dimensions

    @property
    def dimension(self) -> int:
        """The number of variables."""
        return len(self.variables)

    @property
    def end(self) -> int:
        """The offset of the next block."""
        return self.offset + len(self.variables)

    def places(self, component: str) -> slice:
        """The indices of a component of all sites in the state."""
        return slice(self.offset + self.components.index(component), self.end, len(self.components))

    @property
    def size(self) -> int | list[int] | list[str]:
        """The value that describes the block in `read_blocks`: n, [n, d] or names."""
        if not self.sites:
            return list(self.variables)
        return self.sites if self.components == (self.name,) else [self.sites, len(self.components)]


def read_blocks(variables: object, argument: str = "variables", offset: int = 0) -> tuple[Block, ...]:
    """The blocks of a mapping from names to sizes, in this order, the first one at `offset` in the state.

    A size is a number n of sites (named ``p`` if n = 1, else ``p1`` … ``pn``), ``[n, d]`` (n sites in d dimensions,
    ``px1, py1, px2, …``), or a list of names. A list of names equal to the names of a size is read as that size.

    Example:
        >>> [block.variables for block in read_blocks({"p": [2, 2], "q": 1, "z": ["u", "v"]})]
        [('px1', 'py1', 'px2', 'py2'), ('q',), ('u', 'v')]
        >>> read_blocks({"q": ["q1", "q2"]}) == read_blocks({"q": 2})
        True
    """
    if not isinstance(variables, Mapping):
        raise IntegratorError(f"{argument} must map names of blocks to sizes, but was {shown(variables)}")
    blocks = []
    for name in check_symbols(variables, argument):
        block = _read_block(name, variables[name], offset, f"{argument}.{shorten(name)}")
        blocks.append(block)
        offset = block.end
    return tuple(blocks)


def check_symbols(names: Iterable[str], argument: str) -> tuple[str, ...]:
    """Check that names are valid in formulas, where pi is a number, and a name that is equal to t as identifier not."""
    checked = check_names(names, argument)
    for name in checked:
        if identifier(name) in ("pi", TIME) and name != TIME:
            what = "a number" if identifier(name) == "pi" else "the time"
            raise IntegratorError(f"{argument} must not be called {identifier(name)}, which is {what}, but one was")
    return checked


def _read_block(name: str, size: object, offset: int, argument: str) -> Block:
    size = as_lists(size)
    if type(size) is int:
        _check_size(size, size, argument)
        return Block(name, _variables(name, size, 0), offset, size, (name,))
    if is_listed(size) and size:
        if all(isinstance(entry, str) for entry in size):
            return _named_block(name, check_symbols(size, argument), offset, argument)
        if len(size) == 2 and all(type(entry) is int for entry in size) and 1 <= size[1] <= len(AXES):
            _check_size(size[0], size[0] * size[1], argument)
            return Block(name, _variables(name, *size), offset, size[0], _components(name, size[1]))
    raise IntegratorError(
        f"{argument} must be a number, a pair [sites, dimensions up to {len(AXES)}] or a list of names, "
        f"but was {shown(size)}"
    )


def _named_block(name: str, names: tuple[str, ...], offset: int, argument: str) -> Block:
    """A block from a list of names; names of n sites give the block of n sites."""
    if len(set(names)) < len(names):
        raise IntegratorError(f"{argument} must have different names, but was {shown(list(names))}")
    for dimension in range(len(AXES) + 1):
        sites = len(names) // max(dimension, 1)
        if sites and names == _variables(name, sites, dimension):
            return Block(name, names, offset, sites, _components(name, dimension))
    return Block(name, names, offset, 0, ())


def _components(name: str, dimension: int) -> tuple[str, ...]:
    """The components at a site; dimension 0 denotes a single number without an axis."""
    return tuple(name + axis for axis in AXES[:dimension]) or (name,)


def _variables(name: str, sites: int, dimension: int) -> tuple[str, ...]:
    if dimension == 0 and sites == 1:
        return (name,)
    components = _components(name, dimension)
    return tuple(f"{component}{k}" for k in range(1, sites + 1) for component in components)


def _check_size(sites: int, variables: int, argument: str) -> None:
    if sites < 1 or variables > MAX_VARIABLES:
        raise IntegratorError(
            f"{argument} must have at least one site and at most {MAX_VARIABLES} variables, "
            f"but had {shorten(str(sites))} and {shorten(str(variables))}"
        )


def component_places(component: str, blocks: Iterable[Block]) -> slice | None:
    """The indices of a component of all sites in the state; None if no block has it."""
    return next((block.places(component) for block in blocks if component in block.components), None)


def canonical_blocks(blocks: Sequence[Block]) -> tuple[Block, Block] | None:
    """Momenta and positions of equal size, in any order: the blocks p and q, or the only pair of other such names."""
    by_name = {block.name: block for block in blocks}
    names = canonical_names(by_name)
    if names is None:
        return None
    momenta, positions = (by_name[name] for name in names)
    return (momenta, positions) if momenta.dimension == positions.dimension else None


def poisson_matrix(pair: Sequence[Block]) -> list[list[int]]:
    """The canonical Poisson matrix of the variables, with {q, p} = 1."""
    momenta, positions = pair
    size = momenta.dimension
    matrix = [[0] * (2 * size) for _ in range(2 * size)]
    for k in range(size):
        p, q = momenta.offset + k, positions.offset + k
        matrix[q][p], matrix[p][q] = 1, -1
    return matrix
