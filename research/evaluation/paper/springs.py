"""The head of springs: whether the look of a body tells the scale of k, beside constants.

k follows from E; what a fit adds is one number, the scale that gives the network the body's own
first frequency. Each rule tells it from bodies that it was fitted to and is scored by the frequency
that the network then has: of seen categories each body is left out of its own fit, of unseen ones
all seen bodies are fitted to.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ....fem.errors import AutophyxError
from ....fem.material import ElementMaterial
from ....fem.mesh import TetMesh
from ....fem.scene.scene import Scene
from ....fem.solve.modal import natural_modes
from ....fem.springs.body import spring_body
from ....fem.springs.fit import scale_to_frequency
from ...voxels import TETS_PER_CELL, voxel_mesh
from ..metrics import Interval, bootstrap_interval
from .networks import SCORED_SEED, SPLITS, Split

log = logging.getLogger(__name__)

CELLS = 16  # along a side, of which a margin is empty
ANCHORS = 1024
PENALTY = 1.0  # of the ridge, on standardised features: a body's worth
STANDS, MEDIAN, MEAN = "as it stands, from E", "median of the others", "mean of the others"
THICKNESS, ALL = "ridge on thickness", "ridge on thickness, nu and contrast of E"


class SpringRow(NamedTuple):
    """One rule on one split: |log f| of the network's first frequency over the body's.

    Its root mean square, median, and mean; ``loss`` is by how much its mean is larger than that of
    the median rule, body by body. Intervals are 95 % bootstraps; ``left_out`` bodies have pieces of
    the network that turn freely, or no vibration was found.
    """

    row: str
    split: Split
    bodies: int
    left_out: int
    root_mean_square: float
    median: float
    mean: float
    mean_interval: Interval
    loss: float
    loss_interval: Interval


class SpringCase(NamedTuple):
    """Of one body the logarithm of the scale of k that it needs, and what its look tells.

    ``look``: logarithm of the thickness in anchors, mean nu, logarithm of the contrast of E.
    """

    scale: float
    look: tuple[float, float, float]


def springs_table(
    *,
    ranges: Path,
    objects: int = 40,
    cells: int = CELLS,
    anchors: int = ANCHORS,
    progress: Callable[[str], None] | None = None,
) -> list[SpringRow]:
    """Score every rule on ``objects`` bodies of seen and of unseen categories.

    Parameters
    ----------
    ranges
        File of the table of ranges: E, nu and rho of a part are the middle of its word's.
    objects
        How many bodies of each split, at least two.
    cells, anchors
        How fine bodies and networks are.
    progress
        Called with the body that is next.
    """
    found: dict[Split, list[SpringCase]] = {}
    for split in SPLITS:
        found[split] = []
        for number, body in enumerate(_bodies(ranges, objects, cells, split)):
            if progress:
                progress(f"{split}, body {number + 1}")
            try:
                found[split].append(spring_case(body, anchors))
            except AutophyxError as error:
                log.warning("a body is left out: %s", error)
    off = {split: _off(found["seen"], found[split], split == "seen") for split in SPLITS}
    return [
        _row(row, split, objects, off[split][row], off[split][MEDIAN])
        for row in RULES
        for split in SPLITS
    ]


def spring_case(body: TetMesh, anchors: int) -> SpringCase:
    """Scale of k that gives a free body's network the first frequency of quadratic elements."""
    wanted = float(natural_modes(body, 1).frequencies[0])
    network = spring_body(Scene(mesh=body), anchors).network
    material = body.material
    assert material is not None
    contrast = float(material.E.max() / material.E.min())
    thickness = float(np.min(network.anchors.layers))
    nu = float(np.average(material.nu, weights=body.volumes))
    scale = scale_to_frequency(network, wanted)
    return SpringCase(math.log(scale), (math.log(thickness), nu, math.log(contrast)))


def ridge_scale(
    scales: Float[np.ndarray, "bodies"],
    looks: Float[np.ndarray, "bodies features"],
    look: Float[np.ndarray, "features"],
) -> float:
    """Scale that ridge regression on standardised features tells of another body."""
    middle, size = looks.mean(axis=0), looks.std(axis=0)
    size = np.where(size > 0, size, 1.0)
    X = (looks - middle) / size
    slopes = np.linalg.solve(X.T @ X + PENALTY * np.eye(X.shape[1]), X.T @ (scales - scales.mean()))
    return float(scales.mean() + slopes @ ((look - middle) / size))


# From scales (n,) and looks (n, 3) of known bodies and the look (3,) of one: its scale.
Rule = Callable[[np.ndarray, np.ndarray, np.ndarray], float]
RULES: dict[str, Rule] = {
    STANDS: lambda scales, looks, look: 0.0,
    MEDIAN: lambda scales, looks, look: float(np.median(scales)),
    MEAN: lambda scales, looks, look: float(scales.mean()),
    THICKNESS: lambda scales, looks, look: ridge_scale(scales, looks[:, :1], look[:1]),
    ALL: ridge_scale,
}


def _off(
    known: list[SpringCase], asked: list[SpringCase], itself: bool
) -> dict[str, Float[np.ndarray, "bodies"]]:
    """|log f| of every rule and body that is asked for, which ``itself`` is left out if known."""
    scales, looks = (np.array(column, dtype=float) for column in zip(*known, strict=True))
    off: dict[str, list[float]] = {row: [] for row in RULES}
    for number, case in enumerate(asked):
        others = np.arange(len(known)) != number if itself else slice(None)
        for row, rule in RULES.items():
            told = rule(scales[others], looks[others], np.array(case.look))
            off[row].append(abs(told - case.scale) / 2)  # f goes with the root of k
    return {row: np.array(values) for row, values in off.items()}


def _bodies(ranges: Path, count: int, cells: int, split: Split):
    """Largest pieces of procedural objects as meshes, in the middle of what their words leave."""
    import torch

    from ...datasets.objects import HELD_OUT, make_objects
    from ...datasets.ranges import RangeTable
    from ...datasets.shapes import rasterise
    from ...training.unipixie.heads import called_by_words
    from ...training.unipixie.names_on_device import Names
    from ...training.unipixie.skinning import largest_piece

    categories = list(HELD_OUT) if split == "unseen" else None
    objects = make_objects(count, np.random.default_rng(SCORED_SEED), names=categories)
    names, dice = Names(RangeTable.load(ranges), "cpu"), torch.Generator().manual_seed(SCORED_SEED)
    _, values = called_by_words(names, objects, dice)
    labels = rasterise(torch.tensor(objects.rows), cells=cells).numpy()
    for label, *columns in zip(labels, *values, strict=True):
        piece = largest_piece(label)
        part = label[piece]
        material = ElementMaterial(*(np.repeat(c[part], TETS_PER_CELL) for c in columns))
        yield voxel_mesh(piece).with_material(material)


def _row(row: str, split: Split, objects: int, off: np.ndarray, median: np.ndarray) -> SpringRow:
    loss = off - median
    return SpringRow(
        row, split, len(off), objects - len(off), float(np.sqrt((off**2).mean())),
        float(np.median(off)), float(off.mean()), bootstrap_interval(off), float(loss.mean()),
        bootstrap_interval(loss),
    )  # fmt: skip
