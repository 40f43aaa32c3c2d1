"""Batches for training, made on the device: objects, what is known of their parts, and the truth.

Shapes come from stores; names, colours and features of parts are drawn anew for each sample.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from ....predictors.unipixie.network import coherent_noise, known_of
from ....predictors.unipixie.predictor import ANY
from ...datasets.shapes import EMPTY, MAX_PARTS
from ..film.augmentation import shrunk, turned
from ..film.simulated_evidence import blurred
from .batch import MatterBatch
from .config import EvidenceShares, MatterConfig
from .names_on_device import Names, rgb_of_lab

_STRANGE_LIGHT = 0.12  # deviation of all colours of an object in [0, 1]


class Shapes(NamedTuple):
    """Labelled cubes (n, x, y, z) with kinds of part (n, 6), or rows and colours of real slots.

    What is not known is -1, colours NaN.
    """

    label: Tensor
    kind: Tensor
    row: Tensor
    colour: Tensor


class MatterSampler:
    """Draws batches; ``real`` may be None."""

    def __init__(
        self, names: Names, shapes: Shapes, real: Shapes | None, config: MatterConfig, seed: int
    ) -> None:
        self.names, self.shapes, self.real, self.config = names, shapes, real, config
        self.device = shapes.label.device
        self.generator = torch.Generator(self.device).manual_seed(seed)
        self.kinds = shapes.kind[shapes.kind >= 0].unique()

    def _rand(self, *shape: int) -> Tensor:
        return torch.rand(shape, generator=self.generator, device=self.device)

    def _normal(self, *shape: int) -> Tensor:
        return torch.randn(shape, generator=self.generator, device=self.device)

    def draw(self, n: int) -> MatterBatch:
        """Draw a batch of ``n`` objects."""
        return self.compose(self.some(n))

    def some(self, n: int) -> Shapes:
        """Draw ``n`` objects, turned."""
        wanted = round(n * self.config.real) if self.real is not None else 0
        items = [self._take(self.shapes, n - wanted)]
        if wanted and self.real is not None:
            real = self._take(self.real, wanted)
            items.append(real._replace(label=shrunk(real.label, self.generator)))
        item = Shapes(*(torch.cat(columns) for columns in zip(*items, strict=True)))
        return item._replace(label=turned(item.label, self.generator))

    def _take(self, shapes: Shapes, n: int) -> Shapes:
        index = (self._rand(n) * len(shapes.label)).long()
        return Shapes(*(column[index] for column in shapes))

    def compose(self, item: Shapes, alpha: Tensor | None = None) -> MatterBatch:
        """Give objects names, colours, features and a truth; ``alpha`` (n,) is drawn by default."""
        n, config = len(item.label), self.config
        name = self._names(item)
        row = self.names.choose_row(name, self._rand(n, MAX_PARTS))
        alpha = self._alpha(n) if alpha is None else alpha
        voxel = self._voxels(item.label, name >= 0)
        part = item.label.flatten(1).gather(1, voxel).long().clamp(max=MAX_PARTS - 1)

        asked = (alpha == ANY)[:, None]
        matter = torch.where(asked, self.names.matter[row], self.names.usual_matter(name))
        return MatterBatch(
            label=item.label,
            known=self._known(item, name, row),
            alpha=alpha,
            time=self._times(n),
            start=self.noise(part, self.generator),
            end=_there(self._truth(name, row, alpha), part),
            matter=matter.gather(1, part),
            voxel=voxel,
            part=part,
            counts=(name >= 0).gather(1, part),
            shake=self._normal(*item.label.shape, config.network.features),
        )

    def noise(self, part: Tensor, generator: torch.Generator) -> Tensor:
        """Where flows begin (n, K, 3): most of it the same in all voxels of a ``part`` (n, K)."""
        n, count = part.shape
        shape = (n, MAX_PARTS + count, 3)
        drawn = torch.randn(shape, generator=generator, device=self.device)
        shared = _there(drawn[:, :MAX_PARTS], part)
        return coherent_noise(shared, drawn[:, MAX_PARTS:])

    def _names(self, item: Shapes) -> Tensor:
        """Name of every part (n, 6), -1 where its matter is not known."""
        n, share = len(item.label), self.config.evidence
        chance, u = self._rand(n, MAX_PARTS), self._rand(n, MAX_PARTS)
        others = self.kinds[(self._rand(n, MAX_PARTS) * len(self.kinds)).long()]
        swapped = self._rand(n, MAX_PARTS) < share.swapped
        kind = torch.where(swapped & (item.kind >= 0), others, item.kind)
        named = self.names.named(kind, u)
        strange = self.names.strange(kind, u)
        made = torch.where(chance < share.named + share.foreign, strange, self.names.plain(kind, u))
        made = torch.where((chance < share.named) & (named >= 0), named, made)
        return torch.where(item.kind >= 0, made, self.names.of_row(item.row, u))

    def _alpha(self, n: int) -> Tensor:
        """Places in the range, the ends and the middle more often, or ``ANY`` (n,)."""
        if self.config.midpoint:
            return torch.full((n,), 0.5, device=self.device)
        fixed = (self._rand(n) * 3).long() / 2
        alpha = torch.where(self._rand(n) < 0.5, fixed, self._rand(n))
        return torch.where(self._rand(n) < self.config.evidence.any, ANY, alpha)

    def _times(self, n: int) -> Tensor:
        """Times of the flow: logit-normal, some at its start (n,)."""
        time = self._normal(n).sigmoid()
        return torch.where(self._rand(n) < self.config.evidence.at_start, 0.0, time)

    def _truth(self, name: Tensor, row: Tensor, alpha: Tensor) -> Tensor:
        """Normalised log E, nu, log rho of every part (n, 6, 3)."""
        names = self.names
        low, high = names.span(name)
        ranged = low + (high - low) * alpha[:, None, None]
        low, high = names.low[row], names.high[row]
        plausible = low + (high - low) * self._rand(*row.shape, 3)
        found = torch.where((alpha == ANY)[:, None, None], plausible, ranged)
        return torch.where((name >= 0)[..., None], found, 0.0)

    def _voxels(self, label: Tensor, known: Tensor) -> Tensor:
        """Flat places (n, K) of random voxels whose part is known."""
        n = len(label)
        flat = label.reshape(n, -1).long()
        inside = known.float().gather(1, flat.clamp(max=MAX_PARTS - 1)) * (flat != EMPTY)
        inside = inside + 1e-9  # of an object without a known part any voxel: it does not count
        count = self.config.voxels
        return torch.multinomial(inside, count, replacement=True, generator=self.generator)

    def _known(self, item: Shapes, name: Tensor, row: Tensor) -> Tensor:
        """What is given of every part (n, 6, given)."""
        n, share = len(name), self.config.evidence
        seen = (self._rand(n) >= share.silent)[:, None].expand(-1, MAX_PARTS)
        shown = (self._rand(n) < share.coloured)[:, None].expand(-1, MAX_PARTS)
        return known_of(self._features(name, share), seen, self._colours(item, row), shown)

    def _features(self, name: Tensor, share: EvidenceShares) -> Tensor:
        """Unit features (n, 6, 384): the names' words, from exact to lost in noise."""
        n = len(name)
        words = self.names.embed(name)
        quality = torch.where(self._rand(n) < share.exact, 1.0, self._rand(n))[:, None, None]
        wrong = (self._rand(n, MAX_PARTS) * len(self.names.embedding)).long()
        mixed = self._rand(n, MAX_PARTS, 1)
        noise = self._normal(*words.shape)
        return blurred(words, quality, mixed * self.names.embed(wrong), (1 - mixed) * noise)

    def _colours(self, item: Shapes, row: Tensor) -> Tensor:
        """Colours (n, 6, 3) in [0, 1]: of the matter itself, painted, or those of real slots."""
        n = len(row)
        typical, spread = self.names.colour[row].split([3, 1], -1)
        # The spread is the length of three numbers' deviation.
        shade = rgb_of_lab(typical + spread / 3**0.5 * self._normal(n, MAX_PARTS, 3))
        bare = (self._rand(n, MAX_PARTS) < self.config.evidence.bare)[..., None] & (spread < 100)
        made = torch.where(bare, shade, self._rand(n, MAX_PARTS, 3))
        made = torch.where(item.colour.isnan(), made, item.colour)
        light = _STRANGE_LIGHT * self._normal(n, 1, 3)
        return (made + light).clamp(0, 1)


def _there(values: Tensor, part: Tensor) -> Tensor:
    """Values of parts (n, 6, C) at voxels of a ``part`` (n, K): (n, K, C)."""
    return values.gather(1, part[..., None].expand(-1, -1, values.shape[-1]))
