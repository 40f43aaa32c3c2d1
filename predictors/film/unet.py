"""The network: a 3D U-Net that reads shape and colour, binds clauses to voxels, and is modulated.

A first pass gives every voxel queries at four scales; a clause's key is compared with them, and
evidence from outside (a vision-language encoder, the asset's own names) is added by a direct path
under a gate for each object. The resulting weight of every clause at every voxel mixes the clauses'
FiLM parameters in a second, modulated decoder. Clauses are encoded alone: their order is nothing.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from ..field import DEFAULT, Normalisation
from ..film.words import CHANNELS, LOUDNESS
from .config import INPUTS, NO_CLAUSE, NetworkConfig, Output, VoxelScene, halve
from .layers import FilmBlock, Listening, Modulation, masked_mean, mix, pool

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
        # Features of an image encoder as channels beside the stem's; at the start it adds nothing
        features = self.config.features
        self.eye = nn.Conv3d(features, widths[0], 1, bias=False) if features else None
        if self.eye is not None:
            nn.init.zeros_(self.eye.weight)
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
        # Return the scene with as much of it as the network was built to hear and to see
        dim, features = self.config.text_dim, scene.features
        if features is not None and features.shape[1] != self.config.features:
            features = None
        fields = ("clauses", "object_name", "names")
        heard = {name: getattr(scene, name)[..., :dim] for name in fields}
        scene = scene._replace(**heard, features=features)
        # Hidden vectors of the clauses, of what is known of the object, and of the part names
        named = scene.has_object.to(scene.clauses.dtype)[:, None, None]
        null = self.slots(torch.zeros_like(scene.object_name)[:, None], 1) * (1 - named)
        null = self.slots(scene.object_name[:, None], 2) * named + null
        slots = [self.slots(scene.clauses, 0), null, self.slots(scene.names, 3)]
        slots = torch.cat(slots, dim=1)
        half = scene if self.fine is None else halve(scene)
        masks = [half.inputs[:, :1]]
        for _ in self.down:
            masks.append(F.max_pool3d(masks[-1], 2))  # occupied where any voxel is
        if self.config.conditioning != "grounded":
            # Ablations: one vector of the text for all voxels, or unsupervised attention
            k = half.clauses.shape[1]
            present = torch.cat([half.clause_mask, ~half.clause_mask.any(1, keepdim=True)], 1)
            share = present.to(slots.dtype) / present.sum(1, keepdim=True).to(slots.dtype)
            mean = torch.einsum("bk,bkw->bw", share, slots[:, : k + 1])[:, None]
            films = [Modulation(torch.ones_like(m).permute(0, 2, 3, 4, 1), mean) for m in masks]
            inputs = half.inputs
            if self.context is not None:
                tiled = self.context(mean[:, 0])[..., None, None, None] * masks[0]
                inputs, films = torch.cat([inputs, tiled.to(inputs.dtype)], dim=1), None
            nothing = [None] * len(masks)
            skips = self._encoder(half._replace(inputs=inputs), masks, films or nothing)
            if self.config.conditioning == "crossattn":
                queries = self._decode(self.up_query, self.query, skips, masks, nothing)
                silent = half._replace(reliability=torch.zeros_like(half.reliability))
                logits = self.binder(silent, queries, skips[-1], masks)
                weights = slot_weights(half, logits)
                value = mix(weights.permute(0, 2, 3, 4, 1), self.sayings.direct(slots))
                x = self._decode(self.up, self.decode, skips, masks, None)[0]
                return Output(torch.tanh((self.head(x) + value).float()), logits)
            x = self._decode(self.up, self.decode, skips, masks, films)[0]
            logits = torch.zeros(len(inputs), k + 1, *inputs.shape[2:], device=inputs.device)
            return Output(torch.tanh(self.head(x).float()), logits)
        nothing = torch.zeros_like(scene.object_name)[:, None]
        # Bind the clauses in a first pass, decode what they say in a second
        known = slots[:, half.clauses.shape[1] :][:, :1]
        whole = [Modulation(torch.ones_like(m).permute(0, 2, 3, 4, 1), known) for m in masks]
        skips = self._encoder(half, masks, whole)
        queries = self._decode(self.up_query, self.query, skips, masks, whole)
        logits = self.binder(half, queries, skips[-1], masks)
        levels = [slot_weights(half, logits)]
        for m in masks[:-2]:
            levels.append(pool(levels[-1], m.to(levels[-1].dtype)))
        films = [Modulation(w.permute(0, 2, 3, 4, 1), slots) for w in levels]
        x = self._decode(self.up, self.decode, skips, masks, films)[0]
        coarse, says = (
            CoarseOutput(queries[0], x, self.head(x), logits, films[0].weights),
            self.sayings(slots, torch.cat([scene.clauses, nothing, scene.names], dim=1)),
        )
        if self.fine is not None:
            return self.fine(scene, coarse, slots, says)
        return Output(composed(coarse.residual, coarse.weights, says), coarse.logits)

    def _encoder(self, scene: VoxelScene, masks: list[Tensor], films) -> list[Tensor]:
        x = self.stem(scene.inputs)
        if self.eye is not None and scene.features is not None:
            x = x + self.eye(scene.features * self.config.features**0.5)  # to unit variance
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


def count_parameters(network: nn.Module) -> int:
    """Number of trainable parameters.

    Parameters
    ----------
    network
        A module of torch.

    Returns
    -------
    int
        Numbers that training changes.

    Examples
    --------
    >>> import torch
    >>> from autophyx_tet.predictors import count_parameters
    >>> count_parameters(torch.nn.Linear(3, 2))  # a matrix of 2 x 3, and 2 offsets
    8
    """
    return sum(p.numel() for p in network.parameters())


# The fine stage: binding and values at twice the resolution of the U-Net.


class CoarseOutput(NamedTuple):
    """What the U-Net finds: finest features of both decoders, values before tanh, logits."""

    queries: Tensor
    features: Tensor
    residual: Tensor
    logits: Tensor
    weights: Tensor


class FineStage(nn.Module):
    """Refines binding and values at twice the resolution; at the start it changes nothing."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        coarse, key = config.widths[0], config.key_width
        width = config.fine_width or coarse
        self.stem = nn.Conv3d(INPUTS, width, 3, padding=1)
        self.up_query, self.up = nn.Conv3d(coarse, width, 1), nn.Conv3d(coarse, width, 1)
        self.bind = FilmBlock(width, config.slot_width, modulated=False)
        self.decode = FilmBlock(width, config.slot_width)
        self.query = nn.Conv3d(width, key, 1)
        self.listen = Listening(config.sentence_dim)
        self.keys = nn.Linear(config.text_dim, key)
        self.null = nn.Parameter(torch.zeros(1, 1, key))
        self.head = nn.Conv3d(width, 3, 1)
        for layer in (self.keys, self.head):
            nn.init.zeros_(layer.weight)
            nn.init.zeros_(layer.bias)  # type: ignore

    def forward(
        self, scene: VoxelScene, coarse: CoarseOutput, slots: Tensor, says: Tensor
    ) -> Output:
        """Return values and binding on the fine grid."""
        mask = scene.inputs[:, :1]
        own = self.stem(scene.inputs) * mask.to(coarse.queries.dtype)
        x = self.bind(_double(self.up_query(coarse.queries)) + own, mask)
        keys = self.keys(self.listen(scene.clauses))
        keys = torch.cat([keys, self.null.expand(len(keys), -1, -1).to(keys.dtype)], dim=1)
        change = mix(self.query(x).permute(0, 2, 3, 4, 1), keys.transpose(1, 2)).float()
        present = torch.cat([scene.clause_mask, torch.ones_like(scene.clause_mask[:, :1])], 1)
        closed = (~present.bool())[..., None, None, None]
        logits = (_double(coarse.logits) + change).masked_fill(closed, NO_CLAUSE)
        weights = slot_weights(scene, logits).permute(0, 2, 3, 4, 1)
        x = _double(self.up(coarse.features)) + own
        x = self.decode(x, mask, Modulation(weights, slots))
        return Output(composed(_double(coarse.residual) + self.head(x), weights, says), logits)


