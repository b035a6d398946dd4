"""The table: counts, order of ids, products, splits, σ and γ, restricted families, refusals."""

import itertools
from collections import Counter

import numba  # noqa: F401  (tables made from here on use compiled kernels)
import pytest

import trees.basis
import trees.table
from trees import Tree, TreeError, TreeTable, count_trees, folds
from trees.counting import memory_estimate
from trees.kernels import graft

SEPARABLE = [[0, None], [None, 0]]
NYSTROM = [[0, None], [1, 0]]
TABLES = [
    (8, 1, None),
    (5, 2, None),
    (4, 3, None),
    (7, 2, SEPARABLE),
    (7, 2, NYSTROM),
    (8, 1, 2),
    (5, 2, [[1, 2, 2], [2, 0]]),
]


@pytest.fixture(params=["compiled", "interpreted"])
def make(request, monkeypatch):
    """TreeTable, with kernels compiled or run by the interpreter."""
    monkeypatch.setattr(trees.basis, "machine_code_pays", lambda products: request.param == "compiled")
    return TreeTable


def cuts(tree):
    """Splits by the definition: remove each edge in turn. The slow, obvious version."""
    for i, child in enumerate(tree.children):
        rest = [*tree.children[:i], *tree.children[i + 1 :]]
        yield Tree.join(rest, tree.color), child
        for trunk, branch in cuts(child):
            yield Tree.join([*rest, trunk], tree.color), branch


@pytest.mark.parametrize(
    ("colors", "limits", "counts"),
    [
        (1, None, (1, 1, 2, 4, 9, 20, 48, 115, 286, 719, 1842, 4766, 12486, 32973)),
        (2, None, (2, 4, 14, 52, 214, 916, 4116)),
        (3, None, (3, 9, 45, 246, 1485)),
        (4, None, (4, 16, 104, 752)),
        (2, SEPARABLE, (2, 2, 4, 8, 18, 40, 96, 230)),
        (2, NYSTROM, (2, 2, 3, 5, 9, 16, 30, 56)),
        (1, 1, (1,) * 20),
        (1, 2, (1, 1, 2, 3, 6, 11, 23, 46, 98, 207)),  # OEIS A001190
    ],
)
def test_counts_agree_with_the_literature_and_with_enumeration(colors, limits, counts):
    assert count_trees(len(counts), colors, limits) == counts
    assert tuple(TreeTable(len(counts), colors, limits).sizes) == counts


def test_counting_needs_no_enumeration():
    assert count_trees(40)[-1] == 11703780079612453  # OEIS A000081
    assert sum(count_trees(20)) == 20247374


@pytest.mark.parametrize(("order", "colors", "limits"), TABLES)
def test_ids_follow_the_order_of_trees_and_find_them_back(make, order, colors, limits):
    table = make(order, colors, limits)
    trees = list(table)
    assert len(set(trees)) == len(trees) == len(table)
    assert trees == sorted(trees)
    assert [table.index(tree) for tree in trees] == list(range(len(table)))
    assert [tree.order for tree in trees] == table.order.tolist()


@pytest.mark.parametrize(("order", "colors", "limits"), TABLES)
def test_symmetry_and_density_agree_with_those_of_the_trees(make, order, colors, limits):
    table = make(order, colors, limits)
    assert table.symmetry.tolist() == [tree.symmetry for tree in table]
    assert table.density.tolist() == [tree.density for tree in table]


@pytest.mark.parametrize(("order", "colors", "limits"), TABLES)
def test_splits_are_the_cuts_of_single_edges(make, order, colors, limits):
    table = make(order, colors, limits)
    (made,) = table.cut_chunks()
    for at, tree in enumerate(table):
        span = slice(made.start[at], made.start[at + 1])
        pairs = zip(made.trunk[span], made.branch[span], strict=True)
        assert Counter((table[t], table[b]) for t, b in pairs) == Counter(cuts(tree))
        assert Counter(table.rows(at)) == Counter((table.index(t), table.index(b), 1) for t, b in cuts(tree))


def test_splits_made_in_passing_equal_kept_ones(make, monkeypatch):
    (kept,) = make(9).cut_chunks()
    monkeypatch.setattr(trees.table, "KEPT_SPLITS", 100)
    monkeypatch.setattr(trees.table, "CHUNK", 50)
    table = make(9)
    top = table.ids(9)
    chunks = list(table.cut_chunks())[1:]
    assert (chunks[0].first, chunks[0].last) == (top.start, top.start + 50)
    assert chunks[-1].last == top.stop
    trunks = list(itertools.chain.from_iterable(chunk.trunk for chunk in chunks))
    assert trunks == list(kept.trunk[kept.start[top.start] :])
    starts = [(chunk.start[-1], len(chunk.trunk)) for chunk in chunks]
    assert starts == [(8 * (chunk.last - chunk.first),) * 2 for chunk in chunks]


def test_grafting_finds_the_product_for_every_pair(make):
    table = make(5, 2)
    for (u, first), (v, second) in itertools.product(enumerate(table), repeat=2):
        at = table.run(graft)(u, v, 5, 2, *table.columns, table.column(6, "int32"))
        if first.order + second.order <= 5:
            assert table[at] == first.butcher_product(second)
        else:
            assert at < 0


