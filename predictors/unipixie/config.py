"""Sizes of the UniPixie network: by default the paper's."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

CLASSES = 8  # logits; seven are those of ``fem.mpm.materials``
MATTER = 3  # log E, nu, log rho


@dataclass(frozen=True)
class UniPixieConfig:
    """Sizes of encoder and decoders (UniPixie supplement, Table S2 and S4).

    ``features`` numbers describe a voxel of a cube of ``cells``: those that are given, or, where
    ``given`` is not zero, what is learned of so many given ones. ``stem`` channels lie between the
    two convolutions, ``fusion`` numbers in the middle of what fuses time, alpha and mean latent;
    ``latents`` tokens of ``width`` numbers describe the object. With ``own`` the decoder sees each
    voxel's features beside its place. ``predicts`` is what the decoder's output means: the velocity
    of the flow (the paper) or where it ends, x1.
    """

    features: int = 768
    cells: int = 64
    width: int = 512
    stem: int = 512
    heads: int = 8
    latents: int = 64
    encoder_blocks: int = 6
    decoder_blocks: int = 6
    spring_blocks: int = 4
    frequencies: int = 16
    fusion: int = 64
    given: int = 0
    own: bool = False
    predicts: Literal["velocity", "x1"] = "velocity"
    steps: int = 15
    method: Literal["euler", "heun"] = "heun"


SHIPPED = UniPixieConfig(
    features=32, given=389, cells=32, width=128, stem=64, heads=4, encoder_blocks=6,
    decoder_blocks=3, spring_blocks=2, fusion=16, own=True, predicts="x1", steps=2, method="euler",
)  # fmt: skip
