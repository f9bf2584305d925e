"""The public name of the pressure between the nodes, of `hexcontact.result.interpolate`."""

from .result.interpolate import PressureField as PressureField
from .result.interpolate import linear as linear