def test_a_restricted_table_holds_the_trees_that_obey_and_no_others():
    def obeys(tree):
        return len(tree.children) <= 2 and all(map(obeys, tree.children))

    assert list(TreeTable(8, 1, 2)) == [tree for tree in TreeTable(8) if obeys(tree)]
    with pytest.raises(TreeError, match=r"must be one of the 93 trees .* but was \[τ,τ,τ\]"):
        TreeTable(8, 1, 2).index("[τ,τ,τ]")


def test_trees_of_further_colours_are_outside():
    table = TreeTable(3, 2)
    for levels, colors in (([0], [2]), ([0, 1], [0, 2]), ([0, 1], [2, 0])):
        tree = Tree.from_levels(levels, colors)
        assert tree not in table
        with pytest.raises(TreeError, match="must be one of the 20 trees"):
            table.index(tree)


def test_rows_of_columns_are_read_only():
    with pytest.raises(ValueError, match="read-only"):
        TreeTable(4).density[0] = 2


def test_densities_beyond_int64_are_exact():
    table = TreeTable(25, 1, 1)
    assert table.density[-1] == 15511210043330985984000000  # 25!


def test_slices_and_negative_ids():
    table = TreeTable(4)
    assert table[-1] == table[7] == Tree("[τ,τ,τ]")
    assert table[:2] == [Tree("τ"), Tree("[τ]")]
    with pytest.raises(IndexError, match="id below 8, but was 8"):
        table[8]


def test_tables_are_equal_by_their_arguments():
    assert TreeTable(4, 2) == TreeTable(4, 2, [[None, None], [float("inf"), None, None]])
    assert TreeTable(4, 2) != TreeTable(4, 2, SEPARABLE)
    assert hash(TreeTable(5)) == hash(TreeTable(5))


def test_estimates_of_memory_are_what_tables_take():
    """A byte for order and colour, four for each id; a tree below the top order has as many cuts as edges."""
    table = TreeTable(7, 2)
    _, order, color, left, right, _, base = table.columns
    (kept,) = table.cut_chunks()
    below = table.offsets[-2]
    splits = sum(x[: kept.start[below]].nbytes for x in (kept.trunk, kept.branch)) + kept.start[:below].nbytes
    columns = sum(x.nbytes for x in (order, color, left, right, base))
    assert memory_estimate(table.sizes, 2) == columns
    assert memory_estimate(table.sizes, 2, splits=True) == columns + splits


def test_tables_too_large_to_keep_are_made_anew(monkeypatch):
    monkeypatch.setattr(trees.table, "kept_table", lambda order, limits: None)
    made = trees.table.tree_table(4, 2, SEPARABLE)
    assert made == TreeTable(4, 2, SEPARABLE)
    assert made is not trees.table.tree_table(4, 2, SEPARABLE)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0,), "order must be 1 or more, but was 0"),
        ((10**5000,), "order must be of reasonable size, but had 16,610 binary digits"),
        ((2**9999,), "order must be 60 or less"),
        ((-3,), "order must be 1 or more, but was -3"),
        ((2.5,), "order must be a whole number, but was 2.5"),
        (("4",), "order must be a whole number, but was '4'"),
        ((True,), "order must be a whole number, but was True"),
        ((10**30,), "order must be 60 or less, but was 1000000"),
        ((4, 0), "colors must be 1 or more, but was 0"),
        ((4, 1000), "colors must be 100 or less, but was 1000"),
        ((4, 2, [[1, 2]]), "max_children must be one bound or 2 rows of 2 or 3 bounds, .* but was \\[\\[1, 2\\]\\]"),
        (
            (4, 1, [[-1]]),
            "max_children must be one bound or 1 row of 1 or 2 bounds, each a whole number, .* but was \\[\\[-1\\]\\]",
        ),
        ((4, 1, 0.5), "max_children must be one bound or 1 row .* but was 0.5"),
        ((30,), "order must be smaller: a table of trees with 30 nodes in 1 colours would"),
        ((25,), "order must be smaller: .* would take [0-9.]+ GB of memory, but [0-9.]+ GB are available|2\\^31"),
    ],
)
def test_refusals_name_the_argument(arguments, message):
    with pytest.raises(TreeError, match=message):
        TreeTable(*arguments)


@pytest.mark.parametrize(("order", "colors", "names"), [(7, 1, None), (4, 2, ("fast", "slow")), (3, 3, tuple("abc"))])
def test_texts_from_factors_are_those_of_trees(order, colors, names):
    table = TreeTable(order, colors)
    text, formula = folds.tree_texts(table, names), folds.differentials(table, names)
    levels, colors_of = folds.levels(table), folds.colors(table)
    for at in reversed(range(len(table))):
        tree = table[at]
        assert (text(at), formula(at)) == (tree.text(names), tree.differential(names=names))
        assert (levels(at), colors_of(at)) == (tree.levels, tree.colors)
