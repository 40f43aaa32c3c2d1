"""UniPixie's table S3 on our objects: heads trained jointly and apart, all for the same time.

Springs have no row: their constants follow from E, and what a fit adds to it is two numbers.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from ...training.unipixie.config import BARE_WORDS, MatterConfig
from ...training.unipixie.skinning import CELLS
from .networks import SCORED_SEED, SPLITS, Split

if TYPE_CHECKING:
    from ...training.unipixie.heads import SkinningSampler
    from ...training.unipixie.names_on_device import Names

BODIES_SEED = 7  # of the bodies that skinning is trained on
JOINT_ROWS: Mapping[str, tuple[str, ...]] = {
    "separate, matter": ("mpm",),
    "separate, skinning": ("skinning",),
    "joint": ("mpm", "skinning"),
    "constant theta": (),
}
# PSNR [dB] of motions by particles, skinning and springs at alpha 0 and 1 (UniPixie, Table S3).
PAPER_S3 = {
    "separate, 312 M parameters, 3.2 days": (28.83, 33.80, 36.27, 40.35, 33.90, 41.30),
    "joint, 167 M parameters, 1.5 days": (29.25, 32.87, 33.83, 41.63, 33.88, 38.51),
}


class JointRow(NamedTuple):
    """One row on one split; NaN where it has no such head.

    ``soft`` and ``stiff`` are mean squared errors of normalised log E at alpha 0 and 1; ``share``
    is what of a free body's compliance its ten handles have, ``interval`` half its 95 % interval.
    """

    row: str
    split: Split
    parameters: int
    soft: float
    stiff: float
    share: float
    interval: float
    minutes: float


def joint_table(
    base: MatterConfig,
    *,
    ranges: Path,
    objects: int = 96,
    bodies: int = 1000,
    cells: int = CELLS,
    progress: Callable[[str], None] | None = None,
) -> list[JointRow]:
    """Train every row as ``base`` says and score it on new objects, as ``paper_table`` does.

    Skinning is trained on so many ``bodies``, of ``cells`` along a side.
    """
    from ...datasets.ranges import RangeTable
    from ...training.unipixie.names_on_device import Names

    base = short_run(base)
    names = Names(RangeTable.load(ranges), base.device)
    store, scored = skinning_bodies(names, base, bodies, objects, cells)
    rows = []
    for name, heads in JOINT_ROWS.items():
        if progress:
            progress(name)
        rows += _joint_row(name, heads, base, names, store, scored)
    return rows


def skinning_bodies(
    names: Names, base: MatterConfig, bodies: int, objects: int, cells: int
) -> tuple[SkinningSampler, dict[Split, SkinningSampler]]:
    """Return bodies of ``cells`` a side to train on, and ``objects`` of each split to score on."""
    from ...training.unipixie.heads import SkinningSampler

    return SkinningSampler(names, base, bodies, BODIES_SEED, cells=cells), {
        split: SkinningSampler(
            names, base, objects, SCORED_SEED, held_out=split == "unseen", cells=cells
        )
        for split in SPLITS
    }


def short_run(base: MatterConfig) -> MatterConfig:
    """The run with an average and a warm-up that half a minute's training bears."""
    return replace(
        base, decay=min(base.decay, 0.99), warm_up=min(base.warm_up, 50),
        objects=min(base.objects, 8000),
    )  # fmt: skip


def _joint_row(name, heads, base: MatterConfig, names, store, scored) -> list[JointRow]:
    """Both splits of one row."""
    import torch

    from ...training.trainer import train_network
    from ...training.unipixie import heads as parts
    from ...training.unipixie.loss import MatterLoss
    from ...training.unipixie.recipe import make_matter_objects

    torch.manual_seed(base.seed)
    network = parts.JointUniPixie(base.network, heads) if heads else parts.ConstantTheta()
    matter = make_matter_objects(names, base) if "mpm" in heads else None
    skinning = None if heads == ("mpm",) else store
    generator = torch.Generator(base.device).manual_seed(base.seed)
    began = time.monotonic()
    trained = train_network(
        network, parts.HeadsSampler(matter, skinning, generator),
        parts.HeadsLoss(MatterLoss(base.lean)), base.options, config=asdict(base),
        forward=parts.heads_forward,
    ).network.eval()  # fmt: skip
    minutes = round((time.monotonic() - began) / 60, 2)
    count = sum(p.numel() for p in trained.parameters())
    return [
        JointRow(name, split, count, *_errors(trained, heads, base, names, split, len(sampler)),
                 *_share(trained, heads, sampler), minutes)
        for split, sampler in scored.items()
    ]  # fmt: skip


def _errors(network, heads, base: MatterConfig, names, split: Split, objects: int):
    """Mean squared errors of normalised log E at alpha 0 and 1."""
    from ...training.unipixie.range_scores import range_scores
    from ...training.unipixie.recipe import new_objects_sampler

    if "mpm" not in heads:
        return float("nan"), float("nan")
    drawn = replace(base, evidence=BARE_WORDS)
    sampler = new_objects_sampler(names, drawn, objects, SCORED_SEED, held_out=split == "unseen")
    soft, _, stiff = range_scores(network, sampler, objects=objects, samples=2).mse.values()
    return soft[0], stiff[0]


def _share(network, heads, sampler) -> tuple[float, float]:
    """Mean share of the compliance and half its 95 % interval."""
    from ...training.unipixie.heads import shares_of, skinning_forward

    if heads == ("mpm",):
        return float("nan"), float("nan")
    call = (lambda batch: skinning_forward(network, batch)) if heads else network
    found = shares_of(call, sampler)
    return float(found.mean()), float(1.96 * found.std() / len(found) ** 0.5)
