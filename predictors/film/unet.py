"""The network: a 3D U-Net that reads shape and colour, binds clauses to voxels, and is modulated.

A first pass gives every voxel queries at four scales; a clause's key is compared with them, and
evidence from outside (a vision-language encoder, the asset's own names) is added by a direct path
under a gate for each object. The resulting weight of every clause at every voxel mixes the clauses'
FiLM parameters in a second, modulated decoder. Clauses are encoded alone: their order is nothing.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from ..field import DEFAULT, Normalisation
from .words import CHANNELS, LOUDNESS

Conditioning = Literal["grounded", "global", "concat", "crossattn"]
# Input channels: occupied, red, green, blue, colour is known, and the place in the object's box.
INPUTS = 8
STEP = 16  # sizes of a grid must be multiples: four halvings
NO_CLAUSE = -1e4  # logit of a clause that is not there; finite, and safe in bfloat16


@dataclass(frozen=True)
class NetworkConfig:
    """Sizes of the network; ``sources`` are the channels of evidence, in fixed order.

    ``text_dim`` numbers are heard of a clause: ``sentence_dim`` of the sentence, the lexicon's
    channels, and again ``sentence_dim`` of its subject. Where the lexicon names a material, its
    value is ``told`` without a detour. ``fine_width`` 0 is the first of ``widths``; ``graded``
    evidence counts in proportion to its reliability. ``features`` numbers are seen of a voxel by
    an image encoder, 0 where the network has no eye for them.
    """

    widths: tuple[int, ...] = (16, 32, 64, 128, 208)
    text_dim: int = 384
    slot_width: int = 256
    key_width: int = 48
    conditioning: Conditioning = "grounded"
    sources: tuple[str, ...] = ("vision", "names")
    fine: bool = False  # a stage at twice the resolution refines what the U-Net finds at half of it
    fine_width: int = 0
    graded: bool = False
    told: bool = False
    sentence_dim: int = 384
    features: int = 0

    @property
    def step(self) -> int:
        """Sizes of a grid must be multiples of this."""
        return STEP * 2 if self.fine else STEP

    def to_dict(self) -> dict:
        """Plain data for a checkpoint's metadata."""
        return asdict(self)

    @classmethod
    def from_dict(cls, data: dict) -> NetworkConfig:
        """Rebuild from ``to_dict``."""
        plain: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in data.items()}
        return cls(**plain)


class VoxelScene(NamedTuple):
    """What is given of a batch of objects; K clauses, S sources, P parts.

    inputs: (batch, INPUTS, x, y, z), channels as in ``INPUTS``; sizes are multiples of the
        ``step``.
    clauses, clause_mask: Unit embeddings (batch, K, D) and whether each is there (batch, K).
    object_name, has_object: Embedding of what the object is (batch, D), and whether it is known
        (batch,).
    evidence, reliability: Standardised evidence (batch, S, K, x, y, z) that clause k speaks of a
        voxel, 0 where a source is silent (for a network with a fine stage, at half the resolution
        if you like), and how good the source is known to be, in [0, 1], 0 if absent (batch, S).
    names, name_mask: Embeddings of the parts' own names (batch, P, D) and whether each is known
        (batch, P).
    part: Index of the part of every voxel (batch, x, y, z), -1 outside; used with names alone.
    features: Unit vectors (batch, F, x, y, z) of an image encoder, 0 where it saw nothing (for a
        network with a fine stage, at half the resolution if you like); None without an encoder.
    """

    inputs: Tensor
    clauses: Tensor
    clause_mask: Tensor
    object_name: Tensor
    has_object: Tensor
    evidence: Tensor
    reliability: Tensor
    names: Tensor
    name_mask: Tensor
    part: Tensor
    features: Tensor | None = None


class Output(NamedTuple):
    """Normalised (log E, nu, log rho) in (-1, 1), (batch, 3, x, y, z), and the binding.

    ``logits`` (batch, K + 1, x, y, z): which clause speaks of a voxel, the last one for none.
    """

    values: Tensor
    logits: Tensor


def halve(scene: VoxelScene) -> VoxelScene:
    """Return the scene at half the resolution."""
    mask = scene.inputs[:, :1]
    b, s, k = scene.evidence.shape[:3]
    evidence = scene.evidence.reshape(b, s * k, *scene.evidence.shape[3:])
    if evidence.shape[2:] == mask.shape[2:]:
        evidence = pool(evidence, mask.to(evidence.dtype))
    features = scene.features
    if features is not None and features.shape[2:] == mask.shape[2:]:
        features = pool(features, mask.to(features.dtype))
    part = F.max_pool3d(scene.part.float()[:, None], 2)[:, 0].long()
    inputs = torch.cat([F.max_pool3d(mask, 2), pool(scene.inputs[:, 1:], mask)], dim=1)
    return scene._replace(
        inputs=inputs,
        evidence=evidence.reshape(b, s, k, *evidence.shape[2:]),
        part=part,
        features=features,
    )


GROUPS = 8
# Floors under a variance or a count: an empty or constant object must not divide by zero.
EPSILON = 1e-5
ONE_VOXEL = 1.0


