"""Training of the image network: every pixel near the words for its material, part and object.

A pixel's vector is compared with the sentence embeddings of all texts of one sort (kinds of
material, names of materials, of parts, of objects); the loss is the cross entropy against the text
of its part, softened towards texts that mean the same.
"""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .corpus import Corpus
from .kinds import KINDS
from .network import STRIDE, Weights, Widths, head, new_weights, trunk
from .pictures import STILL, Pictures, Variety, draw_pictures
from .probe import Regions

if TYPE_CHECKING:
    import torch

log = logging.getLogger(__name__)

SORTS = ("kind", "material", "part", "object")  # columns of ``Corpus.words``
BACKBONE = ("stem", "stage")
MOMENTS = (0.9, 0.98)  # of the gradient and of its square: a short run has no time for .999
LONGEST_GRADIENT = 1.0
SAME = 0.05  # temperature of the similarity between texts that count as the same
FIRST_SCALE = 14.0  # logit scale at the start, 1 / 0.07 as in CLIP
LARGEST_SCALE = 60.0
REGION_CELLS = 6  # output cells that a region needs for its mean to count


@dataclass(frozen=True)
class TrainingOptions:
    """Options of one training run; ``steps`` is the whole schedule, also when it is resumed."""

    steps: int = 6000
    batch: int = 96
    side: int = 160
    pixels: int = 64  # pixels a picture that enter the loss
    rate: float = 1.5e-3
    backbone_rate: float = 0.2  # of the stem and the stages, relative to ``rate``
    warmup: int = 300
    decay: float = 0.05
    drop: float = 0.15
    average: float = 0.998  # of the weights, per step
    sorts: tuple[float, ...] = (1.0, 0.5, 0.3, 0.3)  # weight of each sort of text in the loss
    seed: int = 0
    variety: Variety = field(default_factory=Variety)
    widths: Widths = field(default_factory=Widths)


class State(NamedTuple):
    """Everything a run needs to go on exactly: all tensors, by name, and the next step."""

    weights: Weights
    average: Weights
    first: Weights
    second: Weights
    step: int


def new_state(options: TrainingOptions, device: str, start: Weights | None = None) -> State:
    """Return the state before the first step; ``start`` replaces some of the random weights."""
    import torch

    weights = new_weights(options.widths, seed=options.seed) | (start or {})
    weights["scale"] = torch.full((len(SORTS),), float(np.log(FIRST_SCALE)))
    weights = {key: value.to(device) for key, value in weights.items()}
    zeros = [{k: torch.zeros_like(v) for k, v in weights.items()} for _ in range(2)]
    return State(weights, {k: v.clone() for k, v in weights.items()}, *zeros, step=0)


def save_state(state: State, path: str | Path) -> None:
    """Write a state as safetensors."""
    from safetensors.torch import save_file

    groups = {name: getattr(state, name) for name in State._fields[:-1]}
    tensors = {f"{name}/{k}": v.contiguous() for name, g in groups.items() for k, v in g.items()}
    save_file(tensors, str(path), metadata={"step": str(state.step)})


def load_state(path: str | Path, device: str) -> State:
    """Read a state; training goes on from its step."""
    from safetensors import safe_open

    groups: dict[str, Weights] = {name: {} for name in State._fields[:-1]}
    with safe_open(str(path), framework="pt", device=device) as file:
        step = int(file.metadata()["step"])
        for key in file.keys():
            name, _, weight = key.partition("/")
            groups[name][weight] = file.get_tensor(key)
    return State(**groups, step=step)


def train(
    corpus: Corpus,
    options: TrainingOptions,
    state: State | None = None,
    *,
    seconds: float = float("inf"),
    until: int | None = None,
) -> State:
    """Run steps until the schedule, ``until`` or the time is over, and return the new state.

    A step draws all its chances from generators seeded by ``options.seed`` and its own number, so
    that an interrupted and resumed run is the run itself.
    """
    import torch

    device = corpus.colour.device
    state = state or new_state(options, str(device))
    targets = _targets(corpus)
    last = min(options.steps, until if until is not None else options.steps)
    started = time.perf_counter()
    for step in range(state.step, last):
        if time.perf_counter() - started > seconds:
            break
        torch.manual_seed(options.seed * 1_000_003 + step)
        generator = torch.Generator(device).manual_seed(options.seed * 1_000_003 + step)
        weights = {k: v.detach().requires_grad_() for k, v in state.weights.items()}
        index = _draw(corpus, options.batch, generator)
        pictures = draw_pictures(
            corpus, index, variety=options.variety, side=options.side, generator=generator
        )
        loss = _loss(weights, pictures, corpus, targets, options, generator)
        gradients = torch.autograd.grad(loss, list(weights.values()))
        state = _adam(state, dict(zip(weights, gradients, strict=True)), options)
        if step % 250 == 0:
            log.info("step %d of %d: loss %.4f", step, options.steps, loss.item())
    return state


