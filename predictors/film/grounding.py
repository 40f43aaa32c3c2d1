"""Which clause speaks of which voxel: words against shape, evidence by a path of its own."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from .config import NO_CLAUSE, NetworkConfig, VoxelScene
from .layers import Listening, masked_mean, mix, pool

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
        words = self._words(scene, features)
        present = torch.cat([scene.clause_mask, torch.ones_like(scene.clause_mask[:, :1])], 1)
        closed = (~present.bool())[..., None, None, None]
        if self.graded:
            scene = _without_useless(scene)
        evidence = self._smooth(scene, masks[0])
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

    def _words(self, scene: VoxelScene, features: list[Tensor]) -> Tensor:
        """Scaled dot products of clause keys with the queries of all scales, summed."""
        keys = self.keys(self.listen(scene.clauses))
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

    def _smooth(self, scene: VoxelScene, mask: Tensor) -> Tensor:
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
            agree = _agreement(index, mask)
            stats += [margin, top, agree, scene.reliability[:, source : source + 1]]
        return F.softplus(self.gate(torch.cat(stats, dim=1).float()))


def _without_useless(scene: VoxelScene) -> VoxelScene:
    """Return the scene with the evidence of useless sources taken away."""
    heard = (scene.reliability > USELESS).to(scene.reliability.dtype)
    evidence = scene.evidence * heard[..., None, None, None, None].to(scene.evidence.dtype)
    return scene._replace(evidence=evidence, reliability=scene.reliability * heard)


def _agreement(best: Tensor, mask: Tensor) -> Tensor:
    """Share of neighbours along x whose strongest clause ``best`` is the same, (batch, 1)."""
    both = mask[:, :, 1:] * mask[:, :, :-1]
    return masked_mean((best[:, :, 1:] == best[:, :, :-1]).float(), both)


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
