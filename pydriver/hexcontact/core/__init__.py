"""The compiled core as Python objects: arrays are checked here, failures become exceptions."""

from .memory import limit_threads

limit_threads()
