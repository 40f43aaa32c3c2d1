"""The head of skinning by itself: a small one on the shipped encoder, beside one theta for all.

Scored is the share of a free body's compliance that ten handles and an affine motion have, as in
``training.unipixie.skinning``; every trained row takes the same time.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch

from ....predictors.unipixie.predictor import WEIGHTS, load_unipixie
from ...datasets.ranges import RangeTable
from ...training.trainer import train_network
from ...training.unipixie.config import MatterConfig
from ...training.unipixie.heads import (
    SKINNING,
    THETA,
    ConstantTheta,
    EncodedBatch,
    EncodedSampler,
    JointUniPixie,
    shares_of,
    skinning_loss,
)
from ...training.unipixie.names_on_device import Names
from ...training.unipixie.skinning import CELLS
from ..metrics import Interval, bootstrap_interval
from .joint import short_run, skinning_bodies
from .networks import SPLITS, Split

AFFINE, CONSTANT, HEAD = "the affine motion alone", "one theta for every body", "head"
LEAST = 4  # bodies in a batch: fewer tell little of the others


class ThetaRow(NamedTuple):
    """One row on one split: share of the compliance, and how much more than one theta's.

    ``trained_on`` bodies of ``cells`` along a side, in so many ``steps`` and ``minutes``; both
    intervals are 95 % bootstraps over the bodies that are scored.
    """

    row: str
    split: Split
    bodies: int
    share: float
    share_interval: Interval
    gain: float
    gain_interval: Interval
    trained_on: int
    cells: int
    steps: int
    minutes: float


def theta_table(
    base: MatterConfig,
    *,
    ranges: Path,
    objects: int = 96,
    bodies: int = 1200,
    cells: int = CELLS,
    weights: Path = WEIGHTS,
    progress: Callable[[str], None] | None = None,
) -> list[ThetaRow]:
    """Train a head and a constant as long as ``base`` says and score them on new bodies.

    Parameters
    ----------
    base
        The run; its network is that of ``weights``.
    ranges
        File of the table of ranges.
    objects, bodies, cells
        How many bodies are scored of each split, and trained on; cells along a side of each.
    weights
        Of the encoder, which stays as it is.
    progress
        Called with the row that is trained.
    """
    network = load_unipixie(weights).network.to(base.device)
    base = replace(short_run(base), network=network.config)
    names = Names(RangeTable.load(ranges), base.device)
    store, scored = skinning_bodies(names, base, bodies, objects, cells)
    sampler = EncodedSampler(network, store)
    seen = {split: EncodedSampler(network, one) for split, one in scored.items()}
    calls: dict[str, tuple[Callable[[EncodedBatch], torch.Tensor], int, float]] = {
        AFFINE: (lambda batch: batch.latent.new_zeros(len(batch.latent), THETA), 0, 0.0)
    }
    for row in (CONSTANT, HEAD):
        if progress:
            progress(row)
        calls[row] = _trained(row, base, sampler)
    shares = {
        (row, split): shares_of(call, seen[split])
        for row, (call, *_) in calls.items()
        for split in SPLITS
    }
    return [
        _row(row, split, shares[row, split], shares[CONSTANT, split], (bodies, cells, *run))
        for row, (_, *run) in calls.items()
        for split in SPLITS
    ]


def _trained(row: str, base: MatterConfig, sampler: EncodedSampler):
    """What gives theta of a batch, the steps of its training and their minutes."""
    torch.manual_seed(base.seed)
    began = time.monotonic()
    network = ConstantTheta() if row == CONSTANT else ThetaHead(base)
    trained = train_network(
        network, sampler, skinning_loss,
        replace(base.options, batch=max(base.batch // 4, LEAST)), config=asdict(base),
    )  # fmt: skip
    return trained.network.eval(), trained.steps, round((time.monotonic() - began) / 60, 2)


class ThetaHead(torch.nn.Module):
    """The paper's hypernetwork of four layers (B.1.3), from the mean latent."""

    def __init__(self, base: MatterConfig) -> None:
        super().__init__()
        self.body = JointUniPixie(base.network, (SKINNING,)).body

    def forward(self, batch: EncodedBatch) -> torch.Tensor:
        """Return (n, 650)."""
        return self.body(batch.latent)


def _row(row: str, split: Split, share: np.ndarray, constant: np.ndarray, run: tuple) -> ThetaRow:
    gain = share - constant
    return ThetaRow(
        row, split, len(share), float(share.mean()), bootstrap_interval(share),
        float(gain.mean()), bootstrap_interval(gain), *run,
    )  # fmt: skip
