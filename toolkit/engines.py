"""The native engines, as tasks of the guarded child process: arrays in, arrays out."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

import numpy as np

Arrays = dict[str, np.ndarray]


def _stage(words: str) -> None:
    """Tell the parent what is being done: it reads these lines."""
    import sys

    sys.stdout.write(f"stage: {words}\n")
    sys.stdout.flush()


def tetwild(
    arrays: Arrays,
    *,
    edge_length_rel: float,
    epsilon_rel: float,
    stop_energy: float,
    keep_outside: bool = True,
) -> Arrays:
    """Fill with fTetWild: ``points`` (n, 3), ``faces`` (m, 3) of about unit size.

    With ``keep_outside`` the tets fill the whole box around the surface, and conform to it.
    Returns ``points`` and positively oriented ``tets``.
    """
    pytetwild: Any = importlib.import_module("pytetwild")  # its stubs want narrower arrays

    _stage("tetrahedralizing")
    sizing = {name: array for name, array in arrays.items() if name.startswith("bg_")}
    points, tets = pytetwild.tetrahedralize(
        arrays["points"],
        arrays["faces"].astype(np.int32),
        edge_length_fac=edge_length_rel,
        epsilon=epsilon_rel,
        stop_energy=stop_energy,
        disable_filtering=keep_outside,
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


TASKS: dict[str, Callable[..., Arrays]] = {"tetwild": tetwild, "alpha_wrap": alpha_wrap}
