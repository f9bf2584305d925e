"""The version, as in meson.build."""

__version__ = "0.3.0"
