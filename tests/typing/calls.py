"""Documented calls with every kind of argument, which mypy --strict accepts; nothing here is run."""

from pathlib import Path

import numpy as np
import xarray

import hexcontact
from hexcontact import (
    Case,
    ContactState,
    ElasticPair,
    FlexibilityOperator,
    FrictionalContact,
    Lattice,
    NormalContact,
    Result,
    Session,
    Step,
    Study,
    analytic,
    errors,
    fatigue,
    influence,
    kernel_cache,
    open_result,
    plotting,
    resume,
    run_study,
    surfaces,
)

# --- surfaces -----------------------------------------------------------------------------------------------

ball = surfaces.Sphere(radius="1 mm", exact=True)
radius: float = ball.radius
center: tuple[float, float] = ball.offset
shapes: list[surfaces.Surface] = [
    surfaces.Flat(),
    surfaces.RectangularPunch(width="1 mm", length=1e-3, edge_radius="0.1 mm"),
    surfaces.Roller(radius="10 mm", length="5 mm", profile="crown", crown_radius="1 m"),
    surfaces.Roller(radius=0.01, length=0.005, profile="logarithmic", design_load="1 kN"),
    surfaces.Sphere(radius=1e-3, offset=(0.0, 1e-3)),
    surfaces.Sphere(radius=1e-3, offset=["0.1 mm", "0 mm"]),
    surfaces.Paraboloid(radius_x=1e-3, radius_y="2 mm", angle="30 deg"),
    surfaces.Cylinder(radius="1 mm", angle="90 deg"),
    surfaces.Cone(slope=0.1),
    surfaces.Power(exponent=2, coefficient="0.1 mm^-1"),
    surfaces.Punch(radius="1 mm"),
    surfaces.RoundedPunch(flat_radius=0.0, edge_radius="1 mm"),
    surfaces.Map(file="heights.csv", extent=["1 mm", 2e-3], units="mm", height_units="um", upwards=True),
    surfaces.Map(x=np.zeros(2), y=[0.0, 1e-3], heights=np.zeros((2, 2)), upwards=True),
    surfaces.Profile(y=[0.0, 1e-3], heights=[0.0, 1e-6], upwards=False, angle="30 deg"),
]
heights = ball.height(np.zeros(3), np.zeros(3))

# --- cases --------------------------------------------------------------------------------------------------

steel = {"young_modulus": 210e9, "poisson_ratio": 0.3}
carbide = {"young_modulus": "432 GPa", "poisson_ratio": 0.32, "surface": ball}
lattice = Lattice(1e-6, -5, -5, 11, 11)
array = np.zeros(lattice.shape)
cases = [
    Case(body_1=carbide, body_2=steel, nodes_in_radius=20, normal_load=100.0),
    Case(body_1=carbide, body_2=steel, spacing="1 um", extent=["2 mm", "2 mm"], normal_load="31.5 N"),
    Case(
        body_1=carbide, body_2=steel, spacing=1e-6, center=[0, 0], window=(20, 20), approach="1 um", steps=5
    ),
    Case(body_1=steel, body_2=steel, spacing=1e-6, gap=lambda x, y: x**2 + y**2, approach=1e-6, steps="auto"),
    Case(body_1=steel, body_2=steel, lattice=lattice, gap=array, loads={"normal_load": 3, "steps": 2}),
    Case(
        body_1=steel,
        body_2=steel,
        nodes_across=41,
        gap=xarray.DataArray(array, dims=("x", "y")),
        friction_coefficient=lambda x, y: 0.3 + 0.0 * x,
        shear_limit="200 MPa",
        loads=[{"normal_load": "1 N", "steps": 3}, {"tangential_load_x": [0.1, 0.2], "label": "shear"}],
        accuracy={"target": 0.01, "max_nodes": 100_000},
        fields=["pressure"],
        every=2,
    ),
    Case(
        body_1=carbide,
        body_2=steel,
        nodes_in_radius=10,
        normal_load=1.0,
        friction_coefficient={"along": 0.3, "across": 0.2, "angle": "30 deg"},
        wear={"coefficient": 1e-13, "cycles": 10},
        interface={"coefficient": 1e13},
        accuracy=0.01,
    ),
    Case.from_toml(Path("fretting.toml"), {"grid.spacing": "5 um", "load.1.steps": 5}),
    Case.from_dict({"body": {"1": steel, "2": steel}}),
    Case.from_text("").changed({"friction.coefficient": 0.3}),
    Case.from_text("").changed({"load.1.steps": None}, spacing="5 um", tolerance=1e-9),
]
case = cases[0]
sentences: list[str] = case.warnings

