"""Table S5: an agent with a simulator, against a network that answers once.

The truth of a part is a matter that its word ("leg") leaves open: a row of the table and a place in
its ranges, both by chance, which nobody is told. Both sides know the words alone; the agent's first
proposal is the mean of what they leave open. **It then sees the true body at rest under its load;
the network sees no motion**: the table says what a measurement is worth, and what it costs.
UniPixie's agent saw its own simulations alone (C.4); ours would find nothing wrong with those of a
table, and stay with its first proposal, the row of words.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Int

from ....fem.errors import ConvergenceError
from ....predictors.unipixie.network import UniPixie, Voxels, known_of
from ....predictors.unipixie.predictor import ANY, WEIGHTS, load_unipixie, one_torch_thread
from ...datasets.objects import HELD_OUT, make_objects
from ...datasets.ranges import RangeTable
from ...datasets.shapes import EMPTY, MAX_PARTS
from ...training.stores import procedural_labels
from ...training.unipixie.batch import spread_parts, voxel_places
from ...training.unipixie.names_on_device import Names, rgb_of_lab
from ..metrics import Interval, bootstrap_interval
from ..sag_render import PIXELS, SagRender
from .agent import Belief, PartValues, correct_by_simulation
from .networks import SCORED_SEED, SPLITS, Split

log = logging.getLogger(__name__)

SIGHT = 0.1 / PIXELS  # of the longest side: points are followed to a tenth of a pixel, about
NARROWEST = 1e-2  # spread of a prior at least, where a word leaves next to nothing open
SURE_COLOUR = 100.0  # a spread of CIE L*a*b* above which the table knows no colour
# Of the UniPixie supplement: seconds, error of log E, PSNR [dB].
PAPER_S5 = {"VLM-Strong": (1551.1, 1.038, 27.7), "UniPixie": (12.1, 0.009, 30.8)}


class FeedbackRow(NamedTuple):
    """One row on one split: means over objects with 95 % bootstrap intervals.

    ``cpu_seconds`` are those of an answer; ``mse_E`` is of normalised log E over the voxels; PSNR
    [dB] and SSIM compare the motions of the body that is found with those of the true one;
    ``rounds`` of correction were simulated; ``left_out`` objects have no solution at rest.
    """

    row: str
    split: Split
    objects: int
    left_out: int
    cpu_seconds: float
    mse_E: float
    mse_E_interval: Interval
    psnr: float
    psnr_interval: Interval
    ssim: float
    ssim_interval: Interval
    rounds: float


class Riddle(NamedTuple):
    """An object: part of every voxel (-1 outside), its truth, what words and colours say of it.

    ``bare`` and ``coloured`` (1, parts, given) are what the network reads.
    """

    part: Int[np.ndarray, "x y z"]
    truth: PartValues
    belief: Belief
    bare: torch.Tensor
    coloured: torch.Tensor


class _Answered(NamedTuple):
    values: PartValues
    rounds: int = 0


_Answer = Callable[[Riddle, SagRender, np.random.Generator], _Answered]


def feedback_table(
    *,
    ranges: Path,
    objects: int = 64,
    weights: Path = WEIGHTS,
    progress: Callable[[str], None] | None = None,
) -> list[FeedbackRow]:
    """Score every row on ``objects`` new objects of categories seen and of others.

    Parameters
    ----------
    ranges
        File of the table of ranges.
    objects
        How many of each split.
    weights
        Of the network.
    progress
        Called with the object that is next.
    """
    names, network = Names(RangeTable.load(ranges), "cpu"), load_unipixie(weights).network
    answers: dict[str, _Answer] = {
        "words alone": lambda riddle, _, dice: _Answered(riddle.belief.mean),
        "agent": _agent,
        "network, words": lambda riddle, *_: _Answered(
            likeliest_parts(network, riddle.part, riddle.bare)
        ),
        "network, words and colours": lambda riddle, *_: _Answered(
            likeliest_parts(network, riddle.part, riddle.coloured)
        ),
    }
    rows = []
    for split in SPLITS:
        scores: dict[str, list[tuple[float, ...]]] = {row: [] for row in answers}
        for number, riddle in enumerate(riddles(names, objects, network.config.cells, split)):
            if progress:
                progress(f"{split}, object {number + 1}")
            for row, score in _scored(riddle, answers, number).items():
                scores[row].append(score)
        rows += [_row(row, split, objects, np.array(found)) for row, found in scores.items()]
    return rows


def riddles(names: Names, count: int, cells: int, split: Split) -> Iterator[Riddle]:
    """Draw so many objects whose parts are called by words, each with a truth of its own."""
    categories = list(HELD_OUT) if split == "unseen" else None
    made = make_objects(count, np.random.default_rng(SCORED_SEED), names=categories)
    dice = torch.Generator().manual_seed(SCORED_SEED)
    labels = procedural_labels(made, cells=cells, device="cpu")

    def chance(*more: int) -> torch.Tensor:
        return torch.rand(MAX_PARTS, *more, generator=dice)

    for label, kinds in zip(labels, torch.tensor(made.kinds), strict=True):
        # A word that leaves one row open counts as named; the truth is anywhere in the row.
        name = names.plain(kinds, chance())
        name = torch.where(name < 0, names.named(kinds, chance()), name)
        row = names.choose_row(name, chance())
        truth = names.low[row] + (names.high[row] - names.low[row]) * chance(3)
        typical, spread = names.colour[row].split([3, 1], -1)
        colour = rgb_of_lab(typical + spread / 3**0.5 * torch.randn(MAX_PARTS, 3, generator=dice))
        inside = label != EMPTY
        there, part = label[inside].long().unique(return_inverse=True)
        field = np.full(label.shape, -1)
        field[inside.numpy()] = part.numpy()
        words, said = names.embed(name[there])[None], (name[there] >= 0)[None]
        shown, shade = said & (spread[there, 0] < SURE_COLOUR), colour[there][None]
        yield Riddle(
            field, truth[there].numpy().astype(float), belief_of(names, name[there]),
            known_of(words, said, shade, torch.zeros_like(shown)),
            known_of(words, said, shade, shown),
        )  # fmt: skip


def belief_of(names: Names, name: torch.Tensor) -> Belief:
    """Mean and spread of a row by chance and a place in it by chance, for each name (parts,)."""
    rows = names.rows[name.clamp(min=0)]
    low, high = names.low[rows.clamp(min=0)].double(), names.high[rows.clamp(min=0)].double()
    share = (rows >= 0).double()[..., None] / (rows >= 0).sum(1)[:, None, None]
    mean = (share * (low + high) / 2).sum(1)
    square = (share * ((high - low) ** 2 / 12 + ((low + high) / 2 - mean[:, None]) ** 2)).sum(1)
    ends = (end.double().numpy() for end in names.span(name))
    return Belief(mean.numpy(), np.maximum(np.sqrt(square.numpy()), NARROWEST), *ends)


@torch.inference_mode()
@one_torch_thread()
def likeliest_parts(
    network: UniPixie, part: Int[np.ndarray, "x y z"], known: torch.Tensor
) -> PartValues:
    """Mean of what the network finds plausible of every part, of which so much is ``known``."""
    label = torch.tensor(np.where(part < 0, EMPTY, part), dtype=torch.uint8)[None]
    cube = spread_parts(network.project(known), label)
    at = torch.tensor(np.flatnonzero(part >= 0))
    own = cube.flatten(1, 3)[:, at]
    voxels = Voxels(cube.movedim(-1, 1), voxel_places(at, label.shape[-1])[None], own)
    start = torch.zeros(1, len(at), 3)  # the noise's middle, from where an x1-prediction is a mean
    latents = network.encode(voxels)
    values, _ = network.sample_matter(latents, voxels, torch.tensor([ANY]), start, steps=1)
    inside, found = part[part >= 0], values[0].double().numpy()
    total = np.stack([np.bincount(inside, v) for v in found.T], axis=1)
    return total / np.bincount(inside)[:, None]


def _agent(riddle: Riddle, body: SagRender, dice: np.random.Generator) -> _Answered:
    """What the agent finds who sees the true body at rest, as sharply as ``SIGHT``."""
    sight = SIGHT * body.size
    seen = body.sag(_spread(riddle.truth, riddle.part))
    seen = seen + dice.normal(scale=sight, size=seen.shape)

    def simulate(values: PartValues) -> np.ndarray:
        return body.sag(_spread(values, riddle.part))

    found = correct_by_simulation(simulate, seen, riddle.belief, sight=sight)
    return _Answered(found.values, found.rounds)


def _spread(values: PartValues, part: Int[np.ndarray, "x y z"]) -> np.ndarray:
    """Values of parts on the voxels (x, y, z, 3), zero outside."""
    return np.where((part >= 0)[..., None], values[part], 0.0)


def _scored(riddle: Riddle, answers: dict[str, _Answer], seed: int) -> dict[str, tuple]:
    """CPU seconds, error of log E, PSNR, SSIM and rounds of every row; none without a solution."""
    inside, scores = riddle.part[riddle.part >= 0], {}
    try:
        body = SagRender(riddle.part, _spread(riddle.truth, riddle.part), swing=True)
        for row, answer in answers.items():
            began = time.process_time()
            found = answer(riddle, body, np.random.default_rng(seed))
            spent = time.process_time() - began
            wrong = ((found.values - riddle.truth)[inside, 0] ** 2).mean()
            alike = body.similarity(_spread(found.values, riddle.part))
            scores[row] = (spent, wrong, *alike, found.rounds)
    except ConvergenceError as error:
        log.warning("an object is left out: %s", error)
        return {}
    return scores


def _row(row: str, split: Split, objects: int, scores: np.ndarray) -> FeedbackRow:
    seconds, wrong, psnr, ssim, rounds = scores.T
    pairs = [(float(v.mean()), bootstrap_interval(v)) for v in (wrong, psnr, ssim)]
    return FeedbackRow(
        row, split, len(scores), objects - len(scores), float(seconds.mean()), *pairs[0],
        *pairs[1], *pairs[2], float(rounds.mean()),
    )  # fmt: skip
