"""Random surfaces that are self-affine between two wavelengths.

Power spectral density over the wave vector k: constant for 2π/longest <= k < 2π/rolloff, then falling like
k^(-2(1 + H)) up to 2π/shortest, zero elsewhere (B. N. J. Persson et al., J. Phys.: Condens. Matter 17, 2005,
R1). Amplitudes are Gaussian. Longer waves come first from the random numbers, so that a smaller `shortest`
adds waves and changes none.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import PrivateAttr

from ..arrays import Array
from ..errors import DeckError
from ..text import counted
from .kinds import Quantity, Whole
from .measured import TwoLengths
from .surfaces import PositiveLength, PositiveNumber, Surface, shape
from .table_base import Conflicts, meaning
from .units import NUMBER, readable

_POINTS = 8  # of the grid in the shortest wave; a cubic spline between them
_MOST_POINTS = 2**26
_OF_LONGEST = 4  # longest waves in the period of a surface of which none is given
_SUMMITS = 64  # points near which the highest is sought
_CLOSE = 1e-4  # of the distance of points: the highest is off by its square
_EVEN = 1e-9  # rounding of a wave of just the shortest or the longest length


@shape("rough")
class Rough(Surface):
    """A self-affine rough surface; heights count from its highest point."""

    one_spot: ClassVar[bool] = False
    wave: ClassVar[str] = "shortest"

    hurst: Annotated[float, Quantity(NUMBER, above=0, at_most=1)] = meaning(..., "Hurst exponent H")
    shortest: PositiveLength = meaning(..., "shortest wavelength")
    longest: PositiveLength = meaning(..., "longest wavelength")
    rolloff: PositiveLength | None = meaning(
        None, "wavelength above which the spectrum is constant; default: longest", '"50 um"'
    )
    rms_height: PositiveLength | None = meaning(None, "root mean square of the heights, or", '"0.5 um"')
    rms_slope: PositiveNumber | None = meaning(None, "root mean square of the slope", "0.05")
    seed: Annotated[int, Whole(0)] = meaning(0, "seed of the random numbers: another one, another surface")
    period: TwoLengths = meaning(
        None,
        "lengths along x and y after which it repeats; default: those of a window that repeats, "
        f"else {_OF_LONGEST} longest",
    )
    formula: ClassVar[str] = "h = Σ of random waves between shortest and longest"
    as_given: ClassVar[bool] = True
    _sides: tuple[float, float] | None = PrivateAttr(None)
    _rms: tuple[float, float] = PrivateAttr()

    @classmethod
    def conflicts(cls, data: Mapping[str, Any]) -> Conflicts:
        """Require one root mean square."""
        if ("rms_height" in data) == ("rms_slope" in data):
            found = "not both" if "rms_height" in data else "one of them"
            yield "rms_height", f"expected rms_height or rms_slope, {found}"

    def model_post_init(self, context: Any) -> None:
        """Refuse wavelengths in another order, and more waves than fit."""
        super().model_post_init(context)
        rolloff = self.longest if self.rolloff is None else self.rolloff
        if not self.shortest < rolloff <= self.longest:
            raise DeckError("shortest, rolloff, longest: expected wavelengths that increase")

    def repeating(self, sides: tuple[float, float] | None) -> Surface:
        """Return the surface over a window that repeats with two sides (m) along x and y; None: others."""
        if sides is None:
            raise DeckError(
                'a rough surface repeats along x and y only; expected grid.lattice = "rectangular", and '
                "grid.direction = 0"
            )
        if not self.period and self.longest > (1 + _EVEN) * max(sides):
            raise DeckError(
                f"a rough surface with longest = {readable(self.longest)} has no such waves in a window of "
                f"{' by '.join(map(readable, sides))} that repeats; expected at most its larger side"
            )
        other = self.model_copy()
        other.__dict__.pop("_spline", None)
        other._sides = self.period or sides
        return other

    @property
    def sides(self) -> tuple[float, float]:
        """Lengths (m) along x and y after which it repeats."""
        side = _OF_LONGEST * self.longest
        return self._sides or self.period or (side, side)

    @cached_property
    def _spline(self) -> tuple[Array, float]:
        """Coefficients of the cubic spline of its heights over the period (m), and its highest point."""
        shape = [2 * math.ceil(_POINTS * side / self.shortest / 2) for side in self.sides]
        if math.prod(shape) > _MOST_POINTS:
            raise DeckError(
                f"a rough surface with {shape[0]} x {shape[1]} points in its period of {self._in_words}; "
                f"expected at most {_MOST_POINTS:,}: a smaller period, or a longer shortest wave"
            )
        along, across = np.meshgrid(*(np.fft.fftfreq(n, 1 / n) for n in shape), indexing="ij")
        wave = np.hypot(along / self.sides[0], across / self.sides[1])
        half = (across > 0) | ((across == 0) & (along > 0))
        chosen = half & (wave * self.longest > 1 - _EVEN) & (wave * self.shortest < 1 + _EVEN)
        if not chosen.any():
            raise DeckError(f"no wave between shortest and longest fits in a period of {self._in_words}")
        k, m, n = (values[chosen] for values in (wave, along, across))
        order = np.lexsort((m, n, np.round(k / k.max(), 12)))
        corner = 1.0 / (self.longest if self.rolloff is None else self.rolloff)
        size = np.maximum(k / corner, 1.0) ** (-1.0 - self.hurst)
        random = np.random.default_rng(self.seed).standard_normal((len(k), 2)) @ [1.0, 1.0j]
        amplitude = np.empty(len(k), complex)
        amplitude[order] = size[order] * random
        # z = Re sum a exp(i k r): half of |a|^2 each
        power = np.abs(amplitude) ** 2 / 2
        if self.rms_height is not None:
            scale = self.rms_height / math.sqrt(power.sum())
        else:
            assert self.rms_slope is not None
            scale = self.rms_slope / (2 * math.pi * math.sqrt((k**2 * power).sum()))
        spectrum = np.zeros(shape, complex)
        spectrum[chosen] = scale * amplitude
        power *= scale**2
        self._rms = math.sqrt(power.sum()), 2 * math.pi * math.sqrt((k**2 * power).sum())
        heights = (np.fft.ifft2(spectrum) * math.prod(shape)).real
        from scipy.ndimage import spline_filter

        spline = np.asarray(spline_filter(heights, mode="grid-wrap"))
        return spline, _highest(spline, heights)

    def _height(self, x: Array, y: Array) -> Array:
        spline, highest = self._spline
        at = np.broadcast_arrays(x, y)
        places = [of * n / side for of, n, side in zip(at, spline.shape, self.sides, strict=True)]
        return np.asarray(highest - _between(spline, places))

    @property
    def rms(self) -> tuple[float, float]:
        """Root mean square of its heights (m) and of its slope."""
        self._spline  # noqa: B018 (computed here, cached)
        return self._rms

    @property
    def _in_words(self) -> str:
        return " by ".join(readable(side) for side in self.sides)

    def rows(self, apart: Callable[[float], float]) -> Iterator[str]:
        """Yield lines about its period, and its shortest wave beside the distance of nodes."""
        spacing = max(apart(0.0), apart(math.pi / 2))
        height, slope = self.rms
        yield f"repeats after {self._in_words}; rms height {readable(height)}, rms slope {slope:.3g}"
        shortest = counted(f"{self.shortest / spacing:.3g}", "spacing")
        yield f"shortest wave of {shortest}; the contact area needs 8 or more"


def _between(spline: Array, places: Sequence[Array]) -> Array:
    """Return values of a spline that repeats, at places counted in its points."""
    from scipy.ndimage import map_coordinates

    return np.asarray(map_coordinates(spline, places, order=3, mode="grid-wrap", prefilter=False))


def _highest(spline: Array, heights: Array) -> float:
    """Return the largest value of a spline, from the highest of its points on ever finer grids about them."""
    count = min(_SUMMITS, heights.size)
    top = np.argpartition(heights, -count, axis=None)[-count:]
    at = np.stack(np.unravel_index(top, heights.shape)).astype(float)
    highest, apart = -math.inf, 1.0
    around = np.stack(np.meshgrid(*2 * [np.linspace(-1.0, 1.0, 9)])).reshape(2, -1)
    while apart > _CLOSE:
        at = (at[:, :, None] + apart * around[:, None, :]).reshape(2, -1)
        found = _between(spline, list(at))
        highest, at = max(highest, float(found.max())), at[:, found.argsort()[-_SUMMITS:]]
        apart /= 4.0
    return highest