def shipped_weights(state: State, start: Weights | None = None, *, share: float = 1.0) -> Weights:
    """The averaged weights of the network alone, in half precision, the backbone as a change.

    The backbone in use is ``share`` of the way from ``start``, which stays in its own package, to
    the trained one (Wortsman et al. 2022, WiSE-FT): on objects unlike the training ones both ends
    are worse. What is returned for it is that change; without ``start`` the weights themselves.
    """
    start = start or {}
    weights = {k: v for k, v in state.average.items() if k != "scale"}
    changes = {k: share * (v - start[k]) if k in start else v for k, v in weights.items()}
    return {k: v.half().contiguous() for k, v in changes.items()}


class _Target(NamedTuple):
    """Texts of one sort: ``rows`` in the corpus, soft targets (n, n), class weights (n,)."""

    rows: torch.Tensor
    soft: torch.Tensor
    weight: torch.Tensor
    column_of: torch.Tensor  # (parts,): column of a part's text, -1 without one


def _targets(corpus: Corpus) -> list[_Target]:
    """Targets of every sort; kinds weigh by how rare they are, so that no kind is forgotten."""
    import torch

    targets = []
    for sort in range(len(SORTS)):
        words = corpus.words[:, sort]
        rows, column_of = torch.unique(words[words >= 0], return_inverse=True)
        columns = torch.full_like(words, -1)
        columns[words >= 0] = column_of
        embedding = corpus.embeddings[rows]
        soft = torch.softmax((embedding @ embedding.T - 1) / SAME, dim=1)
        if sort == 0:
            soft = torch.eye(len(rows), device=soft.device)
        count = torch.bincount(column_of, minlength=len(rows)).float()
        weight = (count.mean() / count) ** 0.5
        targets.append(_Target(rows, soft, weight, columns))
    return targets


def _draw(corpus: Corpus, count: int, generator: torch.Generator) -> torch.Tensor:
    import torch

    pictures = len(corpus.colour)
    return torch.randint(pictures, (count,), generator=generator, device=corpus.colour.device)


def _loss(
    weights: Weights,
    pictures: Pictures,
    corpus: Corpus,
    targets: list[_Target],
    options: TrainingOptions,
    generator: torch.Generator,
) -> torch.Tensor:
    """Cross entropy of single pixels and of the means of regions."""
    import torch

    device = pictures.images.device
    with torch.autocast(device.type, torch.bfloat16, enabled=device.type == "cuda"):
        features = trunk(weights, pictures.images, drop=options.drop).permute(0, 2, 3, 1)
        part = cell_parts(pictures.part)
        picked = _pick(part, options.pixels, generator)
        pixel_features = features.reshape(-1, features.shape[-1])[picked]
        means, mean_part = _region_means(features, part)
        vectors = head(weights, torch.cat([pixel_features, means]))
    parts = torch.cat([part.reshape(-1)[picked], mean_part])
    total = vectors.new_zeros(())
    scale = weights["scale"].exp().clamp(max=LARGEST_SCALE)
    for sort, target in enumerate(targets):
        column = target.column_of[parts]
        known = column >= 0
        logits = scale[sort] * vectors[known] @ corpus.embeddings[target.rows].T
        column = column[known]
        errors = -(target.soft[column] * torch.log_softmax(logits, dim=1)).sum(dim=1)
        weight = target.weight[column]
        total = total + options.sorts[sort] * (errors * weight).sum() / weight.sum().clamp(min=1)
    return total


