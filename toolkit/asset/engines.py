"""The native engines, as tasks of the guarded child process: arrays in, arrays out."""

from __future__ import annotations

import ctypes
import importlib
import sys
from collections.abc import Callable
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from .surface import equal_rows, face_edges
from .triangles import Triangles, closest, edge_components

Arrays = dict[str, np.ndarray]
# Of curved faces: most distance from a chord, relative to its edge, and most turn along it [rad].
CHORD, TURN = 0.01, 0.3


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
) -> Arrays:
    """Fill the box around ``points`` (n, 3), ``faces`` (m, 3) of about unit size with fTetWild.

    The surface is first decimated within ``decimate_rel``, then simplified by fTetWild unless it is
    one clean piece. Returns ``points`` and positively oriented ``tets`` that conform to it.
    """
    _stage("decimating")
    given = Triangles(arrays["points"], arrays["faces"])
    surface, pieces, left_alone = decimated(given, decimate_rel)
    # Half of this process's start, and needed for pictures only: pytetwild does without.
    sys.modules.setdefault("pyvista", ModuleType("pyvista"))
    # Its passes are told line by line: the parent foresees by them how long it will take.
    libc = ctypes.CDLL(None)
    libc.setvbuf(ctypes.c_void_p.in_dll(libc, "stdout"), None, 1, 0)  # _IOLBF of stdio.h
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
        quiet=False,
        **sizing,
    )
    return {"points": np.asarray(points, np.float64), "tets": np.asarray(tets, np.int32)}


# Fewer triangles for the engine: edges collapsed while the surface stays where it was. fTetWild has
# a simplification of its own that asks its envelope about every edge: on a scan of 5,000 triangles
# it takes two thirds of the whole time and removes a tenth of them. It is worth its time where
# ``decimated`` leaves many triangles alone, and where pieces of a surface cross.

FEWEST = 1000  # triangles: with fewer the engine's time goes into the tets
SMALL = 200  # triangles: a component with fewer might collapse to nothing, and hardly matters
# Share of the triangles that each step keeps: halves as long as they are near enough, then less.
STEPS = (0.5, 0.8)
STUCK = 0.95  # a step that keeps more than this share has found nothing more to collapse


class Pieces(NamedTuple):
    """``points`` (n, 3) [m] and ``faces`` (m, 3) with the connected ``piece`` (m,) of each face."""

    points: np.ndarray
    faces: np.ndarray
    piece: np.ndarray

    def only(self, which: Bool[np.ndarray, "pieces"]) -> Pieces:
        """Return some of the pieces, which keep their numbers, on the points that they use."""
        mine = which[self.piece]
        used, index = np.unique(self.faces[mine], return_inverse=True)
        return Pieces(self.points[used], index.reshape(-1, 3), self.piece[mine])

    def joined(self, other: Pieces) -> Pieces:
        """Both side by side."""
        return Pieces(
            np.concatenate([self.points, other.points]),
            np.concatenate([self.faces, other.faces + len(self.points)]),
            np.concatenate([self.piece, other.piece]),
        )


class Decimated(NamedTuple):
    """A surface with fewer triangles, its connected ``pieces``, and triangles ``left_alone``."""

    surface: Triangles
    pieces: int
    left_alone: int


def decimated(surface: Triangles, tolerance: float) -> Decimated:
    """Collapse edges of a coherently wound surface that then is within ``tolerance`` [m] of itself.

    Distances are taken both ways at vertices and middles of triangles, for every component by
    itself. Small components, those with non-manifold edges, and those that share a point with
    another one are left alone: where parts touch, both keep the very same wall.
    """
    whole = Pieces(*surface, edge_components(surface.faces))
    # Which pieces are large, manifold with their rims, coherently wound and touch no other one
    faces, piece = whole.faces, whole.piece
    _, edge, times = equal_rows(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2))
    bad = times[edge].reshape(-1, 3).max(axis=1, initial=0) > 1
    edges = face_edges(faces)
    rim = edges.directed[edges.count[edges.edge] == 1, 0]  # libigl refuses rims that pinch
    bad |= (np.bincount(rim, minlength=len(whole.points)) > 1)[faces].any(axis=1)
    place = np.unique(whole.points, axis=0, return_inverse=True)[1].reshape(-1)
    owners = np.column_stack([place[faces.reshape(-1)], np.repeat(piece, 3)])
    shared = np.flatnonzero(np.bincount(owners[equal_rows(owners).first, 0]) > 1)
    bad |= np.isin(place[faces], shared).any(axis=1)
    size, spoilt = np.bincount(piece), np.bincount(piece, weights=bad)
    free = (spoilt == 0) & (size >= SMALL)
    left_alone = int((~free[whole.piece]).sum())
    if len(whole.faces) - left_alone <= FEWEST:
        return Decimated(surface, len(free), left_alone)
    given = coarse = whole.only(free)
    for step in STEPS:
        coarse = _collapsed(given, coarse, step, tolerance)
    both = whole.only(~free).joined(coarse)
    return Decimated(Triangles(both.points, both.faces), len(free), left_alone)