# Of embeddings in training, against their unit variance: at most, of a sentence and of a subject.
SENTENCE_NOISE, SUBJECT_NOISE = 0.7, 0.3
UNHEARD = 0.1  # of the sentences, of which only hints and subject are heard


class Listening(nn.Module):
    """Embeddings of clauses at unit variance; in training blurred, but for the lexicon's hints.

    A clause said a little differently means the same.
    """

    def __init__(self, sentence_dim: int) -> None:
        super().__init__()
        self.sentence_dim = sentence_dim

    def forward(self, embedding: Tensor) -> Tensor:
        """Return embeddings (..., D): sentence, hints and subject, or the first of them."""
        dim = self.sentence_dim
        scaled = embedding * dim**0.5
        if not self.training:
            return scaled
        much = torch.zeros_like(scaled)
        much[..., :dim] = SENTENCE_NOISE
        heard = torch.ones_like(scaled)
        if scaled.shape[-1] > 2 * dim:
            much[..., -dim:] = SUBJECT_NOISE
            heard[..., :dim] = (torch.rand_like(scaled[..., :1]) > UNHEARD).to(scaled.dtype)
        blur = much * torch.rand_like(scaled[..., :1]) * torch.randn_like(scaled)
        return scaled * heard + blur


class Modulation(NamedTuple):
    """What FiLM gets: weight of every slot at every voxel of the block's level, and the slots.

    ``weights`` (batch, x, y, z, slots) sum to one; ``slots`` (batch, slots, width) are hidden
    vectors of clauses, from which each block reads its own scale and shift.
    """

    weights: Tensor
    slots: Tensor


def mix(weights: Tensor, values: Tensor) -> Tensor:
    """Sum slot values (batch, slots, c) with voxel weights: (batch, c, x, y, z), channels last."""
    shape = weights.shape
    flat = torch.bmm(weights.reshape(shape[0], -1, shape[-1]), values.to(weights.dtype))
    return flat.reshape(*shape[:-1], -1).permute(0, 4, 1, 2, 3)


def pool(x: Tensor, mask: Tensor, factor: int = 2) -> Tensor:
    """Mean over the occupied voxels of each cell of ``factor``^3 voxels; 0 where there is none."""
    share = F.avg_pool3d(mask, factor)
    return F.avg_pool3d(x * mask, factor) / share.clamp(min=EPSILON)


def masked_mean(x: Tensor, mask: Tensor) -> Tensor:
    """Mean over the occupied voxels, (batch, channels), in float32."""
    total = (x * mask).sum(dim=(2, 3, 4), dtype=torch.float32)
    return total / mask.sum(dim=(2, 3, 4), dtype=torch.float32).clamp(min=ONE_VOXEL)


class MaskedGroupNorm(nn.Module):
    """Group norm whose mean and variance are those of the occupied voxels: any grid will do."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.groups = GROUPS
        self.weight = nn.Parameter(torch.ones(channels))
        self.bias = nn.Parameter(torch.zeros(channels))

    def forward(self, x: Tensor, mask: Tensor) -> Tensor:
        """Normalise; empty voxels come out as 0."""
        b, c = x.shape[:2]
        per_group = c // self.groups
        mean_c, square_c = masked_mean(x, mask), masked_mean(x * x, mask)
        mean = mean_c.reshape(b, self.groups, per_group).mean(2)
        square = square_c.reshape(b, self.groups, per_group).mean(2)
        rstd = ((square - mean * mean).clamp(min=0) + EPSILON).rsqrt()
        scale = rstd.repeat_interleave(per_group, 1) * self.weight
        shift = self.bias - mean.repeat_interleave(per_group, 1) * scale
        view = (b, c, 1, 1, 1)
        return (x * scale.view(view).to(x.dtype) + shift.view(view).to(x.dtype)) * mask.to(x.dtype)


class FilmBlock(nn.Module):
    """Residual block; FiLM (AutoPhyX eq. 1) after the second norm, the identity at the start."""

    def __init__(self, channels: int, width: int, *, modulated: bool = True) -> None:
        super().__init__()
        self.norm1, self.norm2 = MaskedGroupNorm(channels), MaskedGroupNorm(channels)
        self.conv1 = nn.Conv3d(channels, channels, 3, padding=1)
        self.conv2 = nn.Conv3d(channels, channels, 3, padding=1)
        self.film = nn.Linear(width, 2 * channels) if modulated else None
        if self.film is not None:
            nn.init.zeros_(self.film.weight)
            nn.init.zeros_(self.film.bias)

    def forward(self, x: Tensor, mask: Tensor, modulation: Modulation | None = None) -> Tensor:
        """Return x plus its modulated residual, 0 on empty voxels."""
        h = self.conv1(F.silu(self.norm1(x, mask)))
        h = self.norm2(h, mask)
        if modulation is not None and self.film is not None:
            table = self.film(modulation.slots)
            delta, beta = mix(modulation.weights, table).chunk(2, dim=1)
            h = h * (1 + delta) + beta
        return (x + self.conv2(F.silu(h))) * mask.to(x.dtype)


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
