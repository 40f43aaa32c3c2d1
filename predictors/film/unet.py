"""The network: a 3D U-Net that reads shape and colour, binds clauses to voxels, and is modulated.

A first pass gives every voxel queries at four scales; a clause's key is compared with them, and
evidence from outside (a vision-language encoder, the asset's own names) is added by a direct path
under a gate for each object. The resulting weight of every clause at every voxel mixes the clauses'
FiLM parameters in a second, modulated decoder. Clauses are encoded alone: their order is nothing.
"""

from __future__ import annotations

from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from ..normalisation import DEFAULT, Normalisation
from .conditioning import Sayings, composed
from .config import INPUTS, NetworkConfig, Output, VoxelScene, halve
from .fine import CoarseOutput, FineStage
from .grounding import Binder, slot_weights
from .layers import FilmBlock, Listening, Modulation, mix, pool, pool_mask

SLOT_TYPES = 4  # clause, nothing known, what the object is, own name of the part


class SlotEncoder(nn.Module):
    """Embeddings of clauses and names to the hidden vectors that blocks read FiLM from."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        width = config.slot_width
        self.listen = Listening(config.sentence_dim)
        self.net = nn.Sequential(
            nn.Linear(config.text_dim + SLOT_TYPES, 4 * width),
            nn.SiLU(),
            nn.Linear(4 * width, width),
            nn.SiLU(),
        )

    def forward(self, embedding: Tensor, kind: int) -> Tensor:
        """Hidden vectors (batch, n, width) of embeddings (batch, n, D) of one type of slot."""
        one_hot = F.one_hot(torch.tensor(kind, device=embedding.device), SLOT_TYPES)
        one_hot = one_hot.to(embedding.dtype).expand(*embedding.shape[:-1], -1)
        return self.net(torch.cat([self.listen(embedding), one_hot], dim=-1))


class FeatureProjector(nn.Module):
    """Features of an image encoder as channels beside the stem's; at the start it adds nothing."""

    def __init__(self, features: int, channels: int) -> None:
        super().__init__()
        self.scale = features**0.5  # to unit variance
        self.project = nn.Conv3d(features, channels, 1, bias=False)
        nn.init.zeros_(self.project.weight)

    def forward(self, features: Tensor) -> Tensor:
        """Channels (batch, channels, x, y, z) of unit vectors (batch, features, x, y, z)."""
        return self.project(features * self.scale)