def _collapsed(given: Pieces, coarse: Pieces, step: float, tolerance: float) -> Pieces:
    """Keep the share ``step`` of the triangles again and again, of each piece as long as it may."""
    import igl

    count = int(given.piece.max()) + 1
    active = np.ones(count, dtype=bool)
    while len((now := coarse.only(active)).faces) > FEWEST:
        # The surface is edge-manifold and coherently wound: on others libigl may never return.
        points, faces, birth, _ = igl.qslim(now.points, now.faces, int(step * len(now.faces)))
        birth = np.asarray(birth, np.int64).reshape(-1)
        tried = Pieces(
            np.asarray(points, np.float64), np.asarray(faces, np.int64), now.piece[birth]
        )
        before, after = (np.bincount(p.piece, minlength=count) for p in (now, tried))
        active &= (after > 0) & (after <= STUCK * before)
        one = given.only(active)
        other = tried.only(active)
        active &= (
            np.maximum(_distance(one, other, count), _distance(other, one, count)) <= tolerance
        )
        coarse = coarse.only(~active).joined(tried.only(active))
    return coarse


def _distance(start: Pieces, end: Pieces, count: int) -> Float[np.ndarray, "pieces"]:
    if not len(start.faces) or not len(end.faces):
        return np.zeros(count)
    owner = np.zeros(len(start.points), np.int64)
    owner[start.faces] = start.piece[:, None]
    where = np.concatenate([start.points, start.points[start.faces].mean(axis=1)])
    largest = np.zeros(count)
    away = closest(where, end.points, end.faces).distance
    np.maximum.at(largest, np.concatenate([owner, start.piece]), away)
    return largest


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


def assimp(arrays: Arrays, *, suffix: str) -> Arrays:
    """Meshes of the scene in the bytes ``data``, where their nodes put them.

    ``document`` is JSON: names, material, colour and whether there was a texture, of each mesh.
    """
    import json
    import tempfile

    library: Any = importlib.import_module("assimp_py")
    flags = (
        library.Process_Triangulate
        | library.Process_SortByPType
        | library.Process_GlobalScale
        | library.Process_FindInvalidData
    )
    with tempfile.NamedTemporaryFile(suffix=suffix) as file:
        file.write(arrays["data"].tobytes())
        file.flush()
        scene = library.import_file(file.name, flags)
    out: Arrays = {}
    document = []
    waiting: list[tuple[Any, np.ndarray, list[str]]] = [(scene.root_node, np.eye(4), [])]
    while waiting:
        node, above, names = waiting.pop()
        matrix = above @ np.array(node.transformation, dtype=np.float64)
        names = [str(node.name), *names]
        waiting += [(child, matrix, names) for child in reversed(node.children)]
        for number in node.mesh_indices:
            mesh = scene.meshes[number]
            indices = np.asarray(mesh.indices, np.int64)
            if mesh.num_faces == 0 or len(indices) != 3 * mesh.num_faces:
                continue  # lines and points
            points = np.asarray(mesh.vertices, np.float64).reshape(-1, 3)
            faces = indices.reshape(-1, 3)
            turned = np.linalg.det(matrix[:3, :3]) < 0
            out[f"points{len(document)}"] = points @ matrix[:3, :3].T + matrix[:3, 3]
            out[f"faces{len(document)}"] = faces[:, ::-1] if turned else faces
            material = scene.materials[mesh.material_index] if scene.materials else {}
            colour = material.get("COLOR_DIFFUSE") or [0.8, 0.8, 0.8, 1.0]
            document.append(
                {
                    "names": [names[0], str(mesh.name), *names[1:]],
                    "material": str(material.get("NAME") or "") or None,
                    "colour": [float(x) for x in colour],
                    "textured": bool(material.get("TEXTURES")),
                }
            )
    return out | {"document": np.frombuffer(json.dumps(document).encode(), np.uint8)}


def cad(arrays: Arrays, *, kind: str) -> Arrays:
    """The solids of a STEP or IGES file ``data`` as ``glb``, by OpenCASCADE."""
    cascadio: Any = importlib.import_module("cascadio")
    glb = cascadio.to_glb_bytes(
        arrays["data"].tobytes(),
        cascadio.FileType.STEP if kind == "STEP" else cascadio.FileType.IGES,
        tol_linear=CHORD,
        tol_relative=True,
        tol_angular=TURN,
        use_parallel=False,
    )
    return {"glb": np.frombuffer(glb, np.uint8)}


def import_open3d() -> Any:
    """Import open3d, with the libusb that it links against but does not bring."""
    libusb = importlib.import_module("libusb_package")
    ctypes.CDLL(str(libusb.get_library_path()), mode=ctypes.RTLD_GLOBAL)
    return importlib.import_module("open3d")


TASKS: dict[str, Callable[..., Arrays]] = {
    "tetwild": tetwild,
    "alpha_wrap": alpha_wrap,
    "poisson": poisson,
    "assimp": assimp,
    "cad": cad,
}
