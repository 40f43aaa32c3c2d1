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

from .film_parts import FilmBlock, Modulation, masked_mean, mix, pool, pool_mask

Conditioning = Literal["grounded", "global", "concat", "crossattn"]
# Input channels: occupied, red, green, blue, colour is known, and the place in the object's box.
INPUTS = 8
STEP = 16  # sizes of a grid must be multiples: four halvings
SLOT_TYPES = 4  # clause, nothing known, what the object is, own name of the part
NO_CLAUSE = -1e4  # logit of a clause that is not there; finite, and safe in bfloat16
TEXT_NOISE = 0.2  # of embeddings in training, against their unit variance
TRUST = 2.0  # a source of middling reliability counts as it is
_GATE_STATS = 32


@dataclass(frozen=True)
class NetworkConfig:
    """Sizes of the network; ``sources`` are the channels of evidence, in fixed order.

    ``text_dim`` holds the lexicon's channels too; ``fine_width`` 0 is the first of ``widths``;
    ``graded`` evidence counts in proportion to its reliability.
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


class Scene(NamedTuple):
    """What is given of a batch of objects; K clauses, S sources, P parts.

    Parameters
    ----------
    inputs
        (batch, INPUTS, x, y, z), channels as in ``INPUTS``; sizes are multiples of the ``step``.
    clauses, clause_mask
        Unit embeddings (batch, K, D) and whether each is there (batch, K).
    object_name, has_object
        Embedding of what the object is (batch, D), and whether it is known (batch,).
    evidence, reliability
        Standardised evidence (batch, S, K, x, y, z) that clause k speaks of a voxel, 0 where a
        source is silent (for a network with a fine stage, at half the resolution if you like),
        and how good the source is known to be, in [0, 1], 0 if absent (batch, S).
    names, name_mask
        Embeddings of the parts' own names (batch, P, D) and whether each is known (batch, P).
    part
        Index of the part of every voxel (batch, x, y, z), -1 outside; used with names alone.
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


class Output(NamedTuple):
    """Normalised (log E, nu, log rho) in (-1, 1), (batch, 3, x, y, z), and the binding.

    ``logits`` (batch, K + 1, x, y, z): which clause speaks of a voxel, the last one for none.
    """

    values: Tensor
    logits: Tensor


class Coarse(NamedTuple):
    """What the U-Net finds: finest features of both decoders, values before tanh, logits."""

    queries: Tensor
    features: Tensor
    residual: Tensor
    logits: Tensor
    weights: Tensor


class SlotEncoder(nn.Module):
    """Embeddings of clauses and names to the hidden vectors that blocks read FiLM from."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        width = config.slot_width
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
        # Unit vectors of 384 numbers are small; scaled to unit variance they train faster.
        scaled = embedding * embedding.shape[-1] ** 0.5
        if self.training:  # a clause said a little differently means the same
            scaled = scaled + TEXT_NOISE * torch.randn_like(scaled)
        return self.net(torch.cat([scaled, one_hot], dim=-1))


class Binder(nn.Module):
    """Logits of the clauses at every voxel: words against shape, plus gated evidence."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        scales, width = config.widths[:-1], config.key_width
        self.sources, self.graded = len(config.sources), config.graded
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

    def forward(self, scene: Scene, features: list[Tensor], deepest: Tensor, masks) -> Tensor:
        """Logits (batch, K + 1, x, y, z), float32; ``features`` fine to coarse."""
        words = self._words(scene, features)
        present = torch.cat([scene.clause_mask, torch.ones_like(scene.clause_mask[:, :1])], 1)
        closed = (~present.bool())[..., None, None, None]
        evidence = self._smooth(scene, masks[0])
        gate = self._gate(scene, words.masked_fill(closed, NO_CLAUSE), evidence, deepest, masks)
        logits = words * gate[:, 0, None, None, None, None]
        for source in range(self.sources):
            bias = self.null_evidence[source].expand_as(words[:, :1])
            trust = scene.reliability[:, source]
            trust = TRUST * trust if self.graded else (trust > 0).float()
            scale = gate[:, 1 + source] * trust
            full = torch.cat([evidence[:, source], bias], dim=1)
            logits = logits + full * scale[:, None, None, None, None]
        return logits.masked_fill(closed, NO_CLAUSE)

    def _words(self, scene: Scene, features: list[Tensor]) -> Tensor:
        """Scaled dot products of clause keys with the queries of all scales, summed."""
        keys = self.keys(scene.clauses * scene.clauses.shape[-1] ** 0.5)
        keys = torch.cat([keys, self.null.expand(len(keys), -1, -1).to(keys.dtype)], dim=1)
        size = scene.inputs.shape[2:]
        total = torch.zeros((), device=keys.device)
        split = keys.chunk(len(self.queries), dim=-1)
        for query, key, x in zip(self.queries, split, features, strict=True):
            q = query(x).permute(0, 2, 3, 4, 1)
            scaled = (key / key.shape[-1] ** 0.5).transpose(1, 2)
            logits = mix(q, scaled).float()
            if logits.shape[2:] != size:
                logits = F.interpolate(logits, size=size, mode="nearest")
            total = total + logits
        return total

    def _smooth(self, scene: Scene, mask: Tensor) -> Tensor:
        """Evidence averaged over 1, 2^3 and 4^3 cells, by learned shares, (b, S, K, ...)."""
        b, s, k = scene.evidence.shape[:3]
        size = scene.evidence.shape[3:]
        flat = scene.evidence.reshape(b, s * k, *size)
        levels = [flat]
        for factor in (2, 4):
            cells = pool(flat, mask.to(flat.dtype), factor)
            levels.append(F.interpolate(cells, size=size, mode="nearest"))
        shares = self.smoothing.softmax(dim=1).to(flat.dtype)[..., None, None, None, None]
        total = torch.zeros_like(scene.evidence)
        for level, share in zip(levels, shares.unbind(1), strict=True):
            total = total + level.reshape(scene.evidence.shape) * share
        return total

    def _gate(self, scene: Scene, words, evidence, deepest: Tensor, masks) -> Tensor:
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
            agree = _agreement(index, mask)
            stats += [margin, top, agree, scene.reliability[:, source : source + 1]]
        return F.softplus(self.gate(torch.cat(stats, dim=1).float()))


