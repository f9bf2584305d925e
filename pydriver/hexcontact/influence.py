"""The public name of `hexcontact.core.influence`."""

import sys

from .core import influence
from .core.influence import *  # noqa: F403

sys.modules[__name__] = influence
