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
# # From a tableau to its modified equation
#
# A method with step h, applied to y' = f(y), follows exactly the flow of another differential equation,
# y' = f(y) + h f₂(y) + h² f₃(y) + …, its *modified equation* (E. Hairer, C. Lubich, G. Wanner, *Geometric Numerical
# Integration*, chapter IX). Its terms are elementary differentials of f, one for each rooted tree.

# %%
from fractions import Fraction

from matplotlib import pyplot

import bseries as bs

method = bs.RungeKutta([[0, 0], ["1/2", 0]], [0, 1], name="my midpoint rule")
b = bs.modified_equation(method, 4)
b

# %% [markdown]
# The row of the tree τ says: the modified equation has the term h^(|τ|−1) · weight · F(τ). There is none with h¹: the
# method has order 2. As a formula, without what vanishes:

# %%
print(b.to_latex(nonzero=True))

# %% [markdown]
# ## A quadratic equation: y' = y²
#
# Here f' = 2y, f'' = 2, and all higher derivatives vanish: F(τ) is a number times y^(|τ|+1), and it is zero as soon as
# a node has three children. So only trees with at most two children at each node are needed, and `max_children` leaves
# the others out from the start.


# %%
def differential(tree):
    """F(τ) / y^(|τ|+1) for y' = y²."""
    factor = (1, 2, 2)[len(tree.children)]
    for child in tree.children:
        factor *= differential(child)
    return factor


def square_equation(name, order):
    """The coefficients of y², h y³, h² y⁴, … in the modified equation of y' = y²."""
    found = [Fraction(0)] * order
    for tree, value in bs.modified_equation(bs.method(name), order, max_children=2).items():
        found[tree.order - 1] += value * differential(tree) / tree.symmetry
    return found


for name, order in [("explicit-euler", 6), ("implicit-midpoint", 9), ("rk4", 9)]:
    print(f"{name:18}", ", ".join(map(str, square_equation(name, order))))

# %%
F = Fraction
assert square_equation("explicit-euler", 6) == [1, -1, F(3, 2), F(-8, 3), F(31, 6), F(-157, 15)]
assert square_equation("implicit-midpoint", 9) == [1, 0, F(1, 4), 0, F(1, 8), 0, F(11, 192), 0, F(3, 128)]
assert square_equation("rk4", 9) == [1, 0, 0, 0, F(-1, 24), 0, F(65, 576), F(-17, 96), F(19, 144)]
len(bs.TreeTable(9, max_children=2)), len(bs.TreeTable(9))

# %% [markdown]
# The exact solution from y(0) = 1 is 1/(1−t), with a pole at t = 1. Explicit Euler steps with h = 0.02 (dots) know
# nothing of it; the modified equation, cut off after 1, 2, 3 and 4 terms, follows the dots better and better.

# %%
h = 0.02
points = [1.0]
while len(points) < 54:
    points.append(points[-1] + h * points[-1] ** 2)

pyplot.figure(figsize=(6, 3.5))
for terms in (1, 2, 3, 4):
    powers = [float(c) * h**k for k, c in enumerate(square_equation("explicit-euler", terms))]
    t, y, small = [0.0], [1.0], h / 200
    while t[-1] < 1.06 and y[-1] < 20:
        slope = sum(c * y[-1] ** (k + 2) for k, c in enumerate(powers))
        middle = y[-1] + small / 2 * slope
        y.append(y[-1] + small * sum(c * middle ** (k + 2) for k, c in enumerate(powers)))
        t.append(t[-1] + small)
    pyplot.plot(t, y, label=f"{terms} term{'s' * (terms > 1)}")
pyplot.plot([h * n for n in range(54)], points, "k.", label="explicit Euler")
pyplot.ylim(0, 20)
pyplot.xlim(0.6, 1.06)
pyplot.legend()
pyplot.show()
# %% [markdown]
# ## A linear equation: y' = Ay
#
# Now f'' = 0, and only tall trees contribute. The modified equation is (1/h) log R(hA), R the stability function.

# %%
tall = bs.modified_equation(bs.method("rk4"), 6, max_children=1)
assert tall.coefficients() == [1, 0, 0, 0, F(-1, 120), F(1, 144)]
tall

# %% [markdown]
# ## What the coefficients tell
#
# A method of order p has no terms with h¹ … h^(p−1). The modified equation of a symmetric method has even powers of h
# only: every tree with an even number of nodes has the coefficient 0. RK4 and Heun's method are not symmetric.

# %%
for name in ("rk4", "heun2", "trapezoidal", "gauss2", "lobatto-iiia3"):
    b = bs.modified_equation(bs.method(name), 8)
    powers = sorted({tree.order - 1 for tree, _ in b.nonzero()})
    print(f"{name:14} order {bs.order_of(bs.method(name))}, powers of h: {powers}")
    assert powers[1] == bs.order_of(bs.method(name))
    assert bs.method(name).is_symmetric == all(power % 2 == 0 for power in powers)
