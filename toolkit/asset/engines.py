"""The native engines, as tasks of the guarded child process: arrays in, arrays out."""

from __future__ import annotations

import ctypes
import importlib
import sys
from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np

from .decimate import decimated
from .triangles import Triangles

Arrays = dict[str, np.ndarray]


class TooLong(RuntimeError):
    """What would take longer than the caller wants to wait; known before it is begun."""


# Triangles left alone by decimation from which fTetWild's own simplification pays: a non-manifold
# pig of 18,000 takes 56 s with it and more than 200 s without, an elephant of 5,800 36 s and 41 s.
MANY = 10_000


def _stage(words: str) -> None:
    """Tell the parent what is being done: it reads these lines."""
    sys.stdout.write(f"stage: {words}\n")
    sys.stdout.flush()


def tetwild(
    arrays: Arrays,
    *,
    edge_length_rel: float,
    epsilon_rel: float,
    stop_energy: float,
    decimate_rel: float,
    most_triangles: int | None = None,
) -> Arrays:
    """Fill the box around ``points`` (n, 3), ``faces`` (m, 3) of about unit size with fTetWild.

    The surface is first decimated within ``decimate_rel``, then simplified by fTetWild unless it is
    one clean piece. Returns ``points`` and positively oriented ``tets`` that conform to it. Raises
    ``TooLong`` where more than ``most_triangles`` are left for fTetWild.
    """
    _stage("decimating")
    given = Triangles(arrays["points"], arrays["faces"])
    surface, pieces, left_alone = decimated(given, decimate_rel)
    if most_triangles is not None and len(surface.faces) > most_triangles:
        raise TooLong(f"{len(surface.faces):,} triangles are more than a minute of fTetWild")
    # Half of this process's start, and needed for pictures only: pytetwild does without.
    sys.modules.setdefault("pyvista", ModuleType("pyvista"))
    pytetwild: Any = importlib.import_module("pytetwild")  # its stubs want narrower arrays

    _stage("tetrahedralizing")
    sizing = {name: array for name, array in arrays.items() if name.startswith("bg_")}
    points, tets = pytetwild.tetrahedralize(
        surface.points,
        surface.faces.astype(np.int32),
        edge_length_fac=edge_length_rel,
        epsilon=epsilon_rel,
        stop_energy=stop_energy,
        # Pieces lie near and cross each other: there it saves up to three quarters of the time (a
        # bench 137 s to 68 s, a television 82 s to 25 s); on one smooth scan it doubles it.
        simplify=pieces > 1 or left_alone > MANY,
        disable_filtering=True,
        num_threads=1,
        vtk_ordering=True,
        **sizing,
    )
    return {"points": np.asarray(points, np.float64), "tets": np.asarray(tets, np.int32)}


def alpha_wrap(arrays: Arrays, *, alpha_rel: float, offset_rel: float) -> Arrays:
    """Closed surface around ``points``, ``faces`` by alpha wrapping; needs pymeshlab.

    ``alpha_rel`` and ``offset_rel`` are shares of the diagonal of the bounding box.
    """
    pymeshlab: Any = importlib.import_module("pymeshlab")  # an optional extra

    _stage("wrapping")
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(arrays["points"], arrays["faces"].astype(np.int32)))
    meshes.generate_alpha_wrap(
        alpha=pymeshlab.PercentageValue(100 * alpha_rel),
        offset=pymeshlab.PercentageValue(100 * offset_rel),
    )
    wrapped = meshes.current_mesh()
    return {
        "points": np.asarray(wrapped.vertex_matrix(), np.float64),
        "faces": np.asarray(wrapped.face_matrix(), np.int64),
    }


def poisson(arrays: Arrays, *, depth: int, neighbours: int, trim: float) -> Arrays:
    """Closed surface through ``points`` (n, 3) by screened Poisson reconstruction.

    Normals come from ``neighbours`` points and are oriented along a spanning tree; vertices in the
    ``trim`` share of lowest point density, where the surface is a guess, are cut away.
    """
    open3d = import_open3d()

    _stage("estimating normals")
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(arrays["points"]))
    cloud.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(neighbours))
    cloud.orient_normals_consistent_tangent_plane(neighbours)
    _stage("reconstructing")
    mesh, density = open3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=depth)
    density = np.asarray(density)
    mesh.remove_vertices_by_mask(density < np.quantile(density, trim))
    return {
        "points": np.asarray(mesh.vertices, np.float64),
        "faces": np.asarray(mesh.triangles, np.int64),
    }


def import_open3d() -> Any:
    """Import open3d, with the libusb that it links against but does not bring."""
    libusb = importlib.import_module("libusb_package")
    ctypes.CDLL(str(libusb.get_library_path()), mode=ctypes.RTLD_GLOBAL)
    return importlib.import_module("open3d")


TASKS: dict[str, Callable[..., Arrays]] = {
    "tetwild": tetwild,
    "alpha_wrap": alpha_wrap,
    "poisson": poisson,
}
