"""Runs slippy; executed with the Python of its environment."""

from __future__ import annotations

from typing import Any

import numpy as np
import slippy
import slippy.core
from slippy.core import elastic_material
from square_window import best_of, main, rough_window, square_window


def hertz(side: int, fraction: float, tolerance: float, repeats: int) -> dict[str, Any]:
    """Polonsky and Keer's conjugate gradients on the padded operator, without slippy's model around it."""
    slippy.CUDA = False
    contact = square_window(side, fraction)
    h = 1.0 / side
    start = np.ones((side, side))

    def set_up() -> Any:
        kernel = slippy.core.elastic_influence_matrix_spatial(
            "zz", span=(2 * side, 2 * side), grid_spacing=(h, h), shear_mod=0.5, v=0.0
        )
        return slippy.core.plan_convolve(start, kernel, circular=False, fft_im=False)

    setup, product = best_of(repeats, set_up)
    seconds, (failed, pressure, _) = best_of(
        repeats,
        lambda: slippy.core.polonsky_and_keer(
            product, start, contact.gap, contact.load, [h, h], eps_0=tolerance, max_it=20_000
        ),
    )
    if failed:
        raise RuntimeError("not converged")
    total = contact.gap + product(pressure)
    approach = float(total[pressure > 0].mean())
    return {"setup": setup, "solve": seconds, **contact.errors(pressure, total - approach, approach)}


def rough(side: int, tolerance: float, repeats: int) -> dict[str, Any]:
    """The same iteration on slippy's periodic symbol."""
    slippy.CUDA = False
    contact = rough_window(side)
    h = 1.0 / side
    start = np.full((side, side), contact.mean_pressure)

    def set_up() -> Any:
        waves = elastic_material.get_angular_velocity((side, side), (h, h))
        squared = waves[0] ** 2 + waves[1] ** 2
        symbol = elastic_material.elastic_influence_matrix_frequency(
            waves[1], waves[0], np.sqrt(squared), squared, "zz", 1.0, 0.0
        )
        return slippy.core.plan_convolve(start, symbol, circular=True)

    setup, product = best_of(repeats, set_up)
    seconds, (failed, pressure, _) = best_of(
        repeats,
        lambda: slippy.core.polonsky_and_keer(
            product, start, contact.gap, contact.mean_pressure, [h, h], eps_0=tolerance, max_it=20_000
        ),
    )
    if failed:
        raise RuntimeError("not converged")
    total = contact.gap + product(pressure)
    return {
        "setup": setup,
        "solve": seconds,
        **contact.errors(pressure, total - total[pressure > 0].mean()),
    }


if __name__ == "__main__":
    main({"hertz": hertz, "rough": rough})
