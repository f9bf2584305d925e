"""The public name of `hexcontact.deck.surfaces`."""

import sys

from .deck import surfaces
from .deck.surfaces import *  # noqa: F403

sys.modules[__name__] = surfaces
