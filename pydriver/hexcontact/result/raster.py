"""Small pictures over a plane."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array

# Colors of zones in all pictures, which differ in black and white, too.
STICK, SLIP = "#0072b2", "#f0c05a"


@dataclass(frozen=True)
class Plane:
    """Pixels over a rectangle of the plane, x_min, x_max, y_min, y_max (m), `longer` on its longer side."""

    limits: tuple[float, float, float, float]
    longer: int

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        x0, x1, y0, y1 = self.limits
        pixel = max(x1 - x0, y1 - y0) / self.longer
        return max(1, round((y1 - y0) / pixel)), max(1, round((x1 - x0) / pixel))

    @cached_property
    def points(self) -> tuple[Array, Array]:
        """Centers of the pixels, from the upper left one on, m."""
        x0, x1, y0, y1 = self.limits
        rows, cols = self.shape
        x = x0 + (np.arange(cols) + 0.5) * (x1 - x0) / cols
        y = y1 - (np.arange(rows) + 0.5) * (y1 - y0) / rows
        x, y = np.meshgrid(x, y)
        return x, y


def png_of(gray: NDArray[np.uint8]) -> str:
    """Return a picture, gray or in colors, as PNG in base64."""
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(gray).save(file, format="PNG", compress_level=9)
    return base64.b64encode(file.getvalue()).decode()
