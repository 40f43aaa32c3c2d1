"""The paper's other heads, and that of skinning in training: alone, or with matter's.

A batch is of objects whose parts are called by bare words; E of a part is the middle of its range.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from ....predictors.field import DEFAULT
from ....predictors.unipixie.network import (
    FlowDecoder,
    UniPixie,
    UniPixieConfig,
    VoxelHead,
    Voxels,
    known_of,
)
from ...datasets.objects import HELD_OUT, Objects, make_objects
from ..stores import procedural_labels
from ..trainer import Losses
from .batch import MatterBatch, spread_parts
from .config import MatterConfig
from .loss import MatterLoss, MatterOutput, matter_forward
from .names_on_device import Names
from .sampler import MatterSampler
from .skinning import CELLS, CellBodies, cell_bodies, compliance_share

THETA = 650  # numbers of a skinning body: ten weights of 64 features and a constant each
ANCHORS = 2048  # of a spring network
ELASTIC = 2  # log E, nu
HEADS = ("mpm", "lbs", "spring")
SKINNING = "skinning"  # of the second alone what has no flow


class SpringHead(nn.Module):
    """Flow of one vector: log stiffness of every anchor, and the softness eta of all."""

    def __init__(self, config: UniPixieConfig) -> None:
        super().__init__()
        self.decoder = FlowDecoder(config, ANCHORS + 1, known=0, blocks=config.spring_blocks)

    def forward(self, x: Tensor, time: Tensor, alpha: Tensor, latents: Tensor) -> Tensor:
        """Return the velocity (batch, 2049), or x1, at ``x`` (batch, 2049)."""
        nothing, nowhere = x[:, None, :0], latents.new_zeros(())
        out, _ = self.decoder(x[:, None], time, alpha, latents, nothing, nowhere)
        return out[:, 0]


class JointUniPixie(UniPixie):
    """Encoder and heads; ``heads`` are by default all three (the paper's joint network)."""

    def __init__(self, config: UniPixieConfig, heads: tuple[str, ...] = HEADS) -> None:
        super().__init__(config)
        width = config.width
        if "mpm" not in heads:
            del self.matter, self.classes
        if {"lbs", SKINNING} & set(heads):
            self.body = nn.Sequential(
                *(layer for _ in range(3) for layer in (nn.Linear(width, width), nn.SiLU())),
                nn.Linear(width, THETA),
            )
        if "lbs" in heads:
            self.elastic = VoxelHead(config, ELASTIC)
        if "spring" in heads:
            self.springs = SpringHead(config)

    def skinning(self, latents: Tensor) -> Tensor:
        """Numbers theta (batch, 650) of the skinning body; alpha does not move them."""
        return self.body(latents.mean(1))


class SkinningBatch(NamedTuple):
    """Objects as labelled cubes with what is known of their parts, and the same as bodies."""

    label: Tensor
    known: Tensor
    bodies: CellBodies


class SkinningSampler:
    """Draws objects of a store of ``count``, made from ``seed``, as bodies of ``cells`` a side."""

    def __init__(
        self, names: Names, config: MatterConfig, count: int, seed: int, *,
        held_out: bool = False, cells: int = CELLS,
    ) -> None:  # fmt: skip
        categories = list(HELD_OUT) if held_out else None
        objects = make_objects(count, np.random.default_rng(seed), names=categories)
        device = config.device
        self.generator = torch.Generator(device).manual_seed(seed)
        name, (stiffness, _, _) = called_by_words(names, objects, self.generator)
        blank = torch.zeros(*name.shape, 3, device=device)
        known = known_of(names.embed(name), name >= 0, blank, torch.zeros_like(name))
        label = procedural_labels(objects, cells=config.network.cells, device=device)
        bodies = cell_bodies(objects, stiffness, device, cells=cells)
        self.store = SkinningBatch(label, known, bodies)

    def __len__(self) -> int:
        return len(self.store.label)

    def draw(self, n: int) -> SkinningBatch:
        """Draw a batch of ``n`` objects."""
        store = self.store
        index = torch.randint(
            len(store.label), (n,), generator=self.generator, device=store.label.device
        )
        return self.some(index)

    def some(self, index: Tensor) -> SkinningBatch:
        """Return the objects of these numbers."""
        label, known, bodies = self.store
        return SkinningBatch(label[index], known[index], CellBodies(*(c[index] for c in bodies)))


class EncodedBatch(NamedTuple):
    """Bodies with the mean latent (n, width) that a frozen encoder gives of each."""

    latent: Tensor
    bodies: CellBodies


class EncodedSampler:
    """Draws the bodies of a store as a frozen network's encoder sees them, looked at once."""

    def __init__(self, network: UniPixie, store: SkinningSampler, *, batch: int = 16) -> None:
        self.generator, self.bodies = store.generator, store.store.bodies
        every = torch.arange(len(store), device=self.bodies.full.device)
        with torch.no_grad():
            seen = [latents_of(network, store.some(some)).mean(1) for some in every.split(batch)]
        self.latent = torch.cat(seen)

    def __len__(self) -> int:
        return len(self.latent)

    def draw(self, n: int) -> EncodedBatch:
        """Draw a batch of ``n`` bodies."""
        index = torch.randint(len(self), (n,), generator=self.generator, device=self.latent.device)
        return self.some(index)

    def some(self, index: Tensor) -> EncodedBatch:
        """Return the bodies of these numbers."""
        return EncodedBatch(self.latent[index], CellBodies(*(c[index] for c in self.bodies)))


def called_by_words(
    names: Names, objects: Objects, generator: torch.Generator
) -> tuple[Tensor, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Name of every part (n, 6), -1 for none; E [Pa], nu, rho [kg/m^3] in the middle of its range.

    What has no name has the values of the middle of all ranges.
    """
    kind = torch.tensor(objects.kinds, device=generator.device)
    chance = torch.rand(kind.shape, generator=generator, device=kind.device)
    name = names.plain(kind, chance)
    low, high = names.span(name)
    middle = torch.where((name >= 0)[..., None], (low + high) / 2, 0.0)
    return name, DEFAULT.physical(middle.cpu().numpy().astype(float))


class ConstantTheta(nn.Module):
    """The same numbers for every body: what a head must beat."""

    def __init__(self) -> None:
        super().__init__()
        self.theta = nn.Parameter(torch.randn(THETA) / 8)

    def forward(self, batch: SkinningBatch | EncodedBatch) -> Tensor:
        """Return (n, 650)."""
        return self.theta.expand(len(batch.bodies.full), -1)


def latents_of(network: UniPixie, batch: SkinningBatch) -> Tensor:
    """Latents (n, latents, width) of a batch."""
    cube = spread_parts(network.project(batch.known), batch.label)
    own = cube.new_zeros(len(cube), 0, cube.shape[-1])
    return network.encode(Voxels(cube.movedim(-1, 1), own[..., :3], own))


def skinning_forward(network: JointUniPixie, batch: SkinningBatch) -> Tensor:
    """Numbers theta (n, 650) of a batch."""
    return network.skinning(latents_of(network, batch))


def skinning_loss(theta: Tensor, batch: SkinningBatch | EncodedBatch) -> Losses:
    """What of the compliance the handles do not have, mean over bodies."""
    lost = (1 - compliance_share(theta.float(), batch.bodies)).mean().float()
    return Losses(lost, {"lost": lost.detach()})


def shares_of(
    call: Callable[[Any], Tensor], sampler: SkinningSampler | EncodedSampler, *, batch: int = 16
) -> np.ndarray:
    """Share of the compliance (n,) of every object of a sampler's store."""
    count, found = len(sampler), []
    with torch.no_grad():
        for begin in range(0, count, batch):
            some = sampler.some(torch.arange(begin, min(begin + batch, count)))
            found.append(compliance_share(call(some).float(), some.bodies).cpu().numpy())
    return np.concatenate(found)


class HeadsBatch(NamedTuple):
    """What each head is trained on; None for one that is not."""

    matter: MatterBatch | None
    skinning: SkinningBatch | None


@dataclass(frozen=True, eq=False)
class HeadsSampler:
    """Draws for both heads, or for one; a body of cells stands for so many objects as voxels."""

    matter: MatterSampler | None
    skinning: SkinningSampler | None
    generator: torch.Generator
    each: int = 4

    def draw(self, n: int) -> HeadsBatch:
        """Draw ``n`` objects, and a share of them as bodies."""
        matter = None if self.matter is None else self.matter.draw(n)
        some = max(n // self.each, 1)
        return HeadsBatch(matter, None if self.skinning is None else self.skinning.draw(some))


class HeadsOutput(NamedTuple):
    """What the heads say."""

    matter: MatterOutput | None
    theta: Tensor | None


def heads_forward(network: JointUniPixie | ConstantTheta, batch: HeadsBatch) -> HeadsOutput:
    """Return what each head that is trained makes of its batch."""
    if isinstance(network, ConstantTheta):
        return HeadsOutput(None, batch.skinning and network(batch.skinning))
    matter = None if batch.matter is None else matter_forward(network, batch.matter)
    theta = None if batch.skinning is None else skinning_forward(network, batch.skinning)
    return HeadsOutput(matter, theta)


@dataclass(frozen=True)
class HeadsLoss:
    """The sum of the heads' losses, skinning by lambda of Table S4."""

    matter: MatterLoss
    weight: float = 0.8

    def __call__(self, output: HeadsOutput, batch: HeadsBatch) -> Losses:
        """Compare what the heads say with what is wanted of each."""
        found = []
        if output.matter is not None and batch.matter is not None:
            found.append(self.matter(output.matter, batch.matter))
        if output.theta is not None and batch.skinning is not None:
            lost = skinning_loss(output.theta, batch.skinning)
            found.append(Losses(self.weight * lost.total, lost.reported))
        reported = {name: value for one in found for name, value in one.reported.items()}
        return Losses(torch.stack([one.total for one in found]).sum(), reported)
