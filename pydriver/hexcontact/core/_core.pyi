from typing import Any

hc_f2py_normal: Any
hc_f2py_friction: Any
hc_f2py_states: Any
hc_f2py_influence: Any
hc_f2py_interior: Any
hc_f2py_cache: Any
hc_f2py_lattice: Any
hc_f2py_measures: Any
hc_f2py_edges: Any
hc_f2py_steps: Any
hc_f2py_wear: Any
hc_f2py_fatigue: Any
hc_flat: Any
