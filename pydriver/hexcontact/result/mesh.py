"""The triangles of the lattice as a mesh in netCDF (UGRID-1.0)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..core.lattice import Lattice

if TYPE_CHECKING:
    import netCDF4

NODE, FACE, CORNER = "mesh_node", "mesh_face", "mesh_corner"  # dimensions
TOPOLOGY, FACE_NODES = "mesh", "mesh_face_nodes"
VARIABLES = (TOPOLOGY, "mesh_node_x", "mesh_node_y", FACE_NODES)
_CHUNK = 1 << 16  # triangles


def triangles(n_row: int, n_col: int) -> NDArray[np.int32]:
    """Return the nodes at the corners of each triangle of a window, counterclockwise, shape (n, 3).

    The diagonal from the second to the fourth corner halves each cell into triangles, on which tractions are
    linear. Node (row j, col i) has the number ``j*n_col + i``.
    """
    first = np.arange(n_row * n_col, dtype=np.int32).reshape(n_row, n_col)[:-1, :-1].ravel()
    right, up, across = first + 1, first + n_col, first + n_col + 1
    return np.stack([first, right, up, right, across, up], axis=1, dtype=np.int32).reshape(-1, 3)


def write_mesh(file: netCDF4.Dataset, lattice: Lattice) -> None:
    """Write the mesh of a window to an open file, unless it has one row or column only."""
    if min(lattice.shape) < 2:
        return
    faces = triangles(lattice.n_row, lattice.n_col)
    for name, size in ((NODE, lattice.size), (FACE, len(faces)), (CORNER, 3)):
        file.createDimension(name, size)
    about: dict[str, Any] = {
        "cf_role": "mesh_topology",
        "long_name": "triangles of the lattice; node = (row - row[0])*n_col + (col - col[0])",
        "topology_dimension": np.int32(2),
        "node_coordinates": "mesh_node_x mesh_node_y",
        "face_node_connectivity": FACE_NODES,
        "face_dimension": FACE,
    }
    add_column(file, TOPOLOGY, "i4", (), about, np.int32(0))
    packed: dict[str, Any] = {"compression": "zlib", "complevel": 1, "shuffle": True, "fletcher32": True}
    for axis, values in (("x", lattice.x.ravel()), ("y", lattice.y.ravel())):
        standard = {"standard_name": f"projection_{axis}_coordinate"}
        about = {**standard, "long_name": f"{axis} coordinate of the node", "units": "m"}
        chunks = [min(_CHUNK, lattice.size)]
        add_column(file, f"mesh_node_{axis}", "f8", (NODE,), about, values, chunksizes=chunks, **packed)
    about = {
        "cf_role": "face_node_connectivity",
        "long_name": "nodes at the corners of each triangle, counterclockwise",
        "start_index": np.int32(0),
    }
    chunks = [min(_CHUNK, len(faces)), 3]
    add_column(file, FACE_NODES, "i4", (FACE, CORNER), about, faces, chunksizes=chunks, **packed)


def add_column(
    file: netCDF4.Dataset,
    name: str,
    dtype: str,
    dims: tuple[str, ...],
    attributes: Mapping[str, Any],
    values: Any = None,
    **options: Any,
) -> netCDF4.Variable:
    """Add a variable with its attributes and values to a file; `options` go to ``createVariable``."""
    column = file.createVariable(name, dtype, dims, **options)
    column.setncatts(attributes)
    column.set_auto_maskandscale(False)  # which looks for more attributes
    if values is not None:
        column[...] = values
    return column
