"""The compiled core as Python objects: arrays are checked here, failures become exceptions."""

from .cores import limit_threads

limit_threads()
