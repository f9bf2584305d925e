# %% [markdown]
# # Two pads in one window
#
# A flat die with two spherical pads, the second 0.15 µm shorter, is pressed on a flat of the same material
# and sheared. The gap is a function of x and y; the window covers both pads, which influence each other
# through the bodies. The bodies do not tilt, and both pads have the same shift.
#
# The cells (`# %%`) open as a notebook in VS Code, Spyder and, with jupytext, Jupyter. As a program:
# `python two_pads.py` writes its picture into the folder where it is run.

# %%
import matplotlib
import numpy as np

import hexcontact

matplotlib.use("agg")  # pictures go to files; leave this out in a notebook
import matplotlib.pyplot as plt

nodes_in_radius = 16  # spacings in the contact radius of one pad

centers = np.array([[-0.25e-3, 0.0], [0.25e-3, 0.0]])  # of the pads, m
shorter = np.array([0.0, 0.15e-6])  # how far they stay behind, m
mu, load = 0.4, 40.0
spacing = 0.15e-3 / nodes_in_radius


def gap(x, y):
    """Gap between the die and the flat: of the pad that is nearer there."""
    pads = [((x - x0) ** 2 + (y - y0) ** 2) / 2e-2 + h for (x0, y0), h in zip(centers, shorter, strict=True)]
    return np.minimum(*pads)


steel = {"young_modulus": 210e9, "poisson_ratio": 0.0}  # 0: the tractions then have a closed form, see below
common = {"body_1": steel, "body_2": steel, "gap": gap, "spacing": spacing, "extent": (1e-3, 0.5e-3)}
shear = [{"tangential_load_x": q * mu * load} for q in (0.3, 0.6, 0.9)]
case = hexcontact.Case(
    title="Two pads",
    **common,
    friction_coefficient=mu,
    loads=[{"normal_load": load}, *shear],
)
result = case.run()

# %% [markdown]
# The forces of a pad are the sums over its nodes, each with the area of its cell. The longer pad carries
# more, and the shorter one is nearer to sliding as a whole. The result file has the totals only.

# %%
cell = np.sqrt(0.75) * spacing**2
print("step     P_1     P_2     Q_1     Q_2   Q_1/μP_1  Q_2/μP_2   (N)")
for number in range(1, len(result) + 1):
    step = result.step(number)
    left = step.x < 0.0
    (p1, p2), (q1, q2) = (
        [float(field.where(side, 0.0).sum()) * cell for side in (left, ~left)]
        for field in (step.pressure, step.traction_x)
    )
    assert abs(p1 + p2 - load) < 1e-6 * load  # the pads share the load
    print(f"{number:4d} {p1:7.3f} {p2:7.3f} {q1:7.3f} {q2:7.3f} {q1 / mu / p1:9.3f} {q2 / mu / p2:9.3f}")

# %% [markdown]
# Between alike bodies with Poisson's ratio 0 the traction is the difference of two contacts without friction,
# under P and under P - Q/mu, whatever the surfaces are (Jaeger, Ciavarella), on this lattice to the tolerance
# of the solver.

# %%
pressed, left_over = (
    hexcontact.Case(**common, normal_load=p).run().step(-1) for p in (load, load - 0.6 * load)
)
shown = result.step(3)
exact = mu * (pressed.pressure - left_over.pressure)
difference = float(abs(shown.traction_x - exact).max() / (mu * pressed.pressure.max()))
print(f"largest difference from the superposition: {difference:.0e} μ p_max")

# %%
section = result.section("pressure", "traction_x", step=3)
figure, axes = plt.subplots(figsize=(6.4, 3.2), layout="constrained")
x = section.x.values * 1e6
axes.plot(x, mu * section.pressure / 1e6, color="0.55", lw=1, label=r"$\mu p$")
axes.plot(x, section.traction_x / 1e6, color="#0072b2", label="$q_x$ at $Q = 0.6\\,\\mu P$")
axes.set(xlabel="x (µm)", ylabel="traction (MPa)")
axes.legend(frameon=False)
figure.savefig("two_pads.png", dpi=160)
