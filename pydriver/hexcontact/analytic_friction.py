"""The earlier name of `hexcontact.analytic.friction`."""

from .analytic.friction import *  # noqa: F403
