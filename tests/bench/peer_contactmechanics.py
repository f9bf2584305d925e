"""Runs ContactMechanics; executed with the Python of its environment."""

from __future__ import annotations

from typing import Any

import numpy as np
from ContactMechanics import FreeFFTElasticHalfSpace, PeriodicFFTElasticHalfSpace
from ContactMechanics.Factory import make_system
from square_window import best_of, main, rough_window, square_window
from SurfaceTopography import Topography


def hertz(side: int, fraction: float, tolerance: float, repeats: int) -> dict[str, Any]:
    """Polonsky and Keer's conjugate gradients on the padded operator."""
    contact = square_window(side, fraction)
    largest = 2 / np.pi * contact.a

    def set_up() -> Any:
        substrate = FreeFFTElasticHalfSpace((side, side), 1.0, (1.0, 1.0))
        return make_system(surface=Topography(-contact.gap, physical_sizes=(1.0, 1.0)), substrate=substrate)

    def solve() -> Any:
        # its bounds are lengths and forces; these make them our R_n
        return system.minimize_proxy(
            external_force=contact.load,
            pentol=tolerance * contact.self_compliance * largest,
            forcetol=tolerance * largest * contact.cell_area,
            thermotol=tolerance,
            maxiter=20_000,
        )

    setup, system = best_of(repeats, set_up)
    seconds, result = best_of(repeats, solve)
    if not result.success:
        raise RuntimeError(str(result.message))
    pressure = np.array(result.jac)[:side, :side] / contact.cell_area
    approach = abs(float(result.offset))
    total = contact.gap + abs(np.array(result.x)[:side, :side])
    return {
        "setup": setup,
        "solve": seconds,
        "iterations": int(result.nit),
        **contact.errors(pressure, total - approach, approach),
    }


def rough(side: int, tolerance: float, repeats: int) -> dict[str, Any]:
    """The same iteration on the periodic operator."""
    contact = rough_window(side)

    def set_up() -> Any:
        substrate = PeriodicFFTElasticHalfSpace((side, side), 1.0, (1.0, 1.0))
        surface = Topography(-contact.gap, physical_sizes=(1.0, 1.0), periodic=True)
        return make_system(surface=surface, substrate=substrate)

    def solve() -> Any:
        largest = 0.5  # Pa, of pressures up to several times E* h'
        own = 4 * np.log(1 + np.sqrt(2)) / side / np.pi
        return system.minimize_proxy(
            external_force=contact.mean_pressure,
            pentol=tolerance * own * largest,
            forcetol=tolerance * largest / side**2,
            thermotol=tolerance,
            maxiter=20_000,
        )

    setup, system = best_of(repeats, set_up)
    seconds, result = best_of(repeats, solve)
    if not result.success:
        raise RuntimeError(str(result.message))
    pressure, total = np.array(result.jac) * side**2, contact.gap + abs(np.array(result.x))
    return {
        "setup": setup,
        "solve": seconds,
        "iterations": int(result.nit),
        **contact.errors(pressure, total - total[pressure > 0].mean()),
    }


if __name__ == "__main__":
    main({"hertz": hertz, "rough": rough})
