"""The compiled core as Python objects: arrays are checked here, failures become exceptions."""
