"""Bodies that sag: how a predicted field and the true one look under the same load.

The occupied voxels are the finite elements (six tets each). The load is the body's own weight on a
slope, held where it stands, so strong that the true body moves by ``SAG`` of its longest side; the
predicted one, with stiffness *and* weight of its own, bears the same acceleration. Nothing is drawn
larger than it was computed, but small displacements are assumed: bodies far too soft are drawn as
``LARGEST``. They are shown at rest, or as they swing when the load is put on at once.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from ...fem.elements.assembly import apply_supports, discretise, linear_stiffness
from ...fem.elements.forces import lumped_mass
from ...fem.linalg.cholesky import CholeskyFactor, planned_elimination
from ...fem.material import ElementMaterial
from ...fem.mesh import TetMesh, material_of
from ...fem.scene.supports import Supports, find_supports
from ...fem.solve.statics import solve_static
from ...predictors.appearance.views import hemisphere, render_views
from ...predictors.asset import Asset, Part
from ...predictors.field import DEFAULT
from ..voxels import TETS_PER_CELL, blocks, voxel_mesh
from .ssim import ImageSimilarity, image_similarity

CELLS = 32  # elements along a side, at most
SLOPE = np.array([1.0, 0.0, -1.0]) / np.sqrt(2)  # sag and bend alike, the ground is below
SAG = 0.1  # largest displacement of the true body, of its longest side
LARGEST = 0.5  # and the largest that is drawn
VIEWS, PIXELS = 3, 128
# A motion is one first period of the true body, seen from one side, in fewer and larger elements.
SWUNG_CELLS, STEPS, FRAMES = 16, 32, 8
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
    swing
        Whether motions are compared, frame by frame, instead of bodies at rest.

    ``size`` [m] is the longest side of the body.
    """

    def __init__(
        self, part: Int[np.ndarray, "x y z"], truth: Values, *, swing: bool = False
    ) -> None:
        self._cells = SWUNG_CELLS if swing else CELLS
        self._inside = blocks(part >= 0, self._cells)
        self._occupied = np.asarray(self._inside.any(axis=3))
        self._mesh = voxel_mesh(self._occupied)
        self._colours = _HUES[
            blocks(part + 1, self._cells).max(axis=3)[self._occupied] % len(_HUES)
        ]
        self._supports, _ = find_supports(self._mesh, "z")
        views = 1 if swing else VIEWS
        self._cameras = hemisphere(self._mesh.bounds, count=views, pixels=PIXELS)
        body = self._body(truth)
        moved = self._at_rest(body)
        self._period = slowest_period(body, moved) if swing else None
        self.size = float(np.ptp(self._mesh.bounds, axis=0).max())
        self._load = SAG * self.size / float(np.linalg.norm(moved, axis=1).max())
        self._frames = self._frames_of(self._moved(body))

    def similarity(self, found: Values) -> ImageSimilarity:
        """Compare a body of other values (normalised) with the true one: means over pictures."""
        frames = self._frames_of(self._moved(self._body(found)))
        each = [image_similarity(a, b) for a, b in zip(frames, self._frames, strict=True)]
        return ImageSimilarity(*map(float, np.mean(each, axis=0)))

    def sag(self, values: Values) -> Float[np.ndarray, "points 3"]:
        """Displacement [m] of a body of such values (normalised), at rest under the load."""
        return self._load * self._at_rest(self._body(values))

    def _body(self, values: Values) -> TetMesh:
        """The elements with the mean values of their voxels."""
        inside = self._inside
        total = np.einsum("abdnc,abdn->abdc", blocks(values, self._cells), inside)[self._occupied]
        at = total / self._inside.sum(axis=3)[self._occupied][:, None]
        material = ElementMaterial(*(np.repeat(v, TETS_PER_CELL) for v in DEFAULT.physical(at)))
        return self._mesh.with_material(material)

    def _at_rest(self, body: TetMesh) -> Float[np.ndarray, "points 3"]:
        """Displacement under 1 m/s^2 along the slope."""
        return solve_static(body, self._supports, gravity_vector=SLOPE, order=1).displacement

    def _moved(self, body: TetMesh) -> Float[np.ndarray, "frames points 3"]:
        """Displacement under 1 m/s^2 at every time that is shown."""
        if self._period is None:
            return self._at_rest(body)[None]
        steps = swing(body, self._supports, SLOPE, period=self._period, steps=STEPS)
        return steps[:: STEPS // FRAMES][1:]

    def _frames_of(
        self, moved: Float[np.ndarray, "frames points 3"]
    ) -> Float[np.ndarray, "pictures h w 3"]:
        shift = moved * self._load
        farthest = float(np.linalg.norm(shift, axis=2).max())
        shift *= min(1.0, LARGEST * self.size / max(farthest, np.finfo(float).tiny))
        return np.concatenate([self._pictures(one) for one in shift])

    def _pictures(self, shift: Float[np.ndarray, "points 3"]) -> Float[np.ndarray, "views h w 3"]:
        import trimesh

        boundary = self._mesh.boundary
        surface = trimesh.Trimesh(
            self._mesh.points + shift, boundary.faces, process=False,
            face_colors=self._colours[boundary.tet // TETS_PER_CELL],
        )  # fmt: skip
        views = render_views(Asset("body", (Part("body", surface),)), self._cameras)
        return views.images()[..., :3]


def slowest_period(body: TetMesh, moved: Float[np.ndarray, "points 3"]) -> float:
    """First period [s] of a body that moves so at rest under 1 m/s^2, by Rayleigh's quotient."""
    mass = _mass_of(body)[:, None]
    return 2 * np.pi * float(np.sqrt((mass * moved**2).sum() / (mass * moved * SLOPE).sum()))


def swing(
    body: TetMesh,
    supports: Supports,
    acceleration: Float[np.ndarray, "3"],
    *,
    period: float,
    steps: int,
) -> Float[np.ndarray, "times points 3"]:
    """Displacement [m] of a body at rest on which an acceleration [m/s^2] acts from now on.

    Linear elements, small displacements; the trapezoidal rule, which keeps the energy, in so many
    steps of a ``period`` [s]; the state at the beginning comes first.
    """
    mass, dt = _mass_of(body)[:, None], period / steps
    inertia = 4 / dt**2 * mass
    grid = discretise(body, 1)
    matrix = linear_stiffness(grid, material_of(body))
    apply_supports(matrix, supports.fixed, supports.springs + inertia)
    factor = CholeskyFactor(matrix, planned_elimination(matrix, grid.space.edges))
    u, v = np.zeros_like(body.points), np.zeros_like(body.points)
    a = np.where(supports.fixed, 0.0, acceleration)
    found = [u]
    for _ in range(steps):
        load = mass * acceleration + inertia * (u + dt * v) + mass * a
        then = factor.solve(np.where(supports.fixed, 0.0, load))
        gained = 4 / dt**2 * (then - u - dt * v) - a
        u, v, a = then, v + dt / 2 * (a + gained), gained
        found.append(u)
    return np.array(found)


def _mass_of(body: TetMesh) -> Float[np.ndarray, "points"]:
    """Lumped mass [kg] of the points."""
    return lumped_mass(body, discretise(body, 1).space)
