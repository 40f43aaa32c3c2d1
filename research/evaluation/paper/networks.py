"""UniPixie's tables S6 and S7 on our objects: each row is trained here, all for the same time.

The paper's figures, of its own objects, stand beside ours and never among them.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

from ...training.unipixie.config import BARE_WORDS, MatterConfig

Table = Literal["S6", "S7"]
Split = Literal["seen", "unseen"]
SPLITS: tuple[Split, ...] = ("seen", "unseen")
SCORED_SEED = 11  # of the objects that are scored

# What differs from the run that all rows share.
ROWS: Mapping[Table, Mapping[str, dict[str, Any]]] = {
    "S6": {"unipixie": {}, "unipixie, midpoints alone": {"midpoint": True}},
    "S7": {
        "flow": {},
        "flow, predicts velocity": {"network": {"predicts": "velocity"}},
        "flow, place alone": {"network": {"own": False}},
        "3D U-Net, diffusion": {"model": "diffusion"},
        "3D U-Net, regression": {"model": "regression"},
    },
}
# Of the UniPixie supplement, at alpha 0, .5 and 1: PSNR [dB], SSIM and LPIPS of motions (S6), mean
# squared errors of log E, nu and log rho (S7).
PAPER_TABLES: Mapping[Table, Mapping[str, tuple[tuple[float, float, float], ...]]] = {
    "S6": {
        "PIXIE": ((23.16, 0.8868, 0.1156), (30.17, 0.9225, 0.0542), (26.04, 0.9036, 0.0928)),
        "UniPixie": ((29.25, 0.9050, 0.1122), (30.43, 0.9198, 0.0810), (32.87, 0.9246, 0.0915)),
    },
    "S7": {
        "3D U-Net": ((0.0515, 0.4821, 0.1582), (0.0410, 0.4604, 0.1464), (0.0305, 0.4387, 0.1346)),
        "FMT": ((0.0102, 0.0288, 0.0211), (0.0091, 0.0240, 0.0194), (0.0080, 0.0192, 0.0177)),
    },
}


class TrainedRow(NamedTuple):
    """One row on one split: errors at alpha 0, .5 and 1, and what they took.

    Errors are mean squared, of log E, nu and log rho in the ranges of the normalisation; ``right``
    is the share of voxels of the right class; ``steps`` and ``minutes`` are of its training.
    """

    row: str
    split: Split
    soft: tuple[float, float, float]
    middle: tuple[float, float, float]
    stiff: tuple[float, float, float]
    right: float
    steps: int
    minutes: float


def paper_table(
    table: Table,
    base: MatterConfig,
    *,
    ranges: Path,
    real: Path | None = None,
    objects: int = 96,
    progress: Callable[[str], None] | None = None,
) -> list[TrainedRow]:
    """Train every row of a table as ``base`` says and score it on objects of new seeds.

    Parameters
    ----------
    table
        Which one.
    base
        The run that all rows share; its ``minutes``, or else its ``steps``, make them comparable.
    ranges, real
        Files of the table of ranges and of real objects to train on.
    objects
        How many are scored, of categories that training saw, and of those that it did not.
    progress
        Called with the row that is trained.
    """
    rows = []
    for name, change in ROWS[table].items():
        if progress:
            progress(name)
        rows.extend(_trained(name, _changed(base, change), ranges, real, objects))
    return rows


def _changed(base: MatterConfig, change: Mapping[str, Any]) -> MatterConfig:
    network = replace(base.network, **change.get("network", {}))
    return replace(base, **{**change, "network": network})


def _trained(
    name: str, config: MatterConfig, ranges: Path, real: Path | None, objects: int
) -> list[TrainedRow]:
    """Both splits of one row."""
    import torch

    from ...datasets.ranges import RangeTable
    from ...training.unipixie.names_on_device import Names
    from ...training.unipixie.range_scores import range_scores
    from ...training.unipixie.recipe import new_objects_sampler, train_matter

    began = time.monotonic()
    trained = train_matter(config, ranges=ranges, real=real)
    minutes = (time.monotonic() - began) / 60
    names = Names(RangeTable.load(ranges), config.device)
    drawn = replace(config, evidence=BARE_WORDS)
    rows = []
    for split in SPLITS:
        sampler = new_objects_sampler(
            names, drawn, objects, SCORED_SEED, held_out=split == "unseen"
        )
        torch.manual_seed(SCORED_SEED)
        scores = range_scores(trained.network.eval(), sampler, objects=objects, samples=2)
        soft, middle, stiff = scores.mse.values()
        spent = (trained.steps, round(minutes, 2))
        rows.append(TrainedRow(name, split, soft, middle, stiff, scores.right, *spent))
    return rows
