"""Sums over all pairs of few sites: lanes are pairs, and each site adds up its own.

Pairs of sites that are equally far apart, round the ring of all sites, lie beside one another: at each distance there
is one for every site with the site so far on. What is read from the sites, and what is added to them, are then
permutations of whole vectors, and nothing but these goes from one pass to the next.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from .lowering import WIDTH
from .printer import source_lines

if TYPE_CHECKING:
    import sympy

    from .scenes.local_terms import Argument, Place
    from .site_loops import Context, SiteSum

FILL = 4
"""Lanes of one loop are filled up to a multiple of so many; what idle ones give is lost."""


class Ring(NamedTuple):
    """The lanes of all pairs of n sites.

    Attributes:
        rows: The pair of each lane, its smaller site first; idle lanes repeat the last one.
        lanes: For each distance from 1 to n/2 the lane of every site with the site so far on.
    """

    rows: list[tuple[int, ...]]
    lanes: list[list[int]]

    @classmethod
    def of(cls, n: int) -> Ring:
        """The lanes for n sites: those of sites that fill vectors come first, distance by distance.

        Example:
            >>> Ring.of(3)
            Ring(rows=[(0, 1), (1, 2), (0, 2), (0, 2)], lanes=[[0, 1, 2]])
        """
        distances, full = range(1, n // 2 + 1), n // WIDTH * WIDTH
        numbers: dict[tuple[int, int], int] = {}
        for sites in (range(full), range(full, n)):
            for distance in distances:
                for site in sites:
                    numbers.setdefault(_pair(site, distance, n), len(numbers))
        return cls(
            filled([*numbers]), [[numbers[_pair(site, distance, n)] for site in range(n)] for distance in distances]
        )


def filled(rows: list[tuple[int, ...]]) -> list[tuple[int, ...]]:
    """The rows of all lanes, idle ones among them."""
    return rows + rows[-1:] * (-len(rows) % FILL)


def lane_data(
    total: SiteSum, names: Mapping[sympy.Symbol, str], rows: Sequence[tuple[int, ...]], context: Context
) -> dict[sympy.Symbol, str]:
    """How lanes, each for a row of sites, read parameters that differ from site to site."""
    return {
        symbol: f"{context.numbers([data.values[row[data.role]] for row in rows])}[r]"
        for data, symbol in total.data.items()
        if symbol in names
    }


def _pair(site: int, distance: int, n: int) -> tuple[int, int]:
    other = (site + distance) % n
    return min(site, other), max(site, other)


def suits_ring(total: SiteSum, targets: Mapping[Any, str], scatter: Mapping[Any, tuple[int, str]]) -> bool:
    """Whether all is added up over pairs, or to entries of both sites, the same but for the sign."""
    if total.sites.kind != "pairs" or not all(target.endswith("+=") for target in targets.values()):
        return False
    at_sites = {key: target for key, target in targets.items() if not _is_total(target)}
    if not all(getattr(key, "stride", 0) and target.startswith("out[") for key, target in at_sites.items()):
        return False
    entries = _by_place({key: scatter[key] for key in at_sites})
    return all(len(roles) == 2 and roles[0][0] == roles[1][0] for roles in entries.values())


def _is_total(target: str) -> bool:
    """Whether all pairs are added up, for a variable that is no entry of an array."""
    return "[" not in target


def ring_lines(
    total: SiteSum,
    targets: Mapping[Any, str],
    values: Sequence[sympy.Expr],
    scatter: Mapping[Any, tuple[int, str]],
    context: Context,
) -> list[str]:
    """The statements of a sum that suits.

    Args:
        total: The sum.
        targets: For keys of the outputs the left-hand side.
        values: The formulas.
        scatter: For each output its formula's number and its sign.
        context: How numbers are written.
    """
    from .site_loops import indented

    n, ring, names = total.sites.count, Ring.of(total.sites.count), total.names()
    arguments = {x: names[symbol] for x, symbol in total.arguments.items() if symbol in names}
    copies, differences = _gather(arguments, ring, n, context)
    entries = {key: value for key, value in scatter.items() if not _is_total(targets[key])}
    lanes = names | lane_data(total, names, ring.rows, context)
    formula = source_lines([(f"v{k}[r]", value) for k, value in enumerate(values)], lanes)
    return [
        *copies,
        *(f"v{k} = stack({len(ring.rows)})" for k in range(len(values))),
        f"for r in range({len(ring.rows)}):",
        *indented([*differences, *formula]),
        *(f"{targets[key]} {_over_pairs(*scatter[key], n * (n - 1) // 2)}" for key in targets if key not in entries),
        *(line for place, roles in _by_place(entries).items() for line in _sum_lines(place, roles, ring, n, context)),
    ]


def _over_pairs(number: int, sign: str, count: int) -> str:
    """The sum of a formula over all pairs."""
    total = _balanced([f"v{number}[{lane}]" for lane in range(count)])
    return total if sign == "+" else f"-({total})"


def _by_place(scatter: Mapping[Any, tuple[int, str]]) -> dict[tuple[int, int], dict[int, tuple[int, str]]]:
    """For each place in the sites, its offset and stride, what the two sites of a pair are given."""
    found: dict[tuple[int, int], dict[int, tuple[int, str]]] = {}
    for place, value in scatter.items():
        found.setdefault((place.offset, place.stride), {})[place.role] = value
    return found


def _gather(arguments: Mapping[Argument, str], ring: Ring, n: int, context: Context) -> tuple[list[str], list[str]]:
    """Statements that copy entries of all sites to arrays, and those that make local variables of lanes."""
    sites = [context.sites(column) for column in zip(*ring.rows, strict=True)]
    arrays: dict[tuple[int, int], str] = {}

    def text(place: Place) -> str:
        if not place.stride:
            return f"y[{place.offset}]"
        array = arrays.setdefault((place.offset, place.stride), f"q{len(arrays)}")
        return f"{array}[{sites[place.role]}[r]]"

    differences = [
        f"{name} = {' - '.join(text(x) for x in argument if x is not None)}" for argument, name in arguments.items()
    ]
    copies = [f"{array} = stack({n})" for array in arrays.values()]
    for (offset, stride), array in arrays.items():
        copies += [f"for i in range({n}):", f"    {array}[i] = y[{offset} + {stride}*i]"]
    return copies, differences


def _sum_lines(
    place: tuple[int, int], roles: Mapping[int, tuple[int, str]], ring: Ring, n: int, context: Context
) -> list[str]:
    """Statements that add to every site what its pairs give it."""
    (number, first), (_, second) = roles[0], roles[1]
    terms = [
        _term(f"v{number}[{context.sites(lanes)}[i]]", [first if is_first else second for is_first in firsts], context)
        for lanes, firsts in _pairs_of_sites(ring, n)
    ]
    offset, stride = place
    return [f"for i in range({n}):", f"    out[{offset} + {stride}*i] += {_balanced(terms)}"]


def _pairs_of_sites(ring: Ring, n: int) -> Iterable[tuple[list[int], list[bool]]]:
    """For all sites a lane each, and whether the site is the first of that pair; over again until they had all."""
    for distance, lanes in enumerate(ring.lanes, 1):
        yield lanes, [site + distance < n for site in range(n)]
        if 2 * distance < n:  # otherwise the site so far back is the one so far on
            yield [lanes[site - distance] for site in range(n)], [site < distance for site in range(n)]


def _term(value: str, signs: Sequence[str], context: Context) -> str:
    import sympy

    if len(set(signs)) == 1:
        return value if signs[0] == "+" else f"-{value}"
    return f"{context.numbers([sympy.Integer(f'{sign}1') for sign in signs])}[i]*{value}"


def _balanced(terms: Sequence[str]) -> str:
    """A sum in which no term waits for more than the logarithm of their number of others."""
    if len(terms) < 3:
        return " + ".join(terms)
    half = len(terms) // 2
    return " + ".join(f"({_balanced(part)})" if len(part) > 1 else part[0] for part in (terms[:half], terms[half:]))
