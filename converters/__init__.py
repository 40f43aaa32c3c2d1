"""Converters: a field or a mesh to and from every carrier, by formats that say what they keep.

In: files of meshes, points and density grids; a material field [SI]; a mesh with E, nu, rho a tet.
Out: the same in other files, for other programs, or as fields, voxels and values a tet.
Read: registry, mesh, grids, points, transfer, embedding, programs.

The public names load on first use: ``from autophyx_tet.converters import read_points``.
"""

from __future__ import annotations

from ..fem.registry import on_first_use

# Public name -> module that owns it.
_HOME = {
    "PointTable": "points.table",
    "read_points": "points.table",
    "write_points": "points.table",
    "standard_columns": "points.gaussians",
    "SH_C0": "points.gaussians",
    "splat_view": "points.views",
    "MESH_FORMATS": "registry",
    "Format": "registry",
    "Keeps": "registry",
    "MeshData": "mesh.meshdata",
    "save_reduced": "archives",
    "load_reduced": "archives",
    "DensityGrid": "grids",
    "read_density": "grids",
    "write_density": "grids",
    "read_mesh": "mesh.meshdata",
    "write_mesh": "mesh.meshdata",
    "field_from_points": "transfer",
    "sample_material": "transfer",
    "Driven": "embedding",
}
__all__ = [*_HOME]  # noqa: PLE0604
__getattr__, __dir__ = on_first_use(__name__, _HOME)
