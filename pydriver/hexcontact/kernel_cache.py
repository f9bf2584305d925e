"""The public name of `hexcontact.core.kernel_cache`."""

import sys

from .core import kernel_cache
from .core.kernel_cache import *  # noqa: F403

sys.modules[__name__] = kernel_cache
