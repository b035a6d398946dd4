# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Trees, tables and the group of B-series
#
# A rooted tree is a value: equal trees are equal however they were written, and print the same.

# %%
from fractions import Fraction

import bseries as bs

tree = bs.Tree("[[τ]τ]")
assert tree == bs.Tree("[τ,[τ]]") == bs.Tree("[0,1,2,1]")
tree

# %%
print(tree, tree.order, tree.symmetry, tree.density)
print(tree.differential())
print(tree.condition())

# %% [markdown]
# ## Tables
#
# A `TreeTable` holds every tree up to an order. The number of a tree in it, its id, follows the public order by
# (number of nodes, root colour, left, right), where `right` is the largest child and `left` the rest of the tree.

# %%
table = bs.TreeTable(5)
table

# %%
print(len(table), table.sizes, table.index(tree))
print(table.density.tolist())
assert table[table.index(tree)] == tree
assert all(t.left.butcher_product(t.right) == t for t in table if t.order > 1)

# %% [markdown]
# Counting needs no table: trees in one colour, then in two, as partitioned methods need them; last the trees in two
# colours for a separable system, p' = −U'(q), q' = T'(p), where colours alternate.

# %%
separable = [[0, None], [None, 0]]
print(bs.trees.count_trees(12))
print(bs.trees.count_trees(8, colors=2))
print(bs.trees.count_trees(8, colors=2, max_children=separable))

# %% [markdown]
# ## Flows form a group
#
# A series maps trees to coefficients. The series of maps, those with coefficient 1 at the empty tree, can be composed,
# inverted and raised to powers. `compose(a, c)` applies a first, then c.

# %%
half = Fraction(1, 2)
explicit = bs.series("explicit-euler", 6).scale_step(half)
implicit = bs.series("implicit-euler", 6).scale_step(half)
midpoint = bs.compose(implicit, explicit)
trapezoidal = bs.compose(explicit, implicit)
assert midpoint == bs.series("implicit-midpoint", 6)
assert trapezoidal == bs.series("trapezoidal", 6)

# %% [markdown]
# The same two half steps in either order: the trapezoidal rule is the midpoint rule seen in other coordinates, which
# one explicit half step introduces and its inverse takes away at the end.

# %%
assert trapezoidal == bs.compose(bs.compose(explicit, midpoint), explicit.inverse())
assert trapezoidal != midpoint
bs.method("implicit-midpoint").is_symplectic, bs.method("trapezoidal").is_symplectic

# %% [markdown]
# The adjoint method is the inverse with the step reversed. Half a step of a method, then half a step of its adjoint,
# make a symmetric method, whose order is even: from order 3 comes order 4 (*Geometric Numerical Integration*, II.4).

# %%
kutta3 = bs.series("kutta3", 6).scale_step(half)
symmetric = bs.compose(kutta3, kutta3.adjoint())
assert explicit.adjoint() == implicit
assert symmetric.adjoint() == symmetric
bs.order_of(kutta3.scale_step(2)), bs.order_of(symmetric)

# %% [markdown]
# ## Logarithm, exponential, powers
#
# `log` gives the field whose exact flow a map is: its modified equation. Half a step of it, followed by another half,
# is the whole step again.

# %%
rk4 = bs.series("rk4", 6)
field = rk4.log()
assert field == bs.modified_equation("rk4", 6)
assert field.exp() == rk4
root = rk4**half
assert bs.compose(root, root) == rk4
assert rk4**-1 == rk4.inverse()
(rk4 - bs.exact_flow(6)).nonzero()[:4]

# %% [markdown]
# ## Using it well
#
# Ask for the trees you need (`max_children`), at the largest order you need, once: `truncate` gives the lower orders.

# %%
verlet = bs.method("stormer-verlet-kdk")
b = bs.modified_equation(verlet, 8, max_children=separable)
print(len(b), "trees instead of", len(bs.TreeTable(8, colors=2)))
b.truncate(3)

# %% [markdown]
# Coefficients are exact until you round them, and data for other programs comes with everything about each tree.

# %%
print(b.truncate(3).to_float()["p[q[p]]"], b.to_dict()["terms"][4])