def cell_parts(part: torch.Tensor) -> torch.Tensor:
    """Part (n, h/4, w/4) at the middle of every output cell."""
    return part[:, STRIDE // 2 :: STRIDE, STRIDE // 2 :: STRIDE]


def _pick(part: torch.Tensor, per_picture: int, generator: torch.Generator) -> torch.Tensor:
    """Flat indices of object cells, small parts more often than their size."""
    import torch

    n = len(part)
    count = int(part.max()) + 1
    flat = (part + torch.arange(n, device=part.device)[:, None, None] * count).reshape(-1)
    _, inverse, area = torch.unique(flat, return_inverse=True, return_counts=True)
    weight = (part.reshape(-1) > 0) / area[inverse].sqrt()
    return torch.multinomial(weight, n * per_picture, replacement=True, generator=generator)


def _region_means(
    features: torch.Tensor, part: torch.Tensor, smallest: int = REGION_CELLS
) -> tuple[torch.Tensor, torch.Tensor]:
    """Mean feature and part of every part in every picture that has enough cells."""
    import torch

    n = len(part)
    count = int(part.max()) + 1
    flat = (part + torch.arange(n, device=part.device)[:, None, None] * count).reshape(-1)
    key, inverse, area = torch.unique(flat, return_inverse=True, return_counts=True)
    sums = torch.zeros(len(key), features.shape[-1], device=part.device, dtype=torch.float32)
    sums = sums.index_add(0, inverse, features.reshape(-1, features.shape[-1]).float())
    keep = (key % count > 0) & (area >= smallest)
    return (sums / area[:, None])[keep], (key % count)[keep]


def _adam(state: State, gradients: Weights, options: TrainingOptions) -> State:
    """AdamW (Loshchilov and Hutter 2019), cosine schedule with warm-up, and averaging."""
    import torch

    step = state.step + 1
    rate = options.rate * min(step / options.warmup, 1.0)
    rate *= 0.5 * (1 + np.cos(np.pi * step / (options.steps + 1)))
    fade = min(options.average, step / (step + 10))
    norm = torch.stack([gradients[name].norm() for name in sorted(gradients)]).norm()
    shorten = 1 / norm.clamp(min=LONGEST_GRADIENT)
    groups: list[Weights] = [{}, {}, {}, {}]
    for name, gradient in gradients.items():
        g, x = gradient.float().contiguous() * shorten, state.weights[name].detach()
        m = state.first[name].lerp(g, 1 - MOMENTS[0])
        v = state.second[name].lerp(g * g, 1 - MOMENTS[1])
        slope = m / (1 - MOMENTS[0] ** step)
        spread = (v / (1 - MOMENTS[1] ** step)).sqrt() + 1e-8
        own = rate * (options.backbone_rate if name.startswith(BACKBONE) else 1.0)
        x = x * (1 - own * options.decay * (x.ndim > 1)) - own * slope / spread
        for group, value in zip(
            groups, (x, state.average[name].lerp(x, 1 - fade), m, v), strict=True
        ):
            group[name] = value
    return State(*groups, step=step)


def region_features(
    weights: Weights, corpus: Corpus, *, kinds: tuple[str, ...], side: int, smallest: int
) -> Regions:
    """Mean vector of the cells of one kind of material in each plain view of a corpus.

    Only ``kinds`` count, and only regions of at least ``smallest`` cells.
    """
    import torch

    device = corpus.colour.device
    wanted = torch.full((len(KINDS) + 1,), -1, device=device)  # the last: kind unknown
    for label, kind in enumerate(kinds):
        wanted[KINDS.index(kind)] = label
    rows: list[tuple[torch.Tensor, ...]] = []
    weights = {key: value.float() for key, value in weights.items()}
    generator = torch.Generator(device)
    for index in torch.arange(len(corpus.colour), device=device).split(64):
        drawn = draw_pictures(corpus, index, variety=STILL, side=side, generator=generator)
        with torch.no_grad():
            vectors = head(weights, trunk(weights, drawn.images).permute(0, 2, 3, 1))
        part = cell_parts(drawn.part)
        label = wanted[corpus.words[part, 0]]
        region = torch.where(label >= 0, corpus.object_of[part] * len(kinds) + label + 1, 0)
        means, key = _region_means(vectors, region, smallest)
        rows.append((means.cpu(), ((key - 1) % len(kinds)).cpu(), ((key - 1) // len(kinds)).cpu()))
    return Regions(*(torch.cat(column).numpy() for column in zip(*rows, strict=True)))