def _agreement(best: Tensor, mask: Tensor) -> Tensor:
    """Share of neighbours along x whose strongest clause ``best`` is the same, (batch, 1)."""
    both = mask[:, :, 1:] * mask[:, :, :-1]
    return masked_mean((best[:, :, 1:] == best[:, :, :-1]).float(), both)


def slot_weights(scene: Scene, logits: Tensor) -> Tensor:
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
        self.keys = nn.Linear(config.text_dim, key)
        self.null = nn.Parameter(torch.zeros(1, 1, key))
        self.head = nn.Conv3d(width, 3, 1)
        for layer in (self.keys, self.head):
            nn.init.zeros_(layer.weight)
            nn.init.zeros_(layer.bias)  # type: ignore[arg-type]

    def forward(self, scene: Scene, coarse: Coarse, slots: Tensor, direct: Tensor) -> Output:
        """Return values and binding on the fine grid."""
        mask = scene.inputs[:, :1]
        own = self.stem(scene.inputs) * mask.to(coarse.queries.dtype)
        x = self.bind(_double(self.up_query(coarse.queries)) + own, mask)
        keys = self.keys(scene.clauses * scene.clauses.shape[-1] ** 0.5)
        keys = torch.cat([keys, self.null.expand(len(keys), -1, -1).to(keys.dtype)], dim=1)
        change = mix(self.query(x).permute(0, 2, 3, 4, 1), keys.transpose(1, 2)).float()
        present = torch.cat([scene.clause_mask, torch.ones_like(scene.clause_mask[:, :1])], 1)
        closed = (~present.bool())[..., None, None, None]
        logits = (_double(coarse.logits) + change).masked_fill(closed, NO_CLAUSE)
        weights = slot_weights(scene, logits).permute(0, 2, 3, 4, 1)
        x = _double(self.up(coarse.features)) + own
        x = self.decode(x, mask, Modulation(weights, slots))
        value = _double(coarse.residual) + self.head(x) + mix(weights, direct)
        return Output(torch.tanh(value.float()), logits)


def _double(x: Tensor) -> Tensor:
    return F.interpolate(x, scale_factor=2, mode="nearest")


def halve(scene: Scene) -> Scene:
    """Return the scene at half the resolution."""
    mask = scene.inputs[:, :1]
    b, s, k = scene.evidence.shape[:3]
    evidence = scene.evidence.reshape(b, s * k, *scene.evidence.shape[3:])
    if evidence.shape[2:] == mask.shape[2:]:
        evidence = pool(evidence, mask.to(evidence.dtype))
    part = F.max_pool3d(scene.part.float()[:, None], 2)[:, 0].long()
    inputs = torch.cat([pool_mask(mask), pool(scene.inputs[:, 1:], mask)], dim=1)
    return scene._replace(
        inputs=inputs, evidence=evidence.reshape(b, s, k, *evidence.shape[2:]), part=part
    )


