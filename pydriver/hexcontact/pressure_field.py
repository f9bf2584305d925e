"""Public names of tractions between the nodes, see `hexcontact.Result.traction_field`."""

from .core.edges import TractionField as TractionField
from .core.interpolation import linear as linear
from .result.interpolate import PressureField as PressureField
