"""What a report shows: the material cases of one asset, their motion, verdicts and provenance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from jaxtyping import Float

from ...fem.errors import InputError
from ...fem.scene.materials import Span
from ...fem.scene.mesh import TetMesh
from ...predictors.asset import UpAxis
from ..results.description import Acting, Marks
from ..results.verdict import Verdict
from .look import Look
from .touch import TouchBody

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