class FilmUNet(nn.Module):
    """The whole network; ``conditioning`` other than grounded are the rows of the ablation."""

    def __init__(self, config: NetworkConfig | None = None) -> None:
        super().__init__()
        self.config = config or NetworkConfig()
        widths, slot = self.config.widths, self.config.slot_width
        extra = widths[0] if self.config.conditioning == "concat" else 0
        self.stem = nn.Conv3d(INPUTS + extra, widths[0], 3, padding=1)
        self.encode = nn.ModuleList(FilmBlock(c, slot) for c in widths)
        self.down = nn.ModuleList(nn.Conv3d(a, b, 2, stride=2) for a, b in pairwise(widths))
        self.up_query, self.query = self._decoder()
        self.up, self.decode = self._decoder()
        self.head = nn.Conv3d(widths[0], 3, 1)
        self.slots = SlotEncoder(self.config)
        self.direct = nn.Linear(slot, 3)
        self.context = nn.Linear(slot, extra) if extra else None
        self.binder = Binder(self.config)
        self.fine = FineStage(self.config) if self.config.fine else None

    def _decoder(self) -> tuple[nn.ModuleList, nn.ModuleList]:
        widths, slot = self.config.widths, self.config.slot_width
        ups = [nn.Conv3d(b, a, 1) for a, b in pairwise(widths)]
        return nn.ModuleList(ups), nn.ModuleList(FilmBlock(c, slot) for c in widths[:-1])

    def forward(self, scene: Scene) -> Output:
        """Return values and binding; values on empty voxels mean nothing."""
        scene = self._heard(scene)
        slots = self._all_slots(scene)
        half = scene if self.fine is None else halve(scene)
        masks = [half.inputs[:, :1]]
        for _ in self.down:
            masks.append(pool_mask(masks[-1]))
        if self.config.conditioning != "grounded":
            return self._global(half, slots, masks)
        coarse, direct = self._coarse(half, slots, masks), self.direct(slots)
        if self.fine is not None:
            return self.fine(scene, coarse, slots, direct)
        value = coarse.residual + mix(coarse.weights, direct)
        return Output(torch.tanh(value.float()), coarse.logits)

    def _heard(self, scene: Scene) -> Scene:
        """Return the scene with as much of the embeddings as the network was built to hear."""
        dim = self.config.text_dim
        fields = ("clauses", "object_name", "names")
        return scene._replace(**{name: getattr(scene, name)[..., :dim] for name in fields})

    def _coarse(self, scene: Scene, slots: Tensor, masks: list[Tensor]) -> Coarse:
        """Bind the clauses in a first pass, decode what they say in a second."""
        known = slots[:, scene.clauses.shape[1] :][:, :1]
        whole = [Modulation(torch.ones_like(m).permute(0, 2, 3, 4, 1), known) for m in masks]
        skips = self._encoder(scene.inputs, masks, whole)
        queries = self._decode(self.up_query, self.query, skips, masks, whole)
        logits = self.binder(scene, queries, skips[-1], masks)
        levels = [slot_weights(scene, logits)]
        for m in masks[:-2]:
            levels.append(pool(levels[-1], m.to(levels[-1].dtype)))
        films = [Modulation(w.permute(0, 2, 3, 4, 1), slots) for w in levels]
        x = self._decode(self.up, self.decode, skips, masks, films)[0]
        return Coarse(queries[0], x, self.head(x), logits, films[0].weights)

    def text_values(self, embedding: Tensor, kind: Tensor) -> Tensor:
        """Values (n, 3) that clauses propose by themselves: embeddings (n, D), slot types (n,)."""
        heard = embedding[:, None, : self.config.text_dim]
        hidden = [self.slots(heard, k)[:, 0] for k in (0, 3)]
        chosen = torch.where((kind == 3)[:, None], hidden[1], hidden[0])
        return torch.tanh(self.direct(chosen).float())

    def _all_slots(self, scene: Scene) -> Tensor:
        """Hidden vectors of the clauses, of what is known of the object, and of the part names."""
        known = scene.has_object.to(scene.clauses.dtype)[:, None, None]
        named = self.slots(scene.object_name[:, None], 2) * known
        null = named + self.slots(torch.zeros_like(scene.object_name)[:, None], 1) * (1 - known)
        return torch.cat([self.slots(scene.clauses, 0), null, self.slots(scene.names, 3)], dim=1)

    def _encoder(self, x: Tensor, masks: list[Tensor], films) -> list[Tensor]:
        x = self.stem(x) * masks[0].to(x.dtype)
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

    def _global(self, scene: Scene, slots: Tensor, masks: list[Tensor]) -> Output:
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
        skips = self._encoder(inputs, masks, films or nothing)
        if self.config.conditioning == "crossattn":
            queries = self._decode(self.up_query, self.query, skips, masks, nothing)
            silent = scene._replace(reliability=torch.zeros_like(scene.reliability))
            logits = self.binder(silent, queries, skips[-1], masks)
            weights = slot_weights(scene, logits)
            value = mix(weights.permute(0, 2, 3, 4, 1), self.direct(slots))
            x = self._decode(self.up, self.decode, skips, masks, None)[0]
            return Output(torch.tanh((self.head(x) + value).float()), logits)
        x = self._decode(self.up, self.decode, skips, masks, films)[0]
        logits = torch.zeros(len(inputs), k + 1, *inputs.shape[2:], device=inputs.device)
        return Output(torch.tanh(self.head(x).float()), logits)


def count_parameters(network: nn.Module) -> int:
    """Number of trainable parameters."""
    return sum(p.numel() for p in network.parameters())
