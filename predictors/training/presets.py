"""The configurations of the shipped weights, and one that a CPU trains in under a minute."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..dataset.real import RealObject
from ..dataset.texttable import TextTable, build_text_table
from ..film_scene import NetworkConfig
from ..lexicon import CHANNELS
from ..plain_words import HintedEncoder
from .config import TrainingConfig
from .embedding import TorchMiniLM
from .samples import Mixture

TEXT_DIM = 384 + len(CHANNELS)  # a sentence embedding with the lexicon's hints behind
# One after the other; each began with the weights of the one before.
SHIPPED = {
    "a-32": TrainingConfig(
        cells=32, batch=128, steps=3335, rate=1.2e-3, final_rate=1e-4, text_batch=0, compile=True
    ),
    "b-32": TrainingConfig(
        cells=32, batch=128, steps=7730, rate=1.2e-3, objects=16_000, composites=6_000,
        compile=True, seed=5,
    ),
    "c-64": TrainingConfig(
        cells=64, batch=48, steps=2548, rate=6e-4, final_rate=1e-5, warm_up=100, text_batch=4096,
        objects=6_000, composites=1_500, compile=True, seed=9, network=NetworkConfig(fine=True),
        mixture=Mixture(composite=0.2, relabelled=0.15),
    ),
}  # fmt: skip
CPU = TrainingConfig(
    cells=16, batch=16, steps=60, rate=3e-3, warm_up=5, text_batch=256, objects=64, composites=0,
    device="cpu", bfloat16=False, every=20, decay=0.9,
    network=NetworkConfig(
        widths=(8, 16, 32, 32, 32), text_dim=TEXT_DIM, slot_width=64, key_width=16
    ),
    mixture=Mixture(composite=0, relabelled=0, real=0),
)  # fmt: skip


def device_text_table(
    folder: Path,
    *,
    per_part: int = 2400,
    seed: int = 0,
    device: str = "cuda",
    real: Sequence[RealObject] = (),
) -> TextTable:
    """Write and embed a corpus of clauses on a device; ``folder`` holds the encoder's weights."""
    encoder = HintedEncoder(TorchMiniLM(folder, device=device), plain=False)
    rng = np.random.default_rng(seed)
    return build_text_table(rng, encoder.text, per_part=per_part, real=real)
