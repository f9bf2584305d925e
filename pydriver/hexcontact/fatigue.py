"""The public name of `hexcontact.core.fatigue`."""

import sys

from .core import fatigue
from .core.fatigue import *  # noqa: F403

sys.modules[__name__] = fatigue
