"""The table [wear] of a deck: a cycle of the loads that wears the surfaces, repeated many times."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any

from .kinds import Quantity, Text, Whole, WordOr
from .table_base import Table, meaning
from .units import NUMBER, Dimension

COEFFICIENT = Dimension("a coefficient of wear", "m^2/N", '"1e-15 m^2/N"')
_SOLVED = 0.01  # residuals of a cycle over the tolerance of the depth: measured in docs/theory/wear.md
_Coefficient = Annotated[float, Quantity(COEFFICIENT, at_least=0, at_most=1)]


class Wear(Table):
    """Wear by Archard's law: each solved cycle represents `jump` cycles."""

    coefficient_1: _Coefficient = meaning(0.0, "coefficient of wear of body 1: depth over p times slip")
    coefficient_2: _Coefficient = meaning(0.0, "coefficient of wear of body 2")
    cycle: Annotated[str, Text()] = meaning(
        ..., "label of the segments at the end of [[load]] that are one cycle", '"fretting"'
    )
    cycles: Annotated[int, Whole(1, 10**12)] = meaning(
        ..., "number of cycles that wear the surfaces", "10000"
    )
    jump: Annotated[int | str, WordOr("auto", Whole(1, 10**12))] = meaning(
        "auto", "number of cycles for each solved cycle; auto: as many as `tolerance` allows", "50"
    )
    tolerance: Annotated[float, Quantity(NUMBER, at_least=1e-4, at_most=1)] = meaning(
        0.03,
        'jump = "auto": change of the worn depth by halving a jump, root mean square over the nodes that '
        "wear, as a share of the depth by which the largest pressure indents the surface at one node",
        "0.01",
    )

    @property
    def coefficient(self) -> float:
        """Coefficient of wear of both bodies together (m2/N)."""
        return self.coefficient_1 + self.coefficient_2

    def cycle_tolerance(self, tolerance: float) -> float:
        """Return the bound of the residuals in a cycle, where that of load steps is `tolerance`."""
        return max(tolerance, _SOLVED * self.tolerance)

    @classmethod
    def conflicts(cls, data: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        """Require a body that wears, and refuse a tolerance with a given jump."""
        if not any(data.get(f"coefficient_{number}") for number in (1, 2)):
            yield "coefficient_1", "expected a coefficient above 0 of one body at least"
        if "tolerance" in data and data.get("jump", "auto") != "auto":
            yield "tolerance", 'expected nothing, or jump = "auto"'
