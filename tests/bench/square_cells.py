"""Hertz and Cattaneo-Mindlin contact on square cells with uniform pressure, the elements of other codes.

Gives their errors at equal nodes where none of them is installed, and to tests. Conjugate gradients on
convolutions (Polonsky and Keer, Wear 231, 1999) until the residual of `HertzContact.errors` is small.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .square_window import Array, HertzContact, hemisphere, relative_difference, square_window


class Compliance:
    """Displacements of n x n square cells of side h by their pressures, effective modulus 1 (Love)."""

    def __init__(self, n: int, h: float) -> None:
        self.n = n
        places = np.fft.fftfreq(2 * n, 1 / (2 * n)) * h
        kernel = np.zeros((2 * n, 2 * n))
        for sign_x, sign_y in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
            x, y = np.meshgrid(places + sign_x * h / 2, places + sign_y * h / 2, indexing="ij")
            kernel += sign_x * sign_y * (x * np.arcsinh(y / abs(x)) + y * np.arcsinh(x / abs(y)))
        self.spectrum = np.fft.rfft2(kernel / np.pi)

    def __call__(self, pressure: Array) -> Array:
        size = 2 * self.n, 2 * self.n
        return np.fft.irfft2(self.spectrum * np.fft.rfft2(pressure, size), size)[: self.n, : self.n]


def pressure_under(compliance: Compliance, contact: HertzContact, load: float, tolerance: float) -> Array:
    """Return the pressures of the cells under a load."""
    total = load / contact.cell_area
    p = np.full_like(contact.gap, total / contact.gap.size)
    direction, before, again = np.zeros_like(p), 1.0, 0.0
    for _ in range(1000):
        inside = p > 0.0
        gap = compliance(p) + contact.gap
        gap -= gap[inside].mean()
        unbalanced = np.abs(p - np.maximum(0.0, p - gap / contact.self_compliance)).max()
        if unbalanced < tolerance * p.max():
            return p
        square = float((gap[inside] ** 2).sum())
        direction = np.where(inside, gap + again * square / before * direction, 0.0)
        moved = compliance(direction)
        moved -= moved[inside].mean()
        step = float((gap * direction)[inside].sum() / (moved * direction)[inside].sum())
        p = np.maximum(p - step * direction, 0.0)
        overlap = (p == 0.0) & (gap < 0.0)
        before, again = square, 0.0 if overlap.any() else 1.0
        p = np.where(overlap, -step * gap, p)
        p *= total / p.sum()
    raise RuntimeError("the pressures of square cells did not converge")


def errors(
    side: int, fraction: float, share: float, shift: Sequence[float] = (0.0, 0.0), tolerance: float = 1e-8
) -> tuple[float, float]:
    """Return the L2 errors of p, and of q under Q = share mu P for Poisson's ratio 0.

    Shear displacements are then those of a pressure, and q is mu times the difference of the pressures under
    P and under P - Q / mu, on any lattice (Jaeger, Ciavarella).
    """
    contact = square_window(side, fraction, shift)
    compliance = Compliance(side, 1.0 / side)
    p = pressure_under(compliance, contact, contact.load, tolerance)
    left = pressure_under(compliance, contact, (1.0 - share) * contact.load, tolerance)
    stick = hemisphere(contact.x, contact.y, contact.a * (1.0 - share) ** (1.0 / 3.0))
    exact = contact.pressure
    return relative_difference(p, exact), relative_difference(p - left, exact - stick)
