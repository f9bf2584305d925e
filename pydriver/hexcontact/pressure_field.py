"""Public names of tractions between the nodes, see `hexcontact.Result.traction_field`."""

from .core.edges import TractionField as TractionField
from .core.lattice import linear as linear
from .result.step import PressureField as PressureField
