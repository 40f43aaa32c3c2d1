"""How the region network is trained: folds, several seeds, calibration, and its file."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from ....predictors.packed import packed
from ....predictors.regions.division import assigned
from ....predictors.regions.network import MEASURES
from ....predictors.text.parts import KINDS
from ...datasets.region_sets import RegionCorpus
from ..options import TrainerOptions
from ..trainer import Losses, Report, Trained, train_network
from .network import RegionBatch, RegionTransformer
from .sampler import FOLDS, Habits, RegionSampler

EACH = 0.45  # what a region counts for itself, beside its volume: small things count too


@dataclass(frozen=True)
class RegionConfig:
    """A training run of ``networks`` seeds; the data are those of one file.

    ``habits`` are given to the networks in turn; networks that differ say more together.
    """

    options: TrainerOptions
    networks: int = 9
    folds: int = FOLDS  # of which the certainty is learned; 0 leaves it as the network says it
    seed: int = 0
    habits: tuple[Habits, ...] = (
        Habits(), Habits(real=0.85, anew=0.2, clicked=0.5),
        Habits(real=0.85, clicked=0.4, noise=0.2),
    )  # fmt: skip


PRESETS = {
    "regions": RegionConfig(
        TrainerOptions(
            batch=128, steps=3300, rate=1e-3, final_rate=2e-5, warm_up=100, weight_decay=0.05,
            decay=0.995, device="cuda", every=250,
        )
    ),
    "regions-cpu": RegionConfig(
        TrainerOptions(
            batch=32, steps=60, rate=1e-3, final_rate=2e-5, warm_up=10, weight_decay=0.05,
            decay=0.95, every=20,
        ),
        networks=1,
        folds=0,
    ),
}  # fmt: skip


def region_loss(logits: Tensor, batch: RegionBatch) -> Losses:
    """Cross-entropy of the clause of every cell, and of every region beside it."""
    log = functional.log_softmax(logits.float(), dim=-1)
    each = batch.wanted.sum(dim=-1, keepdim=True)
    share = batch.wanted / each.sum(dim=1, keepdim=True).clamp(min=1)
    volume = -(share * log).sum(dim=(1, 2)).mean()
    own = -(batch.wanted / each.clamp(min=1) * log).sum(dim=(1, 2))
    region = (own / (each[..., 0] > 0).sum(dim=1).clamp(min=1)).mean()
    with torch.no_grad():
        right = torch.gather(share, 2, logits.argmax(dim=-1, keepdim=True)).sum(dim=(1, 2)).mean()
    return Losses(volume + EACH * region, {"volume": volume, "region": region, "right": right})


def train_regions(
    config: RegionConfig,
    corpus: RegionCorpus,
    *,
    output: Path | None = None,
    resume: Path | None = None,
    report: Report | None = None,
) -> list[Trained[RegionTransformer]]:
    """Train the networks, and those of the folds for the certainty, and write them as one file."""
    certainty = (1.0, 0.0)
    if config.folds:
        found = []
        for fold in range(config.folds):
            one = train_one(config, corpus, fold=fold, resume=resume, report=report)
            found.append(scores_of_fold([one.network], corpus, fold, config.options.device))
        certainty = calibrated(*np.concatenate(found, axis=1)[:2])
    done = [
        train_one(config, corpus, number=number, resume=resume, report=report)
        for number in range(config.networks)
    ]
    if output is not None:
        write_regions(output, [one.network for one in done], corpus, certainty, asdict(config))
    return done


def train_one(
    config: RegionConfig,
    corpus: RegionCorpus,
    *,
    number: int = 0,
    fold: int | None = None,
    resume: Path | None = None,
    report: Report | None = None,
) -> Trained[RegionTransformer]:
    """Train one network, on all things or on those outside a fold."""
    seed, device = config.seed + number, config.options.device
    torch.manual_seed(seed)
    habits = config.habits[number % len(config.habits)]
    sampler = RegionSampler(corpus, seed=seed, device=device, fold=fold, habits=habits)
    name = f"network_{number}" if fold is None else f"fold_{fold}"
    return train_network(
        RegionTransformer(sampler.categories), sampler, region_loss, config.options,
        forward=lambda network, batch: network(
            clicked(network, batch, habits.clicked, sampler.generator)
        ),
        report=report, resume=None if resume is None else resume / name,
        config={**asdict(config), "fold": fold, "number": number},
    )  # fmt: skip


@torch.no_grad()
def clicked(
    network: Callable[[RegionBatch], Tensor],
    batch: RegionBatch,
    share: float,
    generator: torch.Generator,
) -> RegionBatch:
    """The batch in which a user told so many things' regions where the network is most wrong."""
    nobody = torch.full_like(batch.told, -1)
    plain = batch.evidence.clone()
    plain[..., 2] = 0
    best = network(batch._replace(told=nobody, evidence=plain)).argmax(dim=-1, keepdim=True)
    most, truth = batch.wanted.max(dim=-1)
    wrong = most - batch.wanted.gather(2, best)[..., 0]
    worst = wrong.argmax(dim=1, keepdim=True)
    drawn = torch.rand(len(wrong), 1, generator=generator, device=wrong.device)
    mine = (drawn < share) & (wrong.gather(1, worst) > 0)
    told = torch.where(mine, nobody.scatter(1, worst, truth.gather(1, worst)), batch.told)
    said = 2.0 * functional.one_hot(told.clamp(min=0), batch.wanted.shape[2]) - 1
    plain[..., 2] = said * (told >= 0)[..., None]
    return batch._replace(told=told, evidence=plain)


