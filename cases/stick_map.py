# %% [markdown]
# # How much sticks: friction and mismatch
#
# Two bodies of different moduli are pressed together, without any tangential load. The softer surface moves
# further towards the axis, so that the contact slips at its rim. How large the stick area is depends on two
# numbers alone: Dundurs' beta, which says how different the bodies are, and the coefficient of friction.
#
# The cells (`# %%`) open as a notebook in VS Code, Spyder and, with jupytext, Jupyter. As a program:
# `python stick_map.py` writes its pictures into the folder where it is run. The same study without a
# program, in files that outlive it: `study_friction.toml`.

# %%
from concurrent.futures import ThreadPoolExecutor

import matplotlib
import numpy as np
import pandas as pd

import hexcontact
from hexcontact.analytic.friction import goodman_stick_ratio
from hexcontact.surfaces import Sphere

matplotlib.use("agg")  # pictures go to files; leave this out in a notebook
import matplotlib.pyplot as plt

nodes_in_radius = 16  # spacings in the contact radius
steps = 12  # load steps, in which the contact grows

friction = np.geomspace(0.05, 0.8, 7)
moduli = [72e9, 108e9, 216e9]  # of the softer body, Pa; the other has 432 GPa

# %% [markdown]
# One case, and what changes from case to case. With a cubic ramp the contact radius grows evenly; the slip of
# nodes that come into contact counts from the moment their gap closed, so that few steps are enough.

# %%
first = hexcontact.Case(
    title="Stiff sphere pressed on a softer flat",
    body_1={"young_modulus": 432e9, "poisson_ratio": 0.32, "surface": Sphere(radius=1e-3)},
    body_2={"young_modulus": moduli[0], "poisson_ratio": 0.32},
    friction_coefficient=float(friction[0]),
    nodes_in_radius=nodes_in_radius,
    entry="interpolated",
    loads=[{"normal_load": 31.5, "ramp": "cubic", "steps": steps}],
)


def solved(change):
    """Return a line of the table: stick radius over contact radius, and the pressure over Hertz's."""
    modulus, mu = change
    case = first.changed({"body.2.young_modulus": modulus, "friction.coefficient": float(mu)})
    last = case.run().step(-1)
    frictionless = case.changed({"friction.coefficient": 0.0, "load.1.steps": 1, "load.1.ramp": None})
    return {
        "beta": abs(case.pair.beta),
        "friction": mu,
        "stick ratio": float(last.stick_radius_fit / last.contact_radius_fit),
        "pressure": float(last.max_pressure / frictionless.run().max_pressure[-1]),
    }


# %% [markdown]
# The solver lets other threads work beside it, so that the cases can share the cores.

# %%
with ThreadPoolExecutor(2) as pool:
    table = pd.DataFrame(pool.map(solved, [(modulus, mu) for modulus in moduli for mu in friction]))
print(table.pivot(index="friction", columns="beta", values="stick ratio").round(3))

# %% [markdown]
# Over mu/beta the three curves fall together. If shear did not move the pressure, the stick ratio would
# depend on mu/beta alone (Goodman, Spence). It does move it, by up to some percent, but the stick ratio
# hardly feels that. What is left of a scatter is the lattice: a slip ring narrower than a spacing is not
# seen.

# %%
ratio = np.geomspace(0.15, 12, 80)
theory = [goodman_stick_ratio(1.0, r) for r in ratio]

figure, (left, right) = plt.subplots(1, 2, figsize=(8.4, 3.4), layout="constrained")
left.semilogx(ratio, theory, color="0.55", lw=1, label="Goodman, Spence")
for color, (beta, rows) in zip(("#0072b2", "#d55e00", "#009e73"), table.groupby("beta"), strict=True):
    name = f"$\\beta$ = {beta:.3f}"
    left.semilogx(rows.friction / beta, rows["stick ratio"], "o", color=color, ms=4, mfc="none", label=name)
    right.semilogx(
        rows.friction, 100 * (rows.pressure - 1), "o-", color=color, ms=4, mfc="none", lw=0.8, label=name
    )
left.set(xlabel=r"$\mu/\beta$", ylabel="stick radius / contact radius", ylim=(0, 1.03))
right.set(xlabel=r"coefficient of friction $\mu$", ylabel="peak pressure above Hertz's (%)", ylim=(0, None))
right.set_xticks([0.05, 0.1, 0.2, 0.4, 0.8], ["0.05", "0.1", "0.2", "0.4", "0.8"])
right.set_xticks([], minor=True)
left.legend(frameon=False)
right.legend(frameon=False)
figure.savefig("stick_map.png", dpi=160)

# %% [markdown]
# Where does it slip? The tractions of one case along x, and the reserve of friction that is left.

# %%
case = first.changed({"friction.coefficient": 0.15})
result = case.run()
section = result.section("pressure", "traction_x")
x = section.x.values * 1e6
figure, axes = plt.subplots(figsize=(5.8, 3.2), layout="constrained")
axes.plot(x, 0.15 * section.pressure / 1e6, color="0.55", lw=1, label=r"$\pm\mu p$")
axes.plot(x, -0.15 * section.pressure / 1e6, color="0.55", lw=1)
axes.plot(x, section.traction_x / 1e6, color="#0072b2", label="$q_x$")
radius = float(result.stick_radius_fit[-1]) * 1e6
axes.axvspan(-radius, radius, color="#0072b2", alpha=0.08, lw=0, label="sticks")
axes.set(xlabel="x (µm)", ylabel="traction (MPa)")
axes.legend(frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
figure.savefig("stick_section.png", dpi=160)
