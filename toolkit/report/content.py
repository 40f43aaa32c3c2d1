"""What a report shows: the material cases of one asset, their motion, verdicts and provenance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float, Int, UInt8

from ...fem.errors import ConvergenceError, InputError, UsageError
from ...fem.mesh import TetMesh
from ...fem.reduced.basis import reduce_body
from ...fem.reduced.elasticity import ReducedElasticity, reduced_frequencies
from ...fem.reduced.model import ReducedModel, Subspace
from ...fem.scene.scene import Scene
from ...fem.scene.up import up_vector
from ...fem.table import Span
from ...predictors.appearance.surface import skin_of
from ...predictors.asset import Asset, UpAxis
from ..verdict.description import Acting, Marks
from ..verdict.verdict import Verdict

Fact = tuple[str, str]  # a label, and words


@dataclass(frozen=True)
class PartRow:
    """One row of the material table; ``words`` of the text decided on ``material``.

    Units: ``E`` [Pa], ``nu`` [1], ``rho`` [kg/m^3], ``volume`` [m^3], ``mass`` [kg].
    """

    name: str
    material: str
    words: str
    E: float
    nu: float
    rho: float
    volume: float
    mass: float
    source: str = ""
    E_span: Span | None = None
    nu_span: Span | None = None
    rho_span: Span | None = None


@dataclass(frozen=True, eq=False)
class Case:
    """One text and what follows from it; several cases are shown side by side.

    Parameters
    ----------
    text
        The sentence that chose the materials.
    mesh
        The tets with their material.
    parts
        The material table.
    displacement
        Static displacement [m], shape (points, 3).
    von_mises
        Von Mises stress of the static state [Pa], shape (tets,): the mean of each tet.
    max_von_mises
        The largest at the points [Pa], as verdicts judge it; None: the largest of the tets.
    motion
        Displacement [m] of every frame, shape (frames, points, 3).
    times
        Time [s] of every frame, increasing, shape (frames,).
    frequencies
        Natural frequencies [Hz].
    vibrations
        Shapes that belong to them, of any size, shape (modes, points, 3).
    state, clock
        What ``displacement`` is called, and whether ``times`` are seconds or shares of the load.
    title, acting
        What was simulated, and everything that held and loaded the body, in words.
    marks
        Where supports and loads are drawn.
    solved
        How it was solved: law, elements, solver ..., label and words.
    answers
        What a reader asks first: what moves most, whether it gives way ...
    touch
        The body to pull; None: the page has none.
    look
        How the asset looks, by tets; None: it has no colours.
    alpha
        Place of what is not said between soft (0) and stiff (1), where cases differ by it.
    """

    text: str
    mesh: TetMesh
    parts: tuple[PartRow, ...] = ()
    displacement: Float[np.ndarray, "points 3"] | None = None
    von_mises: Float[np.ndarray, "tets"] | None = None
    motion: Float[np.ndarray, "frames points 3"] | None = None
    times: Float[np.ndarray, "frames"] | None = None
    frequencies: tuple[float, ...] = ()
    verdicts: tuple[Verdict, ...] = ()
    title: str = ""
    acting: tuple[Acting, ...] = ()
    marks: Marks | None = None
    solved: tuple[Fact, ...] = ()
    answers: tuple[Fact, ...] = ()
    touch: TouchBody | None = None
    vibrations: Float[np.ndarray, "modes points 3"] | None = None
    state: str = "Under load"
    clock: Literal["time", "load"] = "time"
    look: Look | None = None
    alpha: float | None = None
    max_von_mises: float | None = None

    def __post_init__(self) -> None:
        points, tets = len(self.mesh.points), len(self.mesh.tets)
        if self.mesh.material is None:
            raise InputError("the report needs a mesh with E, nu and rho: run `assign` first")
        frames = 0 if self.motion is None else len(self.motion)
        wanted = {
            "displacement": (points, 3),
            "von_mises": (tets,),
            "motion": (frames, points, 3),
            "times": (frames,),
            "vibrations": (len(self.frequencies), points, 3),
        }
        for name, shape in wanted.items():
            array = getattr(self, name)
            if array is None:
                continue
            if array.shape != shape:
                raise InputError(f"{name} of the report must have shape {shape}, got {array.shape}")
            if not np.isfinite(array).all():
                bad = int((~np.isfinite(array)).sum())
                raise InputError(f"{name} has {bad} values that are not finite: cannot be drawn")
        if frames and self.times is None:
            raise InputError(f"motion of {frames} frames needs the time [s] of every frame")


@dataclass(frozen=True, eq=False)
class ReportContent:
    """Everything the report shows.

    ``quality`` maps a label to a number or word, or to a 1-D array, which becomes a histogram.
    ``provenance`` maps a label to a value or to a mapping of such (hashes, versions, options).
    ``up`` is the axis of the mesh that points up. ``pictures`` maps a caption to a PNG or GIF's
    bytes. ``made`` says when and by what, ``command`` how to make it again, ``loaded`` what was
    read and meshed.
    """

    title: str
    cases: tuple[Case, ...]
    up: UpAxis = "z"
    quality: Mapping[str, object] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    provenance: Mapping[str, object] = field(default_factory=dict)
    pictures: Mapping[str, bytes] = field(default_factory=dict)
    made: str = ""
    command: str = ""
    loaded: tuple[Fact, ...] = ()

    def __post_init__(self) -> None:
        if not self.cases:
            raise InputError("a report needs at least one case, got none")


# How an asset looks, carried to the tets of its mesh: one of a few colours each.

SAMPLES = 40_000  # coloured points of the surface: one a pixel of a picture of 200 x 200
MOST = 64  # colours: what one map of the page tells apart


class Look(NamedTuple):
    """Colours as ``#rrggbb``, at most ``MOST``, and which of them each tet has, shape (tets,)."""

    colors: tuple[str, ...]
    index: Int[np.ndarray, "tets"]