def scores_of_fold(
    networks: Sequence[RegionTransformer], corpus: RegionCorpus, fold: int, device: str
) -> np.ndarray:
    """Of things of a fold as they are, with each sentence about them (4, n).

    What is expected to be right and what is, shares of the volume; the largest clause's; and
    whether shells were known.
    """
    sampler = RegionSampler(corpus, seed=0, device=device, fold=fold)
    mine = np.flatnonzero((sampler.fold[corpus.thing] == fold) & ~corpus.varied)
    asked = [np.flatnonzero((corpus.of == i) & ~corpus.anew) for i in range(len(corpus.real))]
    pairs = np.array([(i, q) for i in mine for q in asked[corpus.thing[i]]])
    shares, wanted = shares_of(networks, sampler, *pairs.T)
    out = []
    for share, cells, shells in zip(shares, wanted, corpus.shells[pairs[:, 0]], strict=True):
        each = cells.sum(axis=1)
        there = each > 0
        last = np.roll(share[there], -1, axis=1)  # the null clause as the last
        spoken = np.append(cells.sum(axis=0)[1:] > 0, True)
        last = np.where(spoken, last, 0.0)
        owner = assigned(last[:, spoken])
        owner = np.flatnonzero(spoken)[owner]
        rows = np.arange(len(owner))
        total = max(float(each.sum()), 1.0)
        right = np.roll(cells[there], -1, axis=1)[rows, owner].sum() / total
        expected = (each[there] * last[rows, owner]).sum() / total
        out.append((expected, right, cells.sum(axis=0).max() / total, shells))
    return np.array(out).T


def calibrated(expected: np.ndarray, right: np.ndarray) -> tuple[float, float]:
    """Slope and offset in log-odds that make of what is expected what is right (Platt 1999)."""
    from scipy.optimize import minimize
    from scipy.special import expit

    odds = np.log(expected.clip(1e-3, 1 - 1e-3) / (1 - expected).clip(1e-3))

    def cost(x: np.ndarray) -> float:
        sure = expit(x[0] * odds + x[1]).clip(1e-6, 1 - 1e-6)
        return -float((right * np.log(sure) + (1 - right) * np.log(1 - sure)).mean())

    slope, offset = minimize(cost, [1.0, 0.0], method="Nelder-Mead").x
    return float(slope), float(offset)


def write_regions(
    path: Path,
    networks: Sequence[RegionTransformer],
    corpus: RegionCorpus,
    certainty: tuple[float, float],
    config: dict[str, Any],
) -> None:
    """Write networks of one corpus with all that inference needs."""
    sampler = RegionSampler(corpus, seed=0, device="cpu")
    facts = {
        "measures": MEASURES, "kinds": KINDS, "categories": corpus.facts["categories"],
        "mean": sampler.mean.tolist(), "deviation": sampler.deviation.tolist(),
        "certainty": certainty, "config": config,
    }  # fmt: skip
    save_regions(path, networks, facts)


def save_regions(path: Path, networks: Sequence[RegionTransformer], facts: dict[str, Any]) -> None:
    """Write networks, one along the first axis; of matrices bytes, and a step for every row."""
    from safetensors.numpy import save_file

    states = [network.state_dict() for network in networks]
    stacked = {
        name: torch.stack([state[name].cpu() for state in states]).float().numpy()
        for name in states[0]
    }
    told = {name: json.dumps(fact) for name, fact in facts.items()}
    save_file(packed(stacked, axes=3), path, metadata=told)


@torch.inference_mode()
def shares_of(
    networks: Sequence[RegionTransformer],
    sampler: RegionSampler,
    sets: np.ndarray,
    sentences: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Mean shares (n, R, K) of sets as they are, the null clause first, and what is wanted."""
    at = [torch.tensor(index, device=sampler.device) for index in (sets, sentences)]
    batch = sampler.batch(at[0], at[1], varied=False)
    shares = torch.stack([one(batch).softmax(dim=-1) for one in networks]).mean(dim=0)
    return shares.cpu().numpy(), batch.wanted.cpu().numpy()
