# Procedures of the core and their records, which fortran/python/generate.py writes from procedures.toml.
from typing import Any

LIBRARY: str
BUILT: str

def __getattr__(name: str) -> Any: ...
