"""The public name of the pressure between the nodes, of `hexcontact.result.interpolate`."""

from .core.interpolation import linear as linear
from .result.interpolate import PressureField as PressureField
