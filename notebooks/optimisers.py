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
# # What momentum minimises
#
# Gradient descent with momentum is the iteration
#
# $$ y_{n+1} = (1+\beta)\,y_n - \beta\,y_{n-1} - h\,\nabla L(y_n). $$
#
# Started well, it follows a differential equation without memory. Up to terms of size $h^2$ this is the gradient flow
# of
#
# $$ \tilde L = \frac{L}{1-\beta} + h\,\frac{1+\beta}{4(1-\beta)^3}\,|\nabla L|^2, $$
#
# which is compared with a run here.

# %%
# %matplotlib inline
import numpy as np
from matplotlib import pyplot
from scipy.integrate import solve_ivp

import bseries as bs

BLUE, ORANGE, BLACK = "#0072B2", "#D55E00", "#000000"  # told apart by all (Okabe, Ito)
H, STEPS, Y0 = 0.002, 250, [1.0, -0.5]
method = bs.memory.momentum("1/2")
print(bs.memory.modified_loss(bs.memory.momentum()))


# %%
def loss(y):
    return y[0] ** 2 / 2 + y[0] ** 4 / 4 + (y[1] - y[0]) ** 2


def slope(y):
    return np.array([-y[0] - y[0] ** 3 + 2 * (y[1] - y[0]), 2 * (y[0] - y[1])])


scene = bs.parse_scene("x' = -x - x^3 + 2*y - 2*x; y' = 2*x - 2*y")
run = list(bs.memory.starting_values(method, scene, H, 4, y0=Y0))
while len(run) <= STEPS:
    run.append(1.5 * run[-1] - 0.5 * run[-2] + H * slope(run[-1]))
losses, times = loss(np.array(run).T), H * np.arange(STEPS + 1)

# %% [markdown]
# ## The prediction
#
# The gradient flow of $L/(1-\beta)$ misses the loss; with the term of order h the loss is predicted within 1 %. The
# step is small: the series helps only where $h\lambda < (1-\sqrt\beta)^2$ for the curvatures $\lambda$ of $L$.

# %%
errors = {}
for order, color in ((1, BLACK), (2, ORANGE), (3, BLUE)):
    field = bs.modified_field(method, scene, order)
    flow = solve_ivp(lambda t, y, f=field: f(y, H), (0, times[-1]), Y0, t_eval=times, rtol=1e-9, atol=1e-12).y
    errors[order] = np.abs(loss(flow) / losses - 1)
    pyplot.semilogy(times[1:], errors[order][1:], color=color, label=f"order {order}")
pyplot.xlabel("t")
pyplot.ylabel("relative error of the loss")
pyplot.legend()
assert errors[2].max() < 0.01 < errors[1].max()
print({order: f"{error.max():.1e}" for order, error in errors.items()})
