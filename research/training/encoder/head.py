"""Fit the head of the image network: regression of the embedding of words on frozen features.

A region (the pixels of one part in one picture) has the mean of every level of the network, and the
words of its material, part and object. The head is the linear map from the one to the other with
the least squared error and a penalty on its size (ridge), in closed form. Training the network
itself, by contrast, lost on unseen objects what ImageNet had taught it: there are few objects.

Of that map only its main directions are kept. Beside it the head keeps what is plainly seen: colour
and opacity, and the main directions in which the frozen features differ, fitted to no words at all.
They lie in the directions of the space that words hardly use: a cosine to a word stays what it was,
and a linear classifier finds all three.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ....predictors.encoders.plain import LENGTH, STRIDE, Weights, Widths, levels
from .corpus import Corpus
from .pictures import NO_VARIETY, Variety, draw_pictures

if TYPE_CHECKING:
    import torch

log = logging.getLogger(__name__)

SORTS = ("kind", "material", "part", "object")  # columns of ``Corpus.words``
BATCH = 16  # pictures at once
KEPT = 6  # first channels of ``network.colours`` that are kept as they are
FLAT = 1e-6  # a feature that varies less than this counts for nothing


@dataclass(frozen=True)
class HeadOptions:
    """How the head is fitted."""

    side: int = 288  # pixels along a picture
    # How often every picture is seen in another light and place, after once as it is: one, two or
    # four times changed the cross-validated accuracy by less than .003.
    rounds: int = 0
    smallest: int = 12  # output cells that a region needs: 200 pixels
    # Relative to the mean variance of a feature: much less, and the head knows its own objects too
    # well; much more, and it cannot tell words apart.
    penalty: float = 10.0
    # A penalty draws every answer to the mean one, which is near to common words: this factor
    # on what differs from it takes the words' nearness back to that of the features.
    gain: float = 30.0
    rank: int = 10  # directions that the part for words keeps
    directions: int = 8  # main directions of the frozen features that are kept as they are
    plain: float = 0.5  # length of what is plainly seen, beside words with their length of 1
    balance: float = 0.5  # power of a text's rarity in the weight of its regions
    sorts: tuple[float, ...] = (1.0, 1.0, 0.3, 0.3)  # share of each sort of words
    seed: int = 0
    variety: Variety = field(default_factory=Variety)


class RegionFeatures(NamedTuple):
    """Regions: features (n, d), and the row (n,) of each in the part tables of the corpus."""

    features: np.ndarray
    part: np.ndarray


class Linear(NamedTuple):
    """The map x @ matrix + bias, matrix (d, D), bias (D,)."""

    matrix: np.ndarray
    bias: np.ndarray

    def __call__(self, x: Float[np.ndarray, "n d"]) -> Float[np.ndarray, "n D"]:
        """Apply it."""
        return x @ self.matrix + self.bias


class Head(NamedTuple):
    """``read`` (d, m) numbers off features: first coordinates along ``axes``, then plain ones.

    ``axes`` (D, r) from ``centre`` (D,) lie among words, ``across`` (D, m - r + 1) does not.
    """

    read: Linear
    axes: np.ndarray
    centre: np.ndarray
    across: np.ndarray

    def __call__(self, x: Float[np.ndarray, "n d"]) -> Float[np.ndarray, "n D"]:
        """Unit vectors, as ``network.head`` computes them."""
        found, count = self.read(x), self.axes.shape[1]
        said = found[:, :count] @ self.axes.T + self.centre
        said = said / np.linalg.norm(said, axis=1, keepdims=True)
        plain = found[:, count:]
        missing = LENGTH**2 - 1 - (plain**2).sum(axis=1, keepdims=True)
        filled = np.concatenate([plain, np.sqrt(missing.clip(min=0))], axis=1)
        total = said + filled @ self.across.T
        return total / np.linalg.norm(total, axis=1, keepdims=True)


def region_features(corpus: Corpus, backbone: Weights, options: HeadOptions) -> RegionFeatures:
    """Mean features of every region of the corpus, as rendered and in other lights."""
    import torch

    device = corpus.colour.device
    rows: list[RegionFeatures] = []
    for turn in range(1 + options.rounds):
        generator = torch.Generator(device).manual_seed(options.seed + turn)
        variety = options.variety if turn else NO_VARIETY
        for index in torch.arange(len(corpus.colour), device=device).split(BATCH):
            drawn = draw_pictures(
                corpus, index, variety=variety, side=options.side, generator=generator
            )
            with torch.inference_mode():
                found = levels(backbone, drawn.images)
            rows.append(region_means(found, drawn.part, smallest=options.smallest))
        log.info("round %d of %d: %d regions", turn, options.rounds, sum(len(r.part) for r in rows))
    return RegionFeatures(*(np.concatenate(column) for column in zip(*rows, strict=True)))


def region_means(found: list[torch.Tensor], part: torch.Tensor, *, smallest: int) -> RegionFeatures:
    """Mean of all levels (n, c, h, w) over every part of every picture that has enough cells.

    A cell of a coarse level counts as much as it is covered by the part.
    """
    import torch
    import torch.nn.functional as F

    cells = part[:, STRIDE // 2 :: STRIDE, STRIDE // 2 :: STRIDE]
    rows, parts = [], []
    for picture, shown in enumerate(cells):
        name, area = torch.unique(shown, return_counts=True)
        name = name[(name > 0) & (area >= smallest)]
        mask = (shown == name[:, None, None]).float()
        means = []
        for level in found:
            size = (level.shape[2], level.shape[3])
            cover = F.adaptive_avg_pool2d(mask[None], size)[0].flatten(1)
            cover = cover / cover.sum(dim=1, keepdim=True)
            means.append(cover @ level[picture].flatten(1).T)
        rows.append(torch.cat(means, dim=1).cpu().numpy())
        parts.append(name.cpu().numpy())
    return RegionFeatures(np.concatenate(rows), np.concatenate(parts))


def fit_head(
    regions: RegionFeatures,
    corpus: Corpus,
    groups: tuple[int, ...],
    options: HeadOptions,
    *,
    use: Bool[np.ndarray, "n"] | None = None,
) -> Head:
    """Head fitted on the regions ``use`` (all by default).

    ``groups`` are the numbers of features that belong together, the channels of each level: the
    penalty is the same for each group as a whole. The first group is the colours.
    """
    use = np.ones(len(regions.part), dtype=bool) if use is None else use
    spread = regions.features[use].std(axis=0, dtype=np.float64)
    scale = np.where(spread > FLAT, spread * np.sqrt(np.repeat(groups, groups)), np.inf)
    mean = regions.features[use].mean(axis=0, dtype=np.float64)
    x = (regions.features - mean) / scale
    said = _said(x, regions.part, corpus, options, use)
    free = free_directions(corpus.embeddings.cpu().numpy(), KEPT + options.directions + 1)
    said = Linear(*(part - part @ free @ free.T for part in said))
    axes = principal(x[use] @ said.matrix, options.rank)
    plain = _plain(x[use], groups[0], options)
    matrix = np.concatenate([said.matrix @ axes, plain], axis=1) / scale[:, None]
    return Head(Linear(matrix, -mean @ matrix), axes, said.bias, free)


def _said(
    x: Float[np.ndarray, "n d"],
    part: Int[np.ndarray, "n"],
    corpus: Corpus,
    options: HeadOptions,
    use: Bool[np.ndarray, "n"],
) -> Linear:
    """Map of centred features to the sum over the sorts of words."""
    words, embeddings = corpus.words.cpu().numpy(), corpus.embeddings.cpu().numpy()
    total = Linear(np.zeros((x.shape[1], embeddings.shape[1])), np.zeros(embeddings.shape[1]))
    for sort, share in enumerate(options.sorts):
        text = words[part, sort]
        rows = use & (text >= 0)
        if not rows.any():
            continue
        weight = _rarity(text[rows]) ** options.balance
        found = ridge(x[rows], embeddings[text[rows]], weight, penalty=options.penalty)
        total = Linear(total.matrix + share * found.matrix, total.bias + share * found.bias)
    return Linear(options.gain * total.matrix, total.bias)


def _plain(
    x: Float[np.ndarray, "n d"], colours: int, options: HeadOptions
) -> Float[np.ndarray, "d m"]:
    """Map of centred features to the first colours and the main directions of the others.

    Either has half of the squared length ``options.plain`` ** 2, or all of it alone.
    """
    kept = np.eye(x.shape[1])[:, :KEPT]
    main = np.zeros((x.shape[1], options.directions))
    main[colours:] = principal(x[:, colours:], options.directions)
    parts = [part for part in (kept, main) if part.shape[1]]
    length = options.plain / np.sqrt(len(parts))
    sizes = [np.sqrt(((x @ part) ** 2).sum(axis=1).mean()) for part in parts]
    pairs = zip(parts, sizes, strict=True)
    return np.concatenate([length / max(size, FLAT) * part for part, size in pairs], axis=1)


def principal(rows: Float[np.ndarray, "n D"], count: int) -> Float[np.ndarray, "D count"]:
    """Orthonormal directions in which centred rows vary most, the strongest first."""
    _, axes = np.linalg.eigh(rows.T.astype(np.float64) @ rows)
    return axes[:, ::-1][:, :count]


def free_directions(
    embeddings: Float[np.ndarray, "texts D"], count: int
) -> Float[np.ndarray, "D count"]:
    """Orthonormal directions that hold least of the embeddings of texts."""
    _, axes = np.linalg.eigh(embeddings.T.astype(np.float64) @ embeddings)
    return axes[:, :count]


def ridge(
    x: Float[np.ndarray, "n d"],
    wanted: Float[np.ndarray, "n D"],
    weight: Float[np.ndarray, "n"],
    *,
    penalty: float,
) -> Linear:
    """Weighted least squares with a penalty, relative to the mean variance of a feature."""
    weight = weight / weight.sum()
    mean, centre = weight @ x, weight @ wanted
    root = np.sqrt(weight)[:, None]
    a, b = root * (x - mean), root * (wanted - centre)
    gram = a.T @ a
    gram += penalty * np.trace(gram) / len(gram) * np.eye(len(gram))
    matrix = np.linalg.solve(gram, a.T @ b)
    return Linear(matrix, centre - mean @ matrix)


def shipped_weights(fitted: Head, widths: Widths) -> Weights:
    """The weights by the names of ``network.head``, in half precision."""
    import torch

    ends = np.cumsum(widths.groups)
    maps = {
        f"head.{number}.weight": fitted.read.matrix[end - size : end].T
        for number, (size, end) in enumerate(zip(widths.groups, ends, strict=True))
    }
    maps |= {"head.bias": fitted.read.bias, "plain.axes": fitted.across}
    maps |= {"words.axes": fitted.axes, "words.centre": fitted.centre}
    return {k: torch.from_numpy(np.ascontiguousarray(v)).half() for k, v in maps.items()}


def _rarity(text: Int[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
    """One over the number of regions that have the same text."""
    _, inverse, count = np.unique(text, return_inverse=True, return_counts=True)
    return 1.0 / count[inverse]
