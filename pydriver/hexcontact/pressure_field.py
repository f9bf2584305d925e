"""The public name of `hexcontact.result.pressure_field`."""

import sys

from .result import pressure_field
from .result.pressure_field import *  # noqa: F403

sys.modules[__name__] = pressure_field
