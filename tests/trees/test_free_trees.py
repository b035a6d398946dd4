"""Free trees: published counts, classes by brute force, and Hamiltonians of random polynomials as the second method."""

from itertools import permutations
from math import factorial

import field_oracles as oracle
import networkx as nx
import pytest

from trees import Tree, TreeError, TreeTable, count_trees, free_tree_classes
from trees.free_trees import grafting, rootings

SEPARABLE = [[0, None], [None, 0]]
KINDS = {
    "one": {},
    "parts": {"colors": 2},
    "blocks": {"colors": 2, "blocks": True},
    "separable": {"colors": 2, "blocks": True, "max_children": SEPARABLE},
}


def sizes(classes, order):
    return [sum(free.representative.order == n for free in classes) for n in range(1, order + 1)]


def test_published_counts():
    classes = free_tree_classes(10)
    assert sizes(classes, 10) == [1, 1, 1, 2, 3, 6, 11, 23, 47, 106]  # OEIS A000055
    assert sizes([free for free in classes if not free.is_superfluous], 10) == [1, 0, 1, 1, 3, 4, 11, 19, 47, 97]
    assert sizes(free_tree_classes(7, colors=2, blocks=True), 7) == [1, 1, 3, 8, 27, 91, 350]  # OEIS A000238


@pytest.mark.parametrize(("colors", "order"), [(1, 10), (2, 6), (3, 5)])
def test_superfluous_trees_are_those_of_two_equal_halves(colors, order):
    """Otter: free trees are rooted ones less unordered pairs {u, v} with u ≠ v; pairs {u, u} are superfluous."""
    rooted = [0, *count_trees(order, colors)]
    halves = [rooted[n // 2] if n % 2 == 0 else 0 for n in range(1, order + 1)]
    pairs = [sum(rooted[i] * rooted[n - i] for i in range(1, n)) for n in range(1, order + 1)]
    classes = free_tree_classes(order, colors)
    assert sizes([free for free in classes if free.is_superfluous], order) == halves
    assert sizes(classes, order) == [t - (p - half) // 2 for t, p, half in zip(rooted[1:], pairs, halves, strict=True)]


@pytest.mark.parametrize("n", range(1, 9))
def test_classes_are_the_free_trees_of_networkx(n):
    """Each free tree drawn once, with every node as the root in turn."""
    expected = {}
    for graph in nx.nonisomorphic_trees(n) if n > 1 else [nx.empty_graph(1)]:
        found = [Tree.from_networkx(graph, root) for root in graph]
        expected[frozenset(found)] = {tree: found.count(tree) for tree in found}
    classes = [free for free in free_tree_classes(n) if free.representative.order == n]
    assert {
        frozenset(t for t, _, _ in free.rootings): {t: m for t, _, m in free.rootings} for free in classes
    } == expected


@pytest.mark.parametrize("kind", KINDS)
def test_symmetry_and_multiplicities(kind):
    """σ_free = |τ| / Σ 1/σ(θ), in integers: the rootings of a free tree have its nodes as roots, each once."""
    for free in free_tree_classes(6, **KINDS[kind]):
        assert sum(many for _, _, many in free.rootings) == free.representative.order
        assert all(many * tree.symmetry == free.symmetry for tree, _, many in free.rootings)
        assert free.representative in [tree for tree, _, _ in free.rootings]
        signs = {sign for _, sign, _ in free.rootings}
        assert (signs == {0}) == free.is_superfluous
        assert free.is_superfluous or (free.representative, 1) in [rooting[:2] for rooting in free.rootings]
    assert any(free.symmetry == factorial(5) for free in free_tree_classes(6, **KINDS[kind]))


def test_automorphisms_counted_one_by_one():
    for free in free_tree_classes(6):
        graph = free.representative.to_networkx().to_undirected()
        nodes, edges = list(graph), {frozenset(edge) for edge in graph.edges}
        count = 0
        for images in permutations(nodes):
            image = dict(zip(nodes, images, strict=True))
            count += {frozenset(map(image.get, edge)) for edge in edges} == edges
        assert count == free.symmetry


def elementary_hamiltonian(tree, energies, fields, y, known):
    vectors = [oracle.differential(child, fields, y, known) for child in tree.children]
    return oracle.contracted(energies[tree.color], vectors, y).value


@pytest.mark.parametrize("kind", KINDS)
def test_hamiltonians_of_a_class_agree_up_to_the_sign(kind):
    """H([τ₁, …]) = H^(m)(F(τ₁), …), for random polynomials: this is what signs and superfluous trees mean."""
    source = oracle.seeded("free trees", kind)
    y, known, order = oracle.point(source), {}, 6 if kind in ("one", "separable") else 4
    if kind == "separable":
        U, T = (oracle.polynomial(source, 6, 16, block) for block in ((2, 3), (0, 1)))
        energies, fields = [U, T], oracle.split_in_blocks(oracle.rotated(oracle.added(T, U)))
    else:
        energies = [oracle.polynomial(source, 6, 16) for _ in range(2)]
        fields = [oracle.rotated(H) for H in energies]
        if kind == "blocks":
            energies, fields = [energies[0]] * 2, oracle.split_in_blocks(fields[0])
    values = set()
    for free in free_tree_classes(order, **KINDS[kind]):
        representative = elementary_hamiltonian(free.representative, energies, fields, y, known)
        assert (representative == 0) == free.is_superfluous
        for tree, sign, _ in free.rootings:
            assert elementary_hamiltonian(tree, energies, fields, y, known) == sign * representative % oracle.P
        values |= {representative, -representative % oracle.P} - {0}
    proper = sum(not free.is_superfluous for free in free_tree_classes(order, **KINDS[kind]))
    assert len(values) == 2 * proper  # different classes do not agree by accident


@pytest.mark.parametrize("kind", KINDS)
def test_rootings_by_compiled_and_plain_kernels(kind, monkeypatch):
    import numba  # noqa: F401

    options = KINDS[kind].copy()
    blocks = options.pop("blocks", False)
    found = []
    for compiled in (True, False):
        monkeypatch.setattr("trees.basis.machine_code_pays", lambda _work, compiled=compiled: compiled)
        rootings.cache_clear()
        roots = rootings(TreeTable(6, **options), blocks=blocks)
        found.append((roots.turned, roots.representative, roots.sign, roots.flips and roots.flipped))
    rootings.cache_clear()
    assert found[0] == found[1]


def test_grafting_is_the_butcher_product():
    table = TreeTable(5, colors=2)
    product = grafting(table)
    for u in range(20):
        for v in range(6):
            joined = product(u, v)
            assert joined < 0 or table[joined] == table[u].butcher_product(table[v])
            assert (joined >= 0) == (table[u].order + table[v].order <= 5)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"order": 0}, "order must be 1 or more"),
        ({"order": 4, "blocks": True}, "blocks must be two colours, but were 1"),
        ({"order": 4, "colors": 3, "blocks": True}, "blocks must be two colours, but were 3"),
        ({"order": 4, "max_children": 2}, "table must hold every tree with its root moved, but TreeTable"),
        ({"order": 3, "colors": 2, "blocks": True, "max_children": [[0, None], [None, None]]}, "root moved"),
    ],
)
def test_refusals(arguments, message):
    with pytest.raises(TreeError, match=message):
        free_tree_classes(**arguments)
