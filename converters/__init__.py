"""Converters: a field or a mesh to and from every carrier, by formats that say what they keep.

In: files of meshes, points and density grids; a material field [SI]; a mesh with E, nu, rho a tet.
Out: the same in other files, for other programs, or as fields, voxels and values a tet.
Read: registry, mesh, grids, points, material_sampling, carriers, embedding, driving, programs.

The public names load on first use: ``from autophyx_tet.converters import read_points``.
"""

from __future__ import annotations

from ..fem.public_names import on_first_use

# Public name -> module that owns it.
_HOME = {
    "PointTable": "points.table",
    "read_points": "points.point_file",
    "write_points": "points.point_file",
    "standard_columns": "points.splats.gaussians",
    "SH_C0": "points.splats.gaussians",
    "splat_view": "points.splats.splat_views",
    "MESH_FORMATS": "registry",
    "Format": "registry",
    "Keeps": "registry",
    "MeshData": "mesh.meshdata",
    "save_reduced": "reduced_archive",
    "load_reduced": "reduced_archive",
    "DensityGrid": "grids.density",
    "read_density": "grids.density_file",
    "write_density": "grids.density_file",
    "read_mesh": "mesh.mesh_file",
    "write_mesh": "mesh.mesh_file",
    "field_from_points": "field_sources",
    "sample_material": "material_sampling",
    "Driven": "driving",
}
__all__ = [*_HOME]  # noqa: PLE0604  # pyright: ignore[reportUnsupportedDunderAll]
__getattr__, __dir__ = on_first_use(__name__, _HOME)
