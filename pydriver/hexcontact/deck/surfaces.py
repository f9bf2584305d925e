"""Surface shapes.

A shape has a height over the plane z = 0, measured away from the other body: zero where the shape would first
touch a flat, and infinite where it has no surface that could touch (outside a punch, beyond the rim of a true
sphere). Body 2 has mirrored coordinates, so that the gap is the sum of both heights.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from operator import attrgetter
from typing import Annotated, Any, ClassVar, Literal, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from pydantic import PrivateAttr, TypeAdapter
from pydantic.fields import FieldInfo

from ..arrays import Array, Mask
from ..errors import DeckError
from ..text import did_you_mean, quantity
from .faults import MISSING
from .kinds import (
    OR_NONE,
    Flag,
    Formula,
    HeightFormula,
    Kind,
    PowerCoefficient,
    Quantity,
    Read,
    Schema,
    Several,
    Word,
    refuse,
)
from .table_base import Argument, Conflicts, meaning, refuse_key
from .units import ANGLE, FORCE, LENGTH, NUMBER, Dimension, readable

_S = TypeVar("_S", bound="Surface")


def _coefficient_dimension(exponent: float) -> Dimension:
    """Return the dimension of the coefficient of a power law, a length to the power 1 - n."""
    power = f"{1.0 - exponent:g}"
    if power == "0":
        return NUMBER
    return Dimension(f"a coefficient in m^{power}", f"m^{power}", f'"0.1 mm^{power}"')


_Number = Read[float, float | str]
_Optional = Read[float | None, float | str | None]
_Pair = Read[tuple[float, float], Sequence[float | str]]
PositiveNumber = Annotated[_Number, Quantity(NUMBER, above=0)]
Radius = Annotated[_Number, Quantity(LENGTH, above=0)]
PositiveLength = Radius
OptionalLength = Annotated[_Optional, Quantity(LENGTH, above=0), OR_NONE]
_HOLLOW = '; a hollow is an ellipsoid: { shape = "ellipsoid", radius_x = "-5 mm", radius_y = "20 mm" }'
CurvatureRadius = Annotated[_Number, Quantity(LENGTH, above=0, remedy=_HOLLOW)]
SignedRadius = Annotated[_Number, Quantity(LENGTH, nonzero=True)]
LengthFromZero = Annotated[_Number, Quantity(LENGTH, at_least=0)]
Angle = Annotated[_Number, Quantity(ANGLE)]
Coefficient = Annotated[_Number, PowerCoefficient("m^(1-n)", _coefficient_dimension, "exponent")]
Point = Annotated[_Pair, Several(Quantity(LENGTH), "lengths", '["0.1 mm", "0 mm"]', count=2)]
_SMALL = Quantity(ANGLE, at_least=-0.1, at_most=0.1)
Tilt = Annotated[_Pair, Several(_SMALL, "angles", '["0.01 deg", "0 deg"]', count=2)]

# A node on the rim of a punch belongs to it, whatever the last bit of its coordinates.
_RIM = 1.0 + 1e-12
_LAST = 1.0 - 1e-9  # nodes less than a spacing from an end are the last ones
_ROUNDED = 1e-12  # of curvatures, over the largest
_WHOLE = 1e-6  # rounding of the number of waves in a period


class Surface(Argument):
    """A surface shape; `offset` moves it in the plane.

    Arguments are SI numbers or text with units, ``Sphere(radius=1e-3)`` or ``Sphere(radius="1 mm")``; an
    angle needs its unit.

    Raises
    ------
    DeckError
        If a key is unknown, missing or out of range.
    """

    shape: str = ""
    offset: Point = meaning((0.0, 0.0), "moves the shape in x and y")
    tilt: Tilt = meaning(
        (0.0, 0.0),
        "turns the shape about the axes through its center along x and y; the gap opens towards y, x",
    )
    moves: Annotated[bool, Flag()] = meaning(
        False, "true: bound to its rolling body, with which it passes through the contact"
    )

    formula: ClassVar[str] = ""
    """Height about the shape's own center, for the documentation."""
    as_given: ClassVar[bool] = False
    """Whether its heights are used unshifted, wherever it would touch first."""
    of_points: ClassVar[bool] = False
    """Whether it was measured."""
    one_spot: ClassVar[bool] = True
    """Whether it touches a flat in about an ellipse, for a spacing of "auto"."""
    wave: ClassVar[str] = ""
    """Key of its shortest wavelength."""
    others: ClassVar[Mapping[str, str]] = {}
    """The shapes that have a key, by keys that this one does not have."""

    @property
    def flat(self) -> bool:
        """Whether it is the plane z = 0."""
        return self.shape == "flat" and not any(self.tilt)

    @property
    def shapes(self) -> tuple[Surface, ...]:
        """The shapes that it is the sum of."""
        return (self,)

    def height(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return the height (m) at points of the plane.

        Parameters
        ----------
        x, y : array_like
            Coordinates (m), of one shape.

        Returns
        -------
        ndarray
            Heights of the same shape: >= 0, and inf where nothing can touch.
        """
        x, y = np.asarray(x, float) - self.offset[0], np.asarray(y, float) - self.offset[1]
        height = self._height(x, y)
        if any(self.tilt):
            height = height + math.tan(self.tilt[0]) * y + math.tan(self.tilt[1]) * x
        return height

    def beside(self, modulus: float) -> Surface:
        """Return the surface on bodies of a modulus E* (Pa), which few shapes depend on."""
        return self

    def repeating(self, sides: tuple[float, float] | None) -> Surface:
        """Return the surface over a window that repeats with two sides (m) along x and y; None: others."""
        return self

    @property
    def measured(self) -> tuple[Any, ...]:
        """The maps and profiles among its shapes (`Measured`)."""
        return tuple(filter(attrgetter("of_points"), self.shapes))

    def moved(self, by: ArrayLike) -> Surface:
        """Return the surface after its body has moved by a vector (m), with the shapes bound to it."""
        x, y = np.add(self.offset, by)
        return self.model_copy(update={"offset": (float(x), float(y))}) if self.moves else self

    def candidate(self, x: ArrayLike, y: ArrayLike) -> Mask:
        """Return where the shape has a surface that could touch (False outside a punch)."""
        return np.isfinite(self.height(x, y))

    @property
    def curvature(self) -> Array | None:
        """Curvature tensor (2, 2) in 1/m if the height is h = r . C r / 2 everywhere, else None."""
        return None

    @property
    def convex(self) -> bool:
        """Whether it surely curves away from the other body everywhere; two such ones touch in one place."""
        if self.curvature is None:
            return self.one_spot and not (self.as_given or self.measured)
        return bool(np.linalg.eigvalsh(self.curvature).min() >= -_ROUNDED * np.abs(self.curvature).max())

    @property
    def reach(self) -> float:
        """Distance (m) from the center beyond which nothing can touch; infinite for most shapes."""
        return math.inf

    @property
    def detail(self) -> float:
        """Size (m) of details about its center where it may touch; 0: none."""
        return 0.0

    def rows(self, apart: Callable[[float], float]) -> Iterator[str]:
        """Yield lines about its data, beside the distance (m) of nodes along a direction (rad)."""
        yield from ()

    def _height(self, x: Array, y: Array) -> Array:
        raise NotImplementedError

    @classmethod
    def meant(cls, key: str) -> str:
        """Return another shape, or a known key, that an unknown key may mean."""
        return cls.others.get(key) or super().meant(key)

    def written(self, defaults: bool = True) -> dict[str, Any]:
        """Return the keys, always with the shape."""
        return {"shape": self.shape, **super().written(defaults)}

    @classmethod
    def __get_pydantic_json_schema__(cls, core: Any, handler: Any) -> Schema:
        """Describe and require the keys."""
        schema = super().__get_pydantic_json_schema__(core, handler)
        required = [name for name, info in cls.known_keys().items() if info.is_required()]
        title = cls.model_fields["shape"].default
        return schema | {"title": title, "description": cls.formula, "required": ["shape", *required]}


SHAPES: dict[str, type[Surface]] = {}
"""The shapes by their words in decks."""


def shape(word: str) -> Callable[[type[_S]], type[_S]]:
    """Register a surface under the word of a deck."""
    this: Any = Literal[word]

    def register(surface: type[_S]) -> type[_S]:
        surface.model_fields["shape"] = FieldInfo.from_annotated_attribute(this, word)
        SHAPES[word] = surface
        return surface

    return register


@shape("flat")
class Flat(Surface):
    """A plane."""

    as_given: ClassVar[bool] = True
    one_spot: ClassVar[bool] = False

    formula: ClassVar[str] = "h = 0"

    @property
    def curvature(self) -> Array:
        """Zero."""
        return np.zeros((2, 2))

    def _height(self, x: Array, y: Array) -> Array:
        return np.zeros(np.broadcast_shapes(x.shape, y.shape))


@shape("sphere")
class Sphere(Surface):
    """A sphere, as the paraboloid of the theory of Hertz, or as the true arc."""

    radius: CurvatureRadius = meaning(..., "radius R")
    exact: Annotated[bool, Flag()] = meaning(False, "take the true arc, not the parabola")
    formula: ClassVar[str] = "h = r²/(2R); exact: h = R − √(R² − r²) for r ≤ R"

    @property
    def curvature(self) -> Array | None:
        """Identity / R; None for the true arc."""
        return None if self.exact else np.eye(2) / self.radius

    @property
    def reach(self) -> float:
        """The radius for the true arc, else infinite."""
        return self.radius if self.exact else math.inf

    def _height(self, x: Array, y: Array) -> Array:
        square = x * x + y * y
        if not self.exact:
            return square / (2 * self.radius)
        inside = square <= (self.radius * _RIM) ** 2
        root = np.sqrt(np.maximum(self.radius**2 - square, 0.0))
        return np.where(inside, square / (self.radius + root), np.inf)


@shape("paraboloid")
class Paraboloid(Surface):
    """A surface with two principal radii of curvature."""

    radius_x: CurvatureRadius = meaning(..., "radius of curvature R₁ along the first axis (x if angle is 0)")
    radius_y: CurvatureRadius = meaning(..., "radius of curvature R₂ across it")
    angle: Angle = meaning(0.0, "angle of the first axis, from x towards y")
    formula: ClassVar[str] = "h = s²/(2R₁) + t²/(2R₂), s along and t across the first axis"

    @property
    def curvature(self) -> Array:
        """Sum of the two rank-one tensors of the axes."""
        first, across = _axes(self.angle)
        return np.outer(first, first) / self.radius_x + np.outer(across, across) / self.radius_y

    def _height(self, x: Array, y: Array) -> Array:
        (a, b), _ = _axes(self.angle)
        return (a * x + b * y) ** 2 / (2 * self.radius_x) + (a * y - b * x) ** 2 / (2 * self.radius_y)


@shape("ellipsoid")
class Ellipsoid(Paraboloid):
    """A surface with two principal radii of curvature, of which any may be that of a hollow."""

    radius_x: SignedRadius = meaning(
        ..., "radius of curvature R₁ along the first axis (x if angle is 0), negative where hollow", '"-5 mm"'
    )
    radius_y: SignedRadius = meaning(
        ..., "radius of curvature R₂ across it, negative where hollow", '"20 mm"'
    )


@shape("cylinder")
class Cylinder(Surface):
    """A parabolic cylinder with its axis in the plane."""

    radius: CurvatureRadius = meaning(..., "radius R")
    angle: Angle = meaning(0.0, "angle of its axis, from x towards y")
    formula: ClassVar[str] = "h = t²/(2R), t the distance from the axis"
    others: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("length", "profile", "chamfer", "crown_radius", "design_load"),
        'shape = "roller", which has a length',
    )

    @property
    def curvature(self) -> Array:
        """Rank-one tensor across the axis."""
        _, across = _axes(self.angle)
        return np.outer(across, across) / self.radius

    def _height(self, x: Array, y: Array) -> Array:
        _, (a, b) = _axes(self.angle)
        return (a * x + b * y) ** 2 / (2 * self.radius)


@shape("cone")
class Cone(Surface):
    """A cone with its tip towards the other body."""

    slope: PositiveNumber = meaning(..., "slope m = tangent of the angle between cone and plane")
    formula: ClassVar[str] = "h = m r"

    def _height(self, x: Array, y: Array) -> Array:
        return self.slope * np.hypot(x, y)


@shape("power")
class Power(Surface):
    """A body of revolution whose profile is a power of the radius."""

    exponent: Annotated[float, Quantity(NUMBER, above=0, at_most=100)] = meaning(..., "exponent n")
    coefficient: Coefficient = meaning(..., "coefficient C")
    formula: ClassVar[str] = "h = C rⁿ"

    @property
    def convex(self) -> bool:
        """Whether it has no cusp."""
        return self.exponent >= 1.0

    def _height(self, x: Array, y: Array) -> Array:
        return self.coefficient * np.hypot(x, y) ** self.exponent


@shape("punch")
class Punch(Surface):
    """The flat end of a circular punch; nothing can touch outside it."""

    radius: Radius = meaning(..., "radius a of the flat end")
    formula: ClassVar[str] = "h = 0 for r ≤ a, nothing beyond"
    others: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys(
            ("width", "height", "length", "side", "sides"),
            'shape = "rectangular_punch", which has width and length',
        ),
        "edge_radius": 'shape = "rounded_punch" or "rectangular_punch"',
    }

    @property
    def reach(self) -> float:
        """The radius."""
        return self.radius

    def _height(self, x: Array, y: Array) -> Array:
        return np.where(np.hypot(x, y) <= self.radius * _RIM, 0.0, np.inf)


@shape("rounded_punch")
class RoundedPunch(Surface):
    """A flat punch whose edge is a parabolic fillet."""

    flat_radius: LengthFromZero = meaning(..., "radius b of the flat middle")
    edge_radius: Radius = meaning(..., "radius of curvature R of the rounded edge")
    formula: ClassVar[str] = "h = (r − b)²/(2R) for r > b, else 0"

    def _height(self, x: Array, y: Array) -> Array:
        return np.maximum(np.hypot(x, y) - self.flat_radius, 0.0) ** 2 / (2 * self.edge_radius)


@shape("rectangular_punch")
class RectangularPunch(Surface):
    """The flat end of a rectangular punch; its edges are parabolic fillets, or nothing can touch outside."""

    width: Radius = meaning(..., "side of the flat end along x")
    length: Radius = meaning(..., "side of the flat end along y")
    edge_radius: OptionalLength = meaning(
        None, "radius of curvature R of the edges; sharp if absent", '"1 mm"'
    )
    formula: ClassVar[str] = (
        "h = (dx² + dy²)/(2R) at distances dx, dy beyond the sides; sharp: nothing beyond"
    )

    @property
    def reach(self) -> float:
        """The half diagonal of a sharp one, else infinite."""
        return math.inf if self.edge_radius else math.hypot(self.width, self.length) / 2

    def _height(self, x: Array, y: Array) -> Array:
        beyond = [np.maximum(np.abs(at) - side / 2, 0.0) for at, side in ((x, self.width), (y, self.length))]
        if self.edge_radius:
            return (beyond[0] ** 2 + beyond[1] ** 2) / (2 * self.edge_radius)
        slack = (_RIM - 1.0) * max(self.width, self.length)
        return np.where(np.maximum(*beyond) <= slack, 0.0, np.inf)


@shape("torus")
class Torus(Surface):
    """A ring that lies on the plane: it touches along a circle."""

    one_spot: ClassVar[bool] = False

    ring_radius: Radius = meaning(..., "radius of the circle")
    radius: CurvatureRadius = meaning(..., "radius R of the section")
    formula: ClassVar[str] = "h = (r − ring_radius)²/(2R)"

    @property
    def detail(self) -> float:
        """Its circle."""
        return 1.1 * self.ring_radius

    def _height(self, x: Array, y: Array) -> Array:
        return (np.hypot(x, y) - self.ring_radius) ** 2 / (2 * self.radius)


@shape("waviness")
class Waviness(Surface):
    """A wave in one direction."""

    one_spot: ClassVar[bool] = False
    wave: ClassVar[str] = "wavelength"

    amplitude: Radius = meaning(..., "amplitude a")
    wavelength: Radius = meaning(..., "wavelength λ")
    angle: Angle = meaning(0.0, "direction of the wave, from x towards y")
    formula: ClassVar[str] = "h = a (1 − cos 2πs/λ), s along the direction"

    def repeating(self, sides: tuple[float, float] | None) -> Surface:
        """Return itself; DeckError if a side of the window is no whole number of its waves."""
        for name, side, share in zip("xy", sides or (), _axes(self.angle)[0], strict=False):
            waves = abs(side * float(share)) / self.wavelength
            if abs(waves - round(waves)) > _WHOLE:
                raise DeckError(
                    f"the waviness does not repeat with the window: its side in {name} has {waves:.6g} "
                    "waves; expected a whole number of them"
                )
        return self

    def _height(self, x: Array, y: Array) -> Array:
        (a, b), _ = _axes(self.angle)
        return self.amplitude * (1.0 - np.cos(2.0 * math.pi / self.wavelength * (a * x + b * y)))


@shape("dent")
class Dent(Surface):
    """A round dent in a plane, with a rim of displaced material."""

    one_spot: ClassVar[bool] = False

    depth: Radius = meaning(..., "depth d")
    radius: Radius = meaning(..., "radius R of the dent")
    rim: LengthFromZero = meaning(0.0, "height of the rim, R/2 wide about the dent")
    formula: ClassVar[str] = "h = d (1 − r²/R²)² for r < R; −rim sin² 2π(r/R − 1) for R < r < 1.5 R"

    @property
    def detail(self) -> float:
        """Its rim."""
        return 1.5 * self.radius

    def _height(self, x: Array, y: Array) -> Array:
        place = np.hypot(x, y) / self.radius
        inside = self.depth * np.maximum(1.0 - place**2, 0.0) ** 2
        rim = self.rim * np.sin(2.0 * math.pi * (place - 1.0)) ** 2
        return inside - np.where(abs(place - 1.25) < 0.25, rim, 0.0)


PROFILES = ("sharp", "chamfer", "crown", "logarithmic")


@shape("roller")
class Roller(Surface):
    """A parabolic cylinder of a length, with its axis in the plane."""

    radius: CurvatureRadius = meaning(..., "radius R")
    length: Radius = meaning(..., "length l; nothing can touch beyond the ends")
    angle: Angle = meaning(0.0, "angle of its axis, from x towards y")
    profile: Annotated[str, Word(PROFILES)] = meaning("sharp", "profile f along the axis")
    chamfer: OptionalLength = meaning(None, "length of the chamfers at 45°", '"0.2 mm"')
    crown_radius: Annotated[_Optional, Quantity(LENGTH, above=0, remedy=_HOLLOW), OR_NONE] = meaning(
        None, "radius of curvature along the axis", '"1 m"'
    )
    design_load: Annotated[_Optional, Quantity(FORCE, above=0), OR_NONE] = meaning(
        None, "load P under which the pressure of a logarithmic profile is even along the axis", '"1 kN"'
    )
    formula: ClassVar[str] = (
        "h = t²/(2R) + f(s), s along the axis; crown: s²/(2 crown_radius); logarithmic: "
        "−P/(πE*l) ln(1 − (1 − 0.6065 b/l)(2s/l)²), b the half-width of the contact on a flat"
    )
    _modulus: float = PrivateAttr(0.0)

    @classmethod
    def conflicts(cls, data: Mapping[str, Any]) -> Conflicts:
        """Require the key of the profile, and no other."""
        needed = {"chamfer": "chamfer", "crown": "crown_radius", "logarithmic": "design_load"}
        profile = data.get("profile", "sharp")
        for name, key in needed.items():
            if name == profile and key not in data:
                yield key, f'missing; expected it for profile = "{name}"'
            elif name != profile and key in data:
                yield key, f'expected it for profile = "{name}" only'

    def model_post_init(self, context: Any) -> None:
        """Refuse chamfers that meet."""
        super().model_post_init(context)
        if self.chamfer and self.chamfer >= self.reach:
            half = readable(self.reach)
            raise DeckError(f"chamfer: expected less than {half}, half the length")

    @property
    def reach(self) -> float:
        """Half of the length."""
        return self.length / 2

    def plane_contact(self, modulus: float, load: float) -> tuple[float, float]:
        """Return half-width (m) and largest pressure (Pa) of plane contact with a flat under P/l.

        b² = 4 P R/(π E* l), p0 = 2 P/(π b l) (K. L. Johnson, Contact Mechanics, 1985, section 4.2).
        """
        by_length = load / self.length
        half_width = math.sqrt(4.0 * by_length * self.radius / (math.pi * modulus))
        return half_width, 2.0 * by_length / (math.pi * half_width)

    @property
    def design_fault(self) -> str:
        """The fault of a design load under which contact is wider than long; empty without one."""
        load = self.design_load or 0.0
        half_width, _ = self.plane_contact(self._modulus, load) if load else (0.0, 0.0)
        if half_width <= self.reach:
            return ""
        most = quantity(load * (self.reach / half_width) ** 2, "N")
        return f"expected at most {most}, under which contact on a flat is as wide as long"

    def share(self, x: Array, y: Array, basis: Array) -> Array:
        """Return the part of a cell of a lattice basis that each node bears: 1 but for the last ones.

        The last node before an end bears the length up to it; one on a chamfer none, its corner is an end.
        """
        axis, _ = _axes(self.angle)
        center = np.asarray(self.offset, float)
        left = 0.5 * self.length - np.abs(axis[0] * (x - center[0]) + axis[1] * (y - center[1]))
        if self.chamfer:
            return np.where(left >= self.chamfer - self.length / 2 * (_RIM - 1.0), 1.0, 0.0)
        cells = left / np.abs(basis @ axis).max()
        return np.where(cells < _LAST, np.maximum(cells, 0.0) + 0.5, 1.0)

    def beside(self, modulus: float) -> Surface:
        """Return the roller with the logarithmic profile of the modulus."""
        other = self.model_copy()
        other._modulus = modulus
        return other

    def _height(self, x: Array, y: Array) -> Array:
        (a, b), _ = _axes(self.angle)
        along, across = np.abs(a * x + b * y), a * y - b * x
        place = 2.0 * along / self.length
        drop = np.zeros(np.shape(along))
        if self.chamfer:
            drop = np.maximum(along - self.length / 2 + self.chamfer, 0.0)
        elif self.crown_radius:
            drop = along**2 / (2 * self.crown_radius)
        elif self.design_load:
            if not self._modulus:
                raise DeckError("design_load: its profile follows from the moduli of the bodies, in a case")
            by_length = self.design_load / self.length
            width, _ = self.plane_contact(self._modulus, self.design_load)
            # the end drops by (P/(pi E* l)) ln(3.2976 l/2b): Johns and Gohar, Tribology Int. 14, 1981
            end = 1.0 - 2.0 * width / (3.2976 * self.length)
            drop = -by_length / (math.pi * self._modulus) * np.log(1.0 - end * np.minimum(place, 1.0) ** 2)
        return np.where(place <= _RIM, across**2 / (2 * self.radius) + drop, np.inf)


@shape("formula")
class FormulaSurface(Surface):
    """Any height, such as that of several pads."""

    as_given: ClassVar[bool] = True

    expression: Annotated[str, HeightFormula()] = meaning(
        ..., "height h in m, of x and y in m", '"min(x**2, (x - 1e-3)**2)/2e-2 + y**2/2e-2"'
    )
    formula: ClassVar[str] = "h = h(x, y), as the formula gives it"

    @property
    def curvature(self) -> Array | None:
        """That of a formula that is a quadratic form; None for others."""
        return _quadratic_form(self.expression)

    def _height(self, x: Array, y: Array) -> Array:
        x, y = np.broadcast_arrays(x, y)
        return Formula(self.expression)(x, y) + np.zeros(x.shape)


@functools.lru_cache(64)
def _quadratic_form(expression: str) -> Array | None:
    """Return C of a formula that is the polynomial h = r . C r / 2; None of others."""
    from numpy.polynomial import Polynomial

    angles = 0.1 + np.linspace(0.0, 2.0 * math.pi, 12)
    cosines, sines = np.cos(angles), np.sin(angles)
    along = []  # coefficients of r²
    for a, b in zip(cosines, sines, strict=True):
        try:
            height = Formula(expression).of(x=Polynomial([0.0, a]), y=Polynomial([0.0, b]))
            powers = (height + Polynomial([0.0])).coef
        except (ArithmeticError, TypeError, ValueError):  # no polynomial
            return None
        if len(powers) > 3 or powers[:2].any() or not np.isfinite(powers).all():
            return None
        along.append(powers[2:].sum())
    forms = np.stack([0.5 * cosines**2, cosines * sines, 0.5 * sines**2], axis=1)
    found = np.linalg.lstsq(forms, along, rcond=None)[0]
    return np.array([[found[0], found[1]], [found[1], found[2]]])


def _axes(angle: float) -> tuple[Array, Array]:
    """Return the unit vectors along and across an axis at `angle` from x."""
    along = np.array([math.cos(angle), math.sin(angle)])
    return along, np.array([-along[1], along[0]])


_REFUSED = {
    "heights": 'expected shape = "map" for heights over x and y, or "profile"',
    "python": "the gap of this case was given in Python and is not in the deck; run the script it came from",
}


class SurfaceSum(Surface):
    """Several shapes on one body, whose heights add up."""

    as_given: ClassVar[bool] = True

    parts: tuple[Surface, ...] = ()

    @property
    def shapes(self) -> tuple[Surface, ...]:
        """Its parts."""
        return self.parts

    @property
    def reach(self) -> float:
        """The smallest of all."""
        return min(part.reach for part in self.parts)

    def height(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return the sum of the heights (m)."""
        return np.asarray(sum(part.height(x, y) for part in self.parts))

    def beside(self, modulus: float) -> Surface:
        """Return the sum of shapes of the modulus."""
        return SurfaceSum(parts=tuple(part.beside(modulus) for part in self.parts))

    def moved(self, by: ArrayLike) -> Surface:
        """Return the sum of the moved shapes."""
        return SurfaceSum(parts=tuple(part.moved(by) for part in self.parts))

    def repeating(self, sides: tuple[float, float] | None) -> Surface:
        """Return the sum of shapes over a window that repeats."""
        return SurfaceSum(parts=tuple(part.repeating(sides) for part in self.parts))

    def written(self, defaults: bool = True) -> Any:
        """Return the shapes with their keys."""
        return [part.written(defaults) for part in self.parts]

    def __str__(self) -> str:
        """Name the shapes."""
        return " + ".join(map(str, self.parts))


class SurfaceKind(Kind):
    """A surface: one of the shapes as an inline table, or a `Surface` of Python."""

    expected = 'a table such as { shape = "sphere", radius = "1 mm" }'

    def written(self, value: Surface) -> dict[str, Any]:
        """Return the shape with its keys."""
        return value.written()

    def __get_pydantic_json_schema__(self, core: Any, handler: Any) -> Schema:
        """Describe each of the shapes."""
        shapes = SHAPES.values()
        one = {"oneOf": [s.__get_pydantic_json_schema__(s.__pydantic_core_schema__, handler) for s in shapes]}
        return {"anyOf": [one, {"type": "array", "items": one, "minItems": 1}]}

    def _parse(self, value: object) -> Surface:
        if isinstance(value, Surface):
            return value
        if isinstance(value, list | tuple) and value:
            first, *others = _PARTS.validate_python(list(value))  # which numbers their faults
            return SurfaceSum(parts=(first, *others)) if others else first
        if not isinstance(value, Mapping):
            refuse(f"expected {self.expected}")
        shape = value.get("shape")
        if not isinstance(shape, str) or shape not in SHAPES:
            expected = f"expected {Word(tuple(SHAPES)).expected}"
            if shape is None:
                refuse_key("shape", MISSING, f"missing; {expected}")
            known = expected + did_you_mean(shape, SHAPES)
            refuse_key("shape", shape, _REFUSED.get(str(shape), known))
        try:
            return SHAPES[shape](**dict(zip(map(str, value), value.values(), strict=True)))
        except DeckError as error:
            # pydantic merges the inner error, with its keys, into that of the enclosing deck.
            raise (error.__cause__ or error) from None


_PARTS: TypeAdapter[list[Surface]] = TypeAdapter(list[Annotated[Surface, SurfaceKind()]])