# --- results ------------------------------------------------------------------------------------------------


def enough(step: Step) -> bool:
    return float(step.approach) > 1e-6


result: Result = case.run("out.nc", overwrite=True, on_step=enough, progress=True)
again: Result = resume("out.nc", overrides={"solver.tolerance": 1e-7})
opened: Result = open_result(Path("out.nc"))
pressure: xarray.DataArray = result.pressure
approach: xarray.DataArray = result["approach"]
two: xarray.Dataset = result[1:3]
last: xarray.Dataset = result.step(-1)
total = sum(float(step.normal_load) for step in result)
values = result.at("pressure", x=[0.0, 20e-6], y=0.0, step=1, source="nodes")
across = result.section("pressure", "traction_x", angle=0.5, through=(0.0, 0.0), points=200)
line = result.profile("pressure", start=(-80e-6, 10e-6), end=(80e-6, 10e-6))
p, qx, qy = result.traction_field(2)(np.zeros(3), np.zeros(3))
below = result.stress("stress_xx", points=[(0, 0, 1e-6)], step=[1, 2], body=2)
worst = result.fatigue("findley", segment=["to", "fro"], findley_slope=0.3, depths=[0.0, "1 um"])
worn = result.wear(1e-14, steps=[2, 3])
table = result.to_dataframe("pressure", "traction_x", step=-1)
error: float = result.compare({"approach": 4.9e-6})["approach"].error
plotting.zones(result, [5, 10]).savefig("zones.png")
plotting.overview(last if False else result)

# --- step by step -------------------------------------------------------------------------------------------

with case.start("session.nc", overwrite=True) as session:
    for step in session:
        load: float = step.tangential_load_x
    step = session.advance(tangential_load_x=load + 1.0, label="more", steps=3)
    step = session.advance(normal_load="3 N", twist="1 deg")
    session.back(3)
    same: Session = session

# --- studies ------------------------------------------------------------------------------------------------

study = Study(
    {"body": {"1": steel}},
    {"friction.coefficient": [0.1, 0.2], ("body.1.poisson_ratio", "body.2.poisson_ratio"): {"values": [0.3]}},
    output="study.nc",
    combine="lhs",
    samples=3,
)
collected: xarray.Dataset = study.run(jobs=2, retry=True)
areas = run_study("study.toml", jobs=2).stick_area.sel(friction_coefficient=0.1)
reasons = [outcome.message for _, outcome in study.failures()]

# --- solvers ------------------------------------------------------------------------------------------------

pair = ElasticPair.from_materials(210e9, 0.3, None, None)
displacements = FlexibilityOperator(lattice, pair)
normal = NormalContact(lattice, pair, array).solve(normal_load=1.0)
friction = FrictionalContact(lattice, pair, array, friction_coefficient=0.3)
state: ContactState = friction.virgin()
hertz = analytic.hertz_sphere(1e11, 1e-3, normal_load=10.0).contact_radius
kernel_cache.configure(memory="1 GB")
amplitude = fatigue.crossland(np.zeros((4, 6)), slope=0.3)
try:
    case.run()
except (errors.ConvergenceError, hexcontact.DeckError) as failure:
    print(failure, influence)