class FilmUNet(nn.Module):
    """The whole network; ``conditioning`` other than grounded are the rows of the ablation.

    ``normalisation`` says what its numbers mean.
    """

    def __init__(
        self, config: NetworkConfig | None = None, *, normalisation: Normalisation = DEFAULT
    ) -> None:
        super().__init__()
        self.config, self.normalisation = config or NetworkConfig(), normalisation
        widths, slot = self.config.widths, self.config.slot_width
        extra = widths[0] if self.config.conditioning == "concat" else 0
        self.stem = nn.Conv3d(INPUTS + extra, widths[0], 3, padding=1)
        self.eye = (
            FeatureProjector(self.config.features, widths[0]) if self.config.features else None
        )
        self.encode = nn.ModuleList(FilmBlock(c, slot) for c in widths)
        self.down = nn.ModuleList(nn.Conv3d(a, b, 2, stride=2) for a, b in pairwise(widths))
        self.up_query, self.query = self._decoder()
        self.up, self.decode = self._decoder()
        self.head = nn.Conv3d(widths[0], 3, 1)
        self.slots = SlotEncoder(self.config)
        self.sayings = Sayings(self.config)
        self.context = nn.Linear(slot, extra) if extra else None
        self.binder = Binder(self.config)
        self.fine = FineStage(self.config) if self.config.fine else None

    def _decoder(self) -> tuple[nn.ModuleList, nn.ModuleList]:
        widths, slot = self.config.widths, self.config.slot_width
        ups = [nn.Conv3d(b, a, 1) for a, b in pairwise(widths)]
        return nn.ModuleList(ups), nn.ModuleList(FilmBlock(c, slot) for c in widths[:-1])

    def forward(self, scene: VoxelScene) -> Output:
        """Return values and binding; values on empty voxels mean nothing."""
        scene = self._heard(scene)
        slots = self._all_slots(scene)
        half = scene if self.fine is None else halve(scene)
        masks = [half.inputs[:, :1]]
        for _ in self.down:
            masks.append(pool_mask(masks[-1]))
        if self.config.conditioning != "grounded":
            return self._global(half, slots, masks)
        coarse, says = self._coarse(half, slots, masks), self.sayings(slots, _said(scene))
        if self.fine is not None:
            return self.fine(scene, coarse, slots, says)
        return Output(composed(coarse.residual, coarse.weights, says), coarse.logits)

    def _heard(self, scene: VoxelScene) -> VoxelScene:
        """Return the scene with as much of it as the network was built to hear and to see."""
        dim, features = self.config.text_dim, scene.features
        if features is not None and features.shape[1] != self.config.features:
            features = None
        fields = ("clauses", "object_name", "names")
        heard = {name: getattr(scene, name)[..., :dim] for name in fields}
        return scene._replace(**heard, features=features)

    def _coarse(self, scene: VoxelScene, slots: Tensor, masks: list[Tensor]) -> CoarseOutput:
        """Bind the clauses in a first pass, decode what they say in a second."""
        known = slots[:, scene.clauses.shape[1] :][:, :1]
        whole = [Modulation(torch.ones_like(m).permute(0, 2, 3, 4, 1), known) for m in masks]
        skips = self._encoder(scene, masks, whole)
        queries = self._decode(self.up_query, self.query, skips, masks, whole)
        logits = self.binder(scene, queries, skips[-1], masks)
        levels = [slot_weights(scene, logits)]
        for m in masks[:-2]:
            levels.append(pool(levels[-1], m.to(levels[-1].dtype)))
        films = [Modulation(w.permute(0, 2, 3, 4, 1), slots) for w in levels]
        x = self._decode(self.up, self.decode, skips, masks, films)[0]
        return CoarseOutput(queries[0], x, self.head(x), logits, films[0].weights)

    def text_values(self, embedding: Tensor, kind: Tensor) -> Tensor:
        """Values (n, 3) that clauses propose by themselves: embeddings (n, D), slot types (n,)."""
        heard = embedding[:, None, : self.config.text_dim]
        hidden = [self.slots(heard, k)[:, 0] for k in (0, 3)]
        chosen = torch.where((kind == 3)[:, None], hidden[1], hidden[0])
        says = self.sayings(chosen, heard[:, 0])
        alone = torch.ones_like(says[:, None, None, None, :1])
        nothing = torch.zeros_like(says[:, :3, None, None, None])
        return composed(nothing, alone, says[:, None])[:, :, 0, 0, 0]

    def _all_slots(self, scene: VoxelScene) -> Tensor:
        """Hidden vectors of the clauses, of what is known of the object, and of the part names."""
        known = scene.has_object.to(scene.clauses.dtype)[:, None, None]
        named = self.slots(scene.object_name[:, None], 2) * known
        null = named + self.slots(torch.zeros_like(scene.object_name)[:, None], 1) * (1 - known)
        return torch.cat([self.slots(scene.clauses, 0), null, self.slots(scene.names, 3)], dim=1)

    def _encoder(self, scene: VoxelScene, masks: list[Tensor], films) -> list[Tensor]:
        x = self.stem(scene.inputs)
        if self.eye is not None and scene.features is not None:
            x = x + self.eye(scene.features)
        x = x * masks[0].to(x.dtype)
        skips = []
        for level, block in enumerate(self.encode):
            if level:
                x = self.down[level - 1](x) * masks[level].to(x.dtype)
            x = block(x, masks[level], films[level])
            skips.append(x)
        return skips

    @staticmethod
    def _decode(ups, blocks, skips: list[Tensor], masks, films) -> list[Tensor]:
        """Features of a decoder, fine to coarse."""
        x, out = skips[-1], []
        for level in reversed(range(len(blocks))):
            x = F.interpolate(ups[level](x), scale_factor=2, mode="nearest") + skips[level]
            x = blocks[level](x, masks[level], films[level] if films else None)
            out.append(x)
        return out[::-1]

    def _global(self, scene: VoxelScene, slots: Tensor, masks: list[Tensor]) -> Output:
        """Ablations: one vector of the text for all voxels, or unsupervised attention."""
        k = scene.clauses.shape[1]
        present = torch.cat([scene.clause_mask, ~scene.clause_mask.any(1, keepdim=True)], 1)
        share = present.to(slots.dtype) / present.sum(1, keepdim=True).to(slots.dtype)
        mean = torch.einsum("bk,bkw->bw", share, slots[:, : k + 1])[:, None]
        films = [Modulation(torch.ones_like(m).permute(0, 2, 3, 4, 1), mean) for m in masks]
        inputs = scene.inputs
        if self.context is not None:
            tiled = self.context(mean[:, 0])[..., None, None, None] * masks[0]
            inputs, films = torch.cat([inputs, tiled.to(inputs.dtype)], dim=1), None
        nothing = [None] * len(masks)
        skips = self._encoder(scene._replace(inputs=inputs), masks, films or nothing)
        if self.config.conditioning == "crossattn":
            queries = self._decode(self.up_query, self.query, skips, masks, nothing)
            silent = scene._replace(reliability=torch.zeros_like(scene.reliability))
            logits = self.binder(silent, queries, skips[-1], masks)
            weights = slot_weights(scene, logits)
            value = mix(weights.permute(0, 2, 3, 4, 1), self.sayings.direct(slots))
            x = self._decode(self.up, self.decode, skips, masks, None)[0]
            return Output(torch.tanh((self.head(x) + value).float()), logits)
        x = self._decode(self.up, self.decode, skips, masks, films)[0]
        logits = torch.zeros(len(inputs), k + 1, *inputs.shape[2:], device=inputs.device)
        return Output(torch.tanh(self.head(x).float()), logits)


def _said(scene: VoxelScene) -> Tensor:
    """Embeddings behind all slots: clauses, nothing or the object's name, names of the parts."""
    nothing = torch.zeros_like(scene.object_name)[:, None]
    return torch.cat([scene.clauses, nothing, scene.names], dim=1)


def count_parameters(network: nn.Module) -> int:
    """Number of trainable parameters."""
    return sum(p.numel() for p in network.parameters())
