"""What the FiLM network is built of, given and gives: sizes, a batch of scenes, its output."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal, NamedTuple

import torch
from torch import Tensor
from torch.nn import functional as F

from .layers import pool

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
