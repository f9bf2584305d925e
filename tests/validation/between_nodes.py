"""Relative L2 errors of tractions at the nodes and between them, against Cattaneo and Mindlin.

    cd tests; python -m validation.between_nodes

Spheres pressed and sheared in one step, nu = 0, at random places on the lattice and in random directions.
Prints the tables of docs/theory/edges.md.
"""

from __future__ import annotations

import numpy as np

from hexcontact import analytic
from hexcontact.arrays import Array
from hexcontact.core.contact import ElasticPair
from hexcontact.core.edges import ContactEdges, TractionField
from hexcontact.core.friction import FrictionalContact, FrictionLaw
from hexcontact.core.lattice import Lattice

RADIUS, MU = 50.0, 0.3
SPACINGS = {10: 8, 20: 8, 40: 4, 80: 2}
"""Spacings in the contact radius, and places."""
RATIOS = (0.9, 0.79, 0.5)
"""Radius of the stick area over that of the contact; 0.79: half of the load of full sliding."""
CONTROL = ["force", "force", "force", "displacement"]


def errors(spacings: int, ratio: float, rng: np.random.Generator) -> list[float]:
    """Return errors of p, then of q: at the nodes, everywhere; each as solved and to the edges."""
    pair = ElasticPair.from_materials(1.0, 0.0, 1.0, 0.0)
    hertz = analytic.hertz_sphere(pair.effective_modulus, RADIUS, contact_radius=1.0)
    x, y = rng.uniform(0.0, 1.0 / spacings, 2).tolist()
    lattice = Lattice.covering(1.0 / spacings, (0.0, 0.0), 2.8, 2.8, origin=(x, y))
    gap = (lattice.x**2 + lattice.y**2) / (2.0 * RADIUS)
    contact = FrictionalContact(lattice, pair, gap, friction_coefficient=MU)
    turn = rng.uniform(0.0, np.pi)
    way = np.array([np.cos(turn), np.sin(turn)])
    load = MU * hertz.normal_load * (1.0 - ratio**3) * way
    state = contact.advance(contact.virgin(), CONTROL, (hertz.normal_load, *load.tolist(), 0.0), static=True)
    where = lattice.basis, lattice.start
    solved = np.stack([state.pressure, state.traction_x, state.traction_y])
    edges = ContactEdges(
        state.pressure, state.gap, state.zone > 0, np.ones(lattice.shape, dtype=bool), *where
    )
    field = edges.field(solved[1:], state.zone == 1, FrictionLaw(MU))

    def exact(x: Array, y: Array) -> Array:
        r = np.hypot(x, y)
        p, reserve = (
            c * hertz.max_pressure * np.sqrt(np.clip(1 - (r / c) ** 2, 0, None)) for c in (1.0, ratio)
        )
        return np.stack([p, *(MU * (p - reserve) * component for component in way)])

    plane = np.meshgrid(*2 * [np.linspace(-1.1, 1.1, 401)])
    nodes, between = exact(lattice.x, lattice.y), exact(*plane)
    joined = TractionField.of_nodes(solved, lattice)(*plane)
    pairs = ((solved, nodes), (field.at_nodes(), nodes), (joined, between), (field(*plane), between))
    return [
        float(np.linalg.norm((found - true)[part]) / np.linalg.norm(true[part]))
        for part in (slice(1), slice(1, 3))
        for found, true in pairs
    ]


def main() -> None:
    """Print the tables."""
    rng = np.random.default_rng(1)
    means = {
        ratio: [np.mean([errors(n, ratio, rng) for _ in range(m)], axis=0) for n, m in SPACINGS.items()]
        for ratio in RATIOS
    }
    rows = (
        "at the nodes, as solved",
        "at the nodes, to the edges",
        "everywhere, joined linearly",
        "everywhere, to the edges",
    )
    for title, part, ratios in (("p", 0, RATIOS[1:2]), ("q", 4, RATIOS)):
        print(f"\n| $a/l_e$, {title} | " + " | ".join(map(str, SPACINGS)) + " |")
        for ratio in ratios:
            for k, row in enumerate(rows):
                about = f", $c/a={ratio:g}$" if part else ""
                print(
                    f"| {row}{about} | "
                    + " | ".join(f"{found[part + k]:.2g}" for found in means[ratio])
                    + " |"
                )


if __name__ == "__main__":
    main()