def look_of(asset: Asset, mesh: TetMesh) -> Look | None:
    """The colour of the asset's surface where it is nearest to each tet; None where it has one.

    A tet on the surface has the colour of its face, which lies nearer than its centroid.
    """
    from PIL import Image
    from scipy.spatial import KDTree

    where, colour = _coloured_points(asset)
    if len(np.unique(colour, axis=0)) < 2:
        return None
    at = mesh.centroids.copy()
    at[mesh.boundary.tet] = mesh.points[mesh.boundary.faces].mean(axis=1)
    seen = colour[KDTree(where).query(at)[1]]
    image = Image.fromarray(seen[None]).quantize(MOST, method=Image.Quantize.MEDIANCUT)
    table = np.array(image.getpalette()).reshape(-1, 3)
    used, index = np.unique(np.asarray(image)[0], return_inverse=True)
    return Look(tuple("#{:02x}{:02x}{:02x}".format(*table[k]) for k in used), index)


def _coloured_points(
    asset: Asset,
) -> tuple[Float[np.ndarray, "n 3"], UInt8[np.ndarray, "n 3"]]:
    """Points of even density on all parts, and their colours, sRGB bytes."""
    rng = np.random.default_rng(0)
    areas = np.array([part.mesh.area for part in asset.parts])
    where, colours = [], []
    for part, share in zip(asset.parts, areas / (areas.sum() or 1), strict=True):
        corners, area = part.mesh.triangles, part.mesh.area_faces
        if not area.sum() > 0:
            continue
        face = rng.choice(len(area), size=int(np.ceil(SAMPLES * share)), p=area / area.sum())
        u, v = np.sort(rng.random((2, len(face))), axis=0)
        weight = np.stack([u, v - u, 1 - v], axis=1).astype(np.float32)
        where.append(np.einsum("nk,nki->ni", weight, corners[face]))
        colours.append(skin_of(part.mesh)(face, weight)[:, :3])
    if not where:
        return np.zeros((0, 3)), np.zeros((0, 3), np.uint8)
    bytes_ = (255 * np.concatenate(colours).clip(0, 1) + 0.5).astype(np.uint8)
    return np.concatenate(where), bytes_


# A body to pull on the page: its reduced model, how large and how slowly it is shown.

# What a page can step sixty times a second.
MOST_CELLS, MOST_DOFS = 250, 40
# The force [N] of a finger moves the softest place by this share of the diagonal, as it is shown.
FINGER, SHOWN = 10.0, 0.1
# The slowest vibration takes at least so long [s] on the page.
SLOWEST = 0.5


class TouchBody(NamedTuple):
    """A body to pull.

    ``magnification`` and ``slowness`` [1] are how many times larger and slower than it is it is
    shown; ``moved`` [m] is how far ``FINGER`` N move its softest place.
    """

    model: ReducedModel
    magnification: float
    slowness: float
    moved: float

    @property
    def words(self) -> str:
        """How it is shown, in words."""
        size = "as large as it is"
        if self.magnification > 1:
            size = f"magnified {self.magnification:,.0f} times"
        pace = "in its own time" if self.slowness == 1 else f"{self.slowness:,.0f} times slower"
        return f"Its motion is shown {size} and {pace}."


def touch_of(scene: Scene) -> TouchBody:
    """Body of ``scene`` as it is held, without its loads, to be pulled.

    Raises
    ------
    UsageError
        Where it cannot be, and why.
    """
    if not scene.held.fixed.any():
        raise UsageError("nothing holds it: there is nothing to pull at")
    mesh, down = scene.mesh, -9.81 * up_vector(scene.up)
    try:
        model = reduce_body(
            mesh, scene.held, gravity_vector=down, kind=Subspace.VECTOR, most_cells=MOST_CELLS
        )
    except (InputError, ConvergenceError) as error:
        raise UsageError(f"it has no reduced model: {error}") from error
    if model.dofs > MOST_DOFS or len(model.cells) > MOST_CELLS:
        raise UsageError(
            f"{model.dofs} coordinates and {len(model.cells)} cells are too many for a page"
        )
    return shown(model)


def shown(model: ReducedModel) -> TouchBody:
    """Magnification and pace at which a reader sees ``model`` give way and swing."""
    elasticity = ReducedElasticity(model)
    surface = model.basis[np.unique(model.faces)]
    K = elasticity.tangent(np.zeros(model.dofs))
    soft = np.einsum("nia,ab,njb->nij", surface, np.linalg.inv(K), surface, optimize=True)
    moved = FINGER * float(np.linalg.eigvalsh(soft)[:, -1].max())
    diagonal = float(np.linalg.norm(np.ptp(model.points[model.mass > 0], axis=0)))
    slow = SLOWEST * float(reduced_frequencies(elasticity)[0])
    return TouchBody(model, _plain(SHOWN * diagonal / moved), _plain(slow), moved)


def _plain(value: float) -> float:
    """Nearest 1, 2 or 5 times a power of ten, at least 1."""
    steps = np.array([1, 2, 5, 10]) * 10.0 ** np.floor(np.log10(max(value, 1.0)))
    return float(steps[np.argmin(np.abs(np.log(steps / max(value, 1.0))))])
