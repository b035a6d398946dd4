# pyright: strict
"""What a user writes: no type in it may be unknown. `.ci/run` checks it outside the clone, and runs it."""

import bseries as bs

method = bs.RungeKutta([[0, 0], ["2/3", 0]], ["1/4", "3/4"], name="mine")
b = bs.modified_equation(method, 4)
print(b["[[τ]]"], bs.order_of(method), bs.symplecticity(method, 4).breaks)
print(b.to_latex(), b.to_table())
print(bs.compose(bs.series("rk4", 4), bs.exact_flow(4)) == bs.series("rk4", 4) ** 2)
print(bs.check("rk4").order)

pendulum = bs.scene("pendulum")
f = bs.modified_field("stormer-verlet", pendulum, 5)
H = bs.modified_hamiltonian("stormer-verlet", pendulum, 5)
print(f([0.3, -1.5], 0.1), H([0.0, -1.5], 0.1), f.symbolic(2))

run = bs.integrate("stormer-verlet", pendulum, h=0.1, steps=100, observe="energy")
energies = run.observed["energy"]
print(run.t[-1], run.y.shape, energies.max() - energies.min())
print(run.to_pandas().shape, b.to_table().to_pandas().columns)
print(bs.shadow_energy(run, order=8).best, bs.energy_drift("rk4", pendulum, h=0.1).slope())

result = bs.ensemble("rk4", pendulum, h=0.1, steps=10, y0=[[0, 1], [0, 2]])
print(result.mean["energy"], result.std["energy"])
axes = run.plot()
print(axes.get_xlabel())
