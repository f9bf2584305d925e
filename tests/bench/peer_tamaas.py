"""Runs tamaas; executed with the Python of its environment."""

from __future__ import annotations

from typing import Any

import numpy as np
import tamaas
from square_window import best_of, main, rough_window, square_window


def hertz(side: int, fraction: float, tolerance: float, repeats: int) -> dict[str, Any]:
    """Polonsky and Keer's conjugate gradients (Rey's form) on the padded, non-periodic operator."""
    tamaas.set_log_level(tamaas.LogLevel.error)
    contact = square_window(side, fraction)
    surface = -contact.gap
    kept: dict[str, Any] = {}

    def set_up() -> Any:
        model = tamaas.ModelFactory.createModel(tamaas.model_type.basic_2d, [1.0, 1.0], [side, side])
        model.E, model.nu = 1.0, 0.0
        tamaas.ModelFactory.registerNonPeriodic(model, "dcfft")
        solver = tamaas.PolonskyKeerRey(model, surface, tolerance)
        solver.setIntegralOperator("dcfft")
        solver.max_iter = 20_000
        kept["model"] = model
        return solver

    def solve() -> Any:
        kept["model"].traction[:] = 0.0
        return solver.solve(contact.load)

    setup, solver = best_of(repeats, set_up)
    seconds, error = best_of(repeats, solve)
    model = kept["model"]
    pressure = np.array(model.traction)
    model.operators["dcfft"](model.traction, model.displacement)
    total = contact.gap + np.array(model.displacement)
    approach = float(total[pressure > 0].mean())
    return {
        "setup": setup,
        "solve": seconds,
        "own_residual": float(error),
        **contact.errors(pressure, total - approach, approach),
    }


def rough(side: int, tolerance: float, repeats: int) -> dict[str, Any]:
    """The same iteration on the periodic operator."""
    tamaas.set_log_level(tamaas.LogLevel.error)
    contact = rough_window(side)
    kept: dict[str, Any] = {}

    def set_up() -> Any:
        model = tamaas.ModelFactory.createModel(tamaas.model_type.basic_2d, [1.0, 1.0], [side, side])
        model.E, model.nu = 1.0, 0.0
        solver = tamaas.PolonskyKeerRey(model, -contact.gap, tolerance)
        solver.max_iter = 20_000
        kept["model"] = model
        return solver

    def solve() -> Any:
        kept["model"].traction[:] = 0.0
        return solver.solve(contact.mean_pressure)

    setup, solver = best_of(repeats, set_up)
    seconds, error = best_of(repeats, solve)
    pressure, total = np.array(kept["model"].traction), contact.gap + np.array(kept["model"].displacement)
    gap = total - total[pressure > 0].mean()
    return {"setup": setup, "solve": seconds, "own_residual": float(error), **contact.errors(pressure, gap)}


if __name__ == "__main__":
    main({"hertz": hertz, "rough": rough})
