"""Runs aspher; executed with the Python of its environment."""

from __future__ import annotations

from typing import Any

import aspher
import numpy as np
from square_window import best_of, main, rough_window, shear_errors, square_window


def hertz(side: int, fraction: float, tolerance: float, repeats: int) -> dict[str, Any]:
    """Nested grids with exact convolutions, set-up and solution in one call."""
    contact = square_window(side, fraction)
    found, result = _nested(contact.gap, contact.load, "fft", tolerance, repeats)
    errors = contact.errors(np.asarray(result.pressure), np.asarray(result.gap), result.approach)
    return {**found, **errors}


def rough(side: int, tolerance: float, repeats: int) -> dict[str, Any]:
    """Nested grids on the periodic operator, set-up and solution in one call."""
    contact = rough_window(side)
    found, result = _nested(contact.gap, contact.mean_pressure, "periodic", tolerance, repeats)
    pressure, gap = (np.asarray(field).reshape(side, side) for field in (result.pressure, result.gap))
    return {**found, **contact.errors(pressure, gap)}


def _nested(
    gap: Any, pressure: float, backend: str, tolerance: float, repeats: int
) -> tuple[dict[str, Any], Any]:
    """Return times and counts of a frictionless contact on nested grids, and the result.

    The preconditioner on the whole grid is asked for: the one taken by default below 40 % of contact
    needs up to twenty times as many iterations on fine grids.
    """
    side = len(gap)

    def solve() -> Any:
        return aspher.solve_nested(
            grid_size=side,
            gap=gap.ravel(),
            p_nominal=pressure,
            E_star=1.0,
            coarsest=min(64, side // 2),
            backend=backend,
            precond_engine="fft",
            tol=tolerance,
        )

    seconds, result = best_of(repeats, solve)
    if str(result.status) != "converged":
        raise RuntimeError(f"status {result.status} after {result.iterations} iterations")
    setup = seconds * result.timings["build"] / result.timings["total"]
    found = {
        "setup": setup,
        "solve": seconds - setup,
        "iterations": int(result.iterations),
        "products": int(result.matvec_count),
    }
    return found, result


def cattaneo_mindlin(
    side: int, fraction: float, tolerance: float, repeats: int, mu: float, share: float, poisson_ratio: float
) -> dict[str, Any]:
    """Press, then shear, both by force."""
    contact = square_window(side, fraction)

    def set_up() -> Any:
        solver = aspher.FrictionSolver(
            grid_size=side, E_star=1.0, nu=poisson_ratio, model=aspher.CoulombFriction(mu)
        )
        solver.set_gap(contact.gap.ravel())
        return solver

    setup, solver = best_of(1, set_up)
    press, pressed = best_of(1, lambda: solver.step(p_bar=contact.load, tol_normal=tolerance))
    if not pressed.converged:
        raise RuntimeError(f"press: {pressed.status_reason}")

    # with its own bounds, 1e-5 and 1e-2: with the tolerance of the comparison it does not converge
    force = (share * mu * contact.load, 0.0)
    shear, sheared = best_of(1, lambda: solver.step(q_bar=force, tol_normal=tolerance, max_iter=200_000))
    if not sheared.converged:
        reason = f"{sheared.status_reason} after {sheared.tangential_iters} iterations, {shear:.0f} s"
        raise RuntimeError(reason)
    stick = np.asarray(sheared.state) == 1
    return {
        "setup": setup,
        "press": press,
        "shear": shear,
        "iterations": int(sheared.tangential_iters),
        "residual": float(sheared.proj_residual),
        **shear_errors(contact, stick, np.asarray(sheared.qx), mu, share),
    }


if __name__ == "__main__":
    main({"hertz": hertz, "rough": rough, "cattaneo_mindlin": cattaneo_mindlin})
