"""The configurations of the shipped weights, and one that a CPU trains in under a minute."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ....predictors.film.unet import NetworkConfig
from ....predictors.film.words import CHANNELS, HintedEncoder
from ...datasets.real import RealObject
from ...datasets.text_table import TextTable, build_text_table
from ...on_device import minilm
from .config import TrainingConfig
from .mixture import Mixture

TEXT_DIM = 384 + len(CHANNELS) + 384  # sentence, the lexicon's hints, subject
# One after the other, each from the weights of the one before. "32" and "64" ran on three GPUs and
# heard sentence and hints alone, with ``told`` off; the first weights of what came new were zero.
# "told" ran on four GPUs for 6,500 steps of a schedule of 9,800, "last" on four without compiling;
# both with a learned share of the lexicon's values, which was set to one afterwards.
_HEARD = NetworkConfig(
    widths=(32, 64, 96, 120, 128), text_dim=TEXT_DIM - 384, graded=True, fine_width=16
)
_NETWORK = replace(_HEARD, text_dim=TEXT_DIM, told=True, fine=True)
_MIXTURE = Mixture(
    composite=0.12, relabelled=0.09, real=0.08, dressed=0.6, doubt=0.2, vision=0.35, names=0.2,
    no_hints=0.1,
)  # fmt: skip
_TOLD = TrainingConfig(
    cells=64, batch=32, steps=9800, rate=1e-3, final_rate=1e-6, warm_up=150, edge=2.0,
    text_batch=1024, objects=8_000, composites=2_000, compile=True, every=250, seed=32,
    network=_NETWORK, mixture=_MIXTURE,
)  # fmt: skip
SHIPPED = {
    "32": TrainingConfig(
        cells=32, batch=80, steps=5910, rate=1.5e-3, final_rate=2e-4, warm_up=400, text_batch=1024,
        compile=True, every=250, seed=11, network=_HEARD,
        mixture=Mixture(composite=0.2, relabelled=0.12, real=0.12, dressed=0.5),
    ),
    "64": TrainingConfig(
        cells=64, batch=32, steps=4240, rate=1e-3, final_rate=1e-5, warm_up=200, text_batch=1024,
        objects=8_000, composites=2_000, compile=True, every=250, seed=12,
        network=replace(_HEARD, fine=True),
        mixture=Mixture(composite=0.14, relabelled=0.12, real=0.1, dressed=0.5),
    ),
    "told": _TOLD,
    "last": replace(_TOLD, steps=1290, rate=2.2e-4, warm_up=30, compile=False, every=100, seed=33),
    "seen": replace(
        _TOLD, steps=4000, rate=5e-4, final_rate=1e-6, warm_up=100, seed=34,
        network=replace(_NETWORK, features=384),
        mixture=replace(_MIXTURE, features=0.5, real=0.14, dressed=0.45, names=0.15),
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

# Rows of the ablation: one small network, deprived of one thing each; what is left out of training
# is left out of the test too.
_ROW = TrainingConfig(
    cells=32, batch=128, steps=1800, rate=1.5e-3, final_rate=1e-5, warm_up=100, text_batch=1024,
    composites=0, every=50, seed=21,
    network=replace(_NETWORK, widths=(16, 32, 64, 96, 128), fine=False),
    mixture=Mixture(composite=0, relabelled=0, real=0),
)  # fmt: skip


def _row(*, network: dict | None = None, mixture: dict | None = None) -> TrainingConfig:
    return replace(
        _ROW,
        network=replace(_ROW.network, **(network or {})),
        mixture=replace(_ROW.mixture, **(mixture or {})),
    )


ABLATIONS = {
    "short": _ROW,
    "concat": _row(network={"conditioning": "concat"}),
    "global": _row(network={"conditioning": "global"}),
    "crossattn": _row(network={"conditioning": "crossattn"}),
    "nohints": _row(network={"text_dim": _NETWORK.sentence_dim, "told": False}),
    "nonames": _row(mixture={"names": 0.0}),
    "occupancy": _row(mixture={"colour": 0.0, "vision": 0.0}),
}


PRESETS = {
    "cpu": CPU,
    **{f"shipped-{stage}": config for stage, config in SHIPPED.items()},
    **{f"ablation-{row}": config for row, config in ABLATIONS.items()},
}


def device_text_table(
    *, per_part: int = 2400, seed: int = 0, device: str = "cuda", real: Sequence[RealObject] = ()
) -> TextTable:
    """Write and embed a corpus of clauses on a device."""
    encoder = HintedEncoder(minilm(device), plain=1)
    rng = np.random.default_rng(seed)
    return build_text_table(rng, encoder.text, per_part=per_part, real=real)
