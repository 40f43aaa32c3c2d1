"""Bodies that sag: how a predicted field and the true one look under the same load.

The occupied voxels are the finite elements (six tets each). The load is the body's own weight on a
slope, held where it stands, so strong that the true body moves by ``SAG`` of its longest side; the
predicted one, with stiffness *and* weight of its own, bears the same acceleration. Nothing is drawn
larger than it was computed, but small displacements are assumed: bodies far too soft are drawn as
``LARGEST``.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from ...fem.scene.material import ElementMaterial
from ...fem.scene.support_finder import find_supports
from ...fem.solve.statics import solve_static
from ..asset import Asset, Part
from ..images.cameras import hemisphere
from ..images.views import render_views
from ..normalisation import DEFAULT
from ..voxels import TETS_PER_CELL, blocks, voxel_mesh
from .ssim import ImageSimilarity, image_similarity

CELLS = 32  # elements along a side, at most
SLOPE = np.array([1.0, 0.0, -1.0]) / np.sqrt(2)  # sag and bend alike, the ground is below
SAG = 0.1  # largest displacement of the true body, of its longest side
LARGEST = 0.5  # and the largest that is drawn
VIEWS, PIXELS = 3, 128
_HUES = np.random.default_rng(3).uniform(0.25, 0.95, (64, 3))  # of the parts

Values = Float[np.ndarray, "x y z 3"]


class SagRender:
    """The true body under its load and its pictures, to hold others against.

    Parameters
    ----------
    part
        Part of every voxel, shape (x, y, z), -1 outside; z is up.
    truth
        Normalised (log E, nu, log rho) of every voxel.
    """

    def __init__(self, part: Int[np.ndarray, "x y z"], truth: Values) -> None:
        self._inside = blocks(part >= 0, CELLS)
        self._occupied = np.asarray(self._inside.any(axis=3))
        self._mesh = voxel_mesh(self._occupied)
        self._colours = _HUES[blocks(part + 1, CELLS).max(axis=3)[self._occupied] % len(_HUES)]
        self._supports, _ = find_supports(self._mesh, 2)
        self._cameras = hemisphere(self._mesh.bounds, count=VIEWS, pixels=PIXELS)
        moved = self._moved(truth)
        self._size = float(np.ptp(self._mesh.bounds, axis=0).max())
        self._load = SAG * self._size / float(np.linalg.norm(moved, axis=1).max())
        self._frames = self._frames_of(moved)

    def similarity(self, found: Values) -> ImageSimilarity:
        """Compare a body of other values (normalised) with the true one: means over the cameras."""
        frames = self._frames_of(self._moved(found))
        each = [image_similarity(a, b) for a, b in zip(frames, self._frames, strict=True)]
        return ImageSimilarity(*map(float, np.mean(each, axis=0)))

    def _moved(self, values: Values) -> Float[np.ndarray, "points 3"]:
        """Displacement under 1 m/s^2 along the slope."""
        total = np.einsum("abdnc,abdn->abdc", blocks(values, CELLS), self._inside)[self._occupied]
        at = total / self._inside.sum(axis=3)[self._occupied][:, None]
        material = ElementMaterial(*(np.repeat(v, TETS_PER_CELL) for v in DEFAULT.physical(at)))
        body = self._mesh.with_material(material)
        return solve_static(body, self._supports, gravity_vector=SLOPE, order=1).displacement

    def _frames_of(self, moved: Float[np.ndarray, "points 3"]) -> Float[np.ndarray, "views h w 3"]:
        import trimesh

        shift = moved * self._load
        farthest = float(np.linalg.norm(shift, axis=1).max())
        shift *= min(1.0, LARGEST * self._size / max(farthest, np.finfo(float).tiny))
        boundary = self._mesh.boundary
        surface = trimesh.Trimesh(
            self._mesh.points + shift, boundary.faces, process=False,
            face_colors=self._colours[boundary.tet // TETS_PER_CELL],
        )  # fmt: skip
        views = render_views(Asset("body", (Part("body", surface),)), self._cameras)
        return views.images()[..., :3]
