# %% [markdown]
# # From Hertz to fretting
#
# A stiff sphere on a flat, in five stations: pressed without friction (Hertz), pressed with friction,
# sheared, sheared to and fro, and driven by a script until next to nothing sticks.
#
# The cells (`# %%`) open as a notebook in VS Code, Spyder and, with jupytext, Jupyter. As a program:
# `python hertz_to_fretting.py` writes its pictures into the folder where it is run.

# %%
import numpy as np

import hexcontact
from hexcontact import plotting
from hexcontact.surfaces import Sphere

nodes_in_radius = 20  # spacings in the contact radius; with 40 the errors are a quarter, the time four times

stiff = {"young_modulus": 432e9, "poisson_ratio": 0.32}
aluminum = {"young_modulus": 72e9, "poisson_ratio": 0.32}
load = 31.5  # N

# %% [markdown]
# ## Hertz
#
# Without friction the materials matter through E* only. `compare` knows that this is Hertz's problem.

# %%
hertz = hexcontact.Case(
    title="Stiff sphere on aluminum, no friction",
    body_1={**stiff, "surface": Sphere(radius=1e-3)},
    body_2=aluminum,
    nodes_in_radius=nodes_in_radius,
    normal_load=load,
)
pressed = hertz.run()
print(pressed.compare())

# %% [markdown]
# The pressure along x, at the corners of the polygon that it is on the lattice:

# %%
plotting.section(pressed).savefig("hertz_section.png")
section = pressed.section("pressure")
print(f"{section.sizes['distance']} corners, largest {float(section.pressure.max()) / 1e9:.3f} GPa")

# %% [markdown]
# ## Friction alone makes slip
#
# Both surfaces move towards the axis, the aluminum's more. Friction hinders it: a disc sticks, a ring slips,
# and the pressure rises above Hertz's. There is no closed solution of this, and `compare` says so.

# %%
fretting = hexcontact.Case(
    title="Stiff sphere on aluminum: press, then shear",
    body_1={**stiff, "surface": Sphere(radius=1e-3)},
    body_2=aluminum,
    friction_coefficient=0.1,
    nodes_in_radius=nodes_in_radius,
    loads=[
        {"normal_load": load, "ramp": "cubic", "steps": 10, "label": "press"},
        {"tangential_load_x": 0.8 * 0.1 * load, "steps": 10, "label": "shear"},
    ],
)
result = fretting.run()
last_pressed = result.step(10)
share = float(last_pressed.stick_area_fit / last_pressed.contact_area_fit)
peak = float(last_pressed.max_pressure) / float(pressed.max_pressure[-1])
print(f"pressed: {share:.1%} of the contact sticks, the pressure is {100 * (peak - 1):.1f} % above Hertz's")
print(result.compare(step=10))

# %% [markdown]
# ## Sheared
#
# The first small tangential load enlarges the stick area and moves it aside; then slip eats into it.

# %%
plotting.zones(result, steps=[10, 11, 12, 14, 17, 20]).savefig("fretting_zones.png")
plotting.tractions(result, steps=[10, 12, 15, 20]).savefig("fretting_tractions.png")

# %% [markdown]
# ## To and fro
#
# With alike materials this is Mindlin's and Deresiewicz's loop. Two turns, then what the theory says:

# %%
swing = 0.7 * 0.1 * load
alike = hexcontact.Case(
    title="Alike spheres sheared to and fro",
    body_1={**aluminum, "surface": Sphere(radius=1e-3)},
    body_2=aluminum,
    friction_coefficient=0.1,
    nodes_in_radius=nodes_in_radius,
    loads=[
        {"normal_load": load, "label": "press"},
        {"tangential_load_x": swing, "steps": 6, "label": "first loading"},
        {
            "path": [{"tangential_load_x": -swing, "steps": 8}, {"tangential_load_x": swing, "steps": 8}],
            "repeat": 2,
            "label": "cycle",
        },
    ],
)
loop = alike.run()
plotting.loop(loop).savefig("mindlin_loop.png")
print(loop.compare())
cycles = np.diff(loop.dissipated_energy.values[[6, 22, 38]])
print(f"dissipated in the two cycles: {cycles[0] * 1e9:.2f} nJ and {cycles[1] * 1e9:.2f} nJ")

# %% [markdown]
# ## Until next to nothing sticks
#
# How much tangential load does it take until a twentieth of the contact sticks? The next load depends on the
# last answer: the session goes on in small increments, and takes the last one back to halve it.

# %%
session = fretting.start()
for step in session:
    if step.label == "press" and step.number == 10:
        break
tangential, increment = 0.0, 0.5
while increment > 0.01:
    step = session.advance(tangential_load_x=tangential + increment)
    if step.stick_area_fit < 0.05 * step.contact_area_fit:
        session.back()
        increment /= 2
    else:
        tangential += increment
sliding = 0.1 * load
print(f"a twentieth sticks at Q = {tangential:.2f} N = {tangential / sliding:.3f} mu P")
print(f"{len(session.steps)} steps were kept")