def _double(x: Tensor) -> Tensor:
    return F.interpolate(x, scale_factor=2, mode="nearest")


# Which clause speaks of which voxel: words against shape, evidence by a path of its own.

TRUST = 2.0  # a source of middling reliability counts as it is
USELESS = 0.05  # a source that is known to be no better is not heard
_GATE_STATS = 32


class Binder(nn.Module):
    """Logits of the clauses at every voxel: words against shape, plus gated evidence."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        scales, width = config.widths[:-1], config.key_width
        self.sources, self.graded = len(config.sources), config.graded
        self.listen = Listening(config.sentence_dim)
        self.queries = nn.ModuleList(nn.Conv3d(c, width, 1) for c in scales)
        self.keys = nn.Sequential(
            nn.Linear(config.text_dim, config.slot_width),
            nn.SiLU(),
            nn.Linear(config.slot_width, width * len(scales)),
        )
        self.null = nn.Parameter(torch.zeros(1, 1, width * len(scales)))
        self.smoothing = nn.Parameter(torch.zeros(self.sources, 3))
        self.null_evidence = nn.Parameter(torch.zeros(self.sources))
        self.shape_stats = nn.Linear(config.widths[-1], _GATE_STATS)
        stats = _GATE_STATS + 3 + 4 * self.sources
        last = nn.Linear(64, 1 + self.sources)
        nn.init.zeros_(last.weight)
        nn.init.constant_(last.bias, 0.5)
        self.gate = nn.Sequential(nn.Linear(stats, 64), nn.SiLU(), last)

    def forward(self, scene: VoxelScene, features: list[Tensor], deepest: Tensor, masks) -> Tensor:
        """Logits (batch, K + 1, x, y, z), float32; ``features`` fine to coarse."""
        # Scaled dot products of clause keys with the queries of all scales, summed
        keys = self.keys(self.listen(scene.clauses))
        keys = torch.cat([keys, self.null.expand(len(keys), -1, -1).to(keys.dtype)], dim=1)
        words = torch.zeros((), device=keys.device)
        split = keys.chunk(len(self.queries), dim=-1)
        for query, key, x in zip(self.queries, split, features, strict=True):
            scaled = (key / key.shape[-1] ** 0.5).transpose(1, 2)
            alike = mix(query(x).permute(0, 2, 3, 4, 1), scaled).float()
            if alike.shape[2:] != scene.inputs.shape[2:]:
                alike = F.interpolate(alike, size=scene.inputs.shape[2:], mode="nearest")
            words = words + alike
        present = torch.cat([scene.clause_mask, torch.ones_like(scene.clause_mask[:, :1])], 1)
        closed = (~present.bool())[..., None, None, None]
        if self.graded:  # the evidence of useless sources taken away
            useful = (scene.reliability > USELESS).to(scene.reliability.dtype)
            kept = scene.evidence * useful[..., None, None, None, None].to(scene.evidence.dtype)
            scene = scene._replace(evidence=kept, reliability=scene.reliability * useful)
        # Evidence averaged over 1, 2^3 and 4^3 cells, by learned shares, (b, S, K, ...)
        mask = masks[0]
        b, s, k = scene.evidence.shape[:3]
        size = scene.evidence.shape[3:]
        flat = scene.evidence.reshape(b, s * k, *size)
        levels = [flat]
        for factor in (2, 4):
            cells = pool(flat, mask.to(flat.dtype), factor)
            levels.append(F.interpolate(cells, size=size, mode="nearest"))
        shares = self.smoothing.softmax(dim=1).to(flat.dtype)[..., None, None, None, None]
        evidence = torch.zeros_like(scene.evidence)
        for level, share in zip(levels, shares.unbind(1), strict=True):
            evidence = evidence + level.reshape(scene.evidence.shape) * share
        gate = self._gate(scene, words.masked_fill(closed, NO_CLAUSE), evidence, deepest, masks)
        logits = words * gate[:, 0, None, None, None, None]
        for source in range(self.sources):
            bias = self.null_evidence[source].expand_as(words[:, :1])
            trust = scene.reliability[:, source]
            trust = TRUST * (trust - USELESS).clamp(min=0) if self.graded else (trust > 0).float()
            scale = gate[:, 1 + source] * trust
            full = torch.cat([evidence[:, source], bias], dim=1)
            logits = logits + full * scale[:, None, None, None, None]
        return logits.masked_fill(closed, NO_CLAUSE)

    def _gate(self, scene: VoxelScene, words, evidence, deepest: Tensor, masks) -> Tensor:
        """Positive scales (batch, 1 + S) of words and of each source, one set for an object."""
        mask = masks[0].float()
        certainty = masked_mean(words.softmax(1).amax(1, keepdim=True), mask)
        spread = masked_mean(words.amax(1, keepdim=True), mask)
        count = scene.clause_mask.float().sum(1, keepdim=True) / 4
        stats = [self.shape_stats(masked_mean(deepest, masks[-1])), certainty, spread / 10, count]
        absent = (~scene.clause_mask.bool())[:, :, None, None, None]
        for source in range(self.sources):
            shown = evidence[:, source].masked_fill(absent, -3.0)
            best, index = shown.max(dim=1, keepdim=True)
            second = shown.scatter(1, index, -3.0).amax(1, keepdim=True)
            margin, top = masked_mean(best - second, mask), masked_mean(best, mask)
            both = mask[:, :, 1:] * mask[:, :, :-1]
            agree = masked_mean((index[:, :, 1:] == index[:, :, :-1]).float(), both)
            stats += [margin, top, agree, scene.reliability[:, source : source + 1]]
        return F.softplus(self.gate(torch.cat(stats, dim=1).float()))


def slot_weights(scene: VoxelScene, logits: Tensor) -> Tensor:
    """Weight of every slot at every voxel, (batch, slots, x, y, z): a softmax over clauses.

    What no clause takes goes to the part's own name where it is known, else to the null slot.
    """
    share = logits.softmax(dim=1)
    clauses, rest = share[:, :-1], share[:, -1:]
    parts = torch.arange(scene.names.shape[1], device=share.device)
    here = (scene.part[:, None] == parts[None, :, None, None, None]).to(share.dtype)
    here = here * scene.name_mask.to(share.dtype)[..., None, None, None]
    unnamed = 1 - here.sum(1, keepdim=True)
    dtype = scene.inputs.dtype
    if torch.is_autocast_enabled(share.device.type):
        dtype = torch.get_autocast_dtype(share.device.type)
    return torch.cat([clauses, rest * unnamed, rest * here], dim=1).to(dtype)


# What clauses say by themselves: a value the network reads, and the exact one of the lexicon.

_NAMES, _VALUE = CHANNELS.index("material"), slice(CHANNELS.index("E"), CHANNELS.index("rho") + 1)


class Sayings(nn.Module):
    """For every slot: a value before tanh (3), whether it names a material (1), its value (3).

    A learned doubt of the lexicon was tried: real objects, whose binding is left open, taught it
    to doubt what was said plainly.
    """

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.config = config
        self.direct = nn.Linear(config.slot_width, 3)

    def forward(self, slots: Tensor, embedding: Tensor) -> Tensor:
        """Sayings (batch, slots, 3 or 7) of hidden vectors and what they were made from."""
        direct = self.direct(slots)
        if not self.config.told:
            return direct
        start = self.config.sentence_dim
        hints = embedding[..., start : start + len(CHANNELS)] * (start**0.5 / LOUDNESS)
        names = hints[..., _NAMES, None].clamp(0, 1)
        return torch.cat([direct, names, names * hints[..., _VALUE]], dim=-1)


def composed(residual: Tensor, weights: Tensor, says: Tensor) -> Tensor:
    """Values (batch, 3, x, y, z): what the network finds, and what the lexicon was told.

    ``residual`` before tanh; ``weights`` (batch, x, y, z, slots) of the ``says`` of all slots.
    """
    mixed = mix(weights, says)
    found = torch.tanh((residual + mixed[:, :3]).float())
    if mixed.shape[1] == 3:
        return found
    return found * (1 - mixed[:, 3:4].float()) + mixed[:, 4:].float()
