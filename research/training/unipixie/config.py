"""The options of a training run of the UniPixie network, and the runs that are known by name."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Literal

from ....predictors.unipixie.network import SHIPPED as SHIPPED_NETWORK
from ....predictors.unipixie.network import UniPixieConfig
from ..options import TrainerOptions

# The paper's. Table S2 and S4 give width, blocks, heads, latents; how wide the stem's middle and
# the fusion of the condition are, it does not say: as Table S3's totals allow.
PAPER = UniPixieConfig()
CPU_NETWORK = UniPixieConfig(
    features=16, given=389, cells=16, width=32, stem=32, heads=4, latents=8, encoder_blocks=1,
    decoder_blocks=2, spring_blocks=1, frequencies=4, own=True, predicts="x1", steps=2,
    method="euler",
)  # fmt: skip
Model = Literal["flow", "regression", "diffusion"]


@dataclass(frozen=True)
class EvidenceShares:
    """How what is known of a part is drawn; shares are probabilities.

    ``exact`` of the objects have features that are the words of their parts; of the others they are
    words and noise in random proportion. ``named`` of the parts are called by what they are made
    of, ``foreign`` by a material that is unusual for them, ``swapped`` are called another part.
    ``bare`` of the parts have the colour of their matter; ``any`` of the objects ask for a
    plausible matter instead of a place in the range.
    """

    exact: float = 0.25
    silent: float = 0.1
    named: float = 0.3
    foreign: float = 0.15
    swapped: float = 0.2
    coloured: float = 0.85
    bare: float = 0.65
    any: float = 0.3
    at_start: float = 0.25


# The words of every part, exact, and none of its matter: what networks are compared on.
BARE_WORDS = EvidenceShares(exact=1, silent=0, named=0, foreign=0, swapped=0)


@dataclass(frozen=True)
class MatterConfig:
    """A run. ``model`` is the network, or one of the U-Nets that it is compared with.

    ``midpoint`` trains on alpha .5 alone, as Pixie is; ``lean`` is how far the ends of a range lean
    outwards where it is uncertain (0: not at all, 1: to the outermost).
    """

    model: Model = "flow"
    batch: int = 128
    steps: int = 60_000
    minutes: float | None = None
    rate: float = 1e-3
    final_rate: float = 1e-5
    warm_up: int = 500
    weight_decay: float = 0.01
    decay: float = 0.999
    clip: float = 1.0
    objects: int = 20_000
    real: float = 0.15
    voxels: int = 1024  # of each object that count in a step
    lean: float = 0.8
    midpoint: bool = False
    seed: int = 0
    device: str = "cuda"
    bfloat16: bool = True
    compile: bool = False
    every: int = 200
    network: UniPixieConfig = field(default_factory=lambda: SHIPPED_NETWORK)
    evidence: EvidenceShares = field(default_factory=EvidenceShares)

    @property
    def options(self) -> TrainerOptions:
        """What the trainer needs of it."""
        names = {f.name for f in fields(TrainerOptions)} & {f.name for f in fields(self)}
        return TrainerOptions(**{name: getattr(self, name) for name in names})


# The shipped weights are of two stages, the first with other noise: see their card.
_SHIPPED = MatterConfig(
    batch=192, rate=1.2e-3, evidence=EvidenceShares(any=0.4, at_start=0.35), steps=10_000
)
CPU = MatterConfig(
    batch=8, steps=60, rate=3e-3, warm_up=5, objects=48, voxels=64, decay=0.9, device="cpu",
    bfloat16=False, every=20, real=0.0, network=CPU_NETWORK,
)  # fmt: skip
PRESETS = {"unipixie": _SHIPPED, "unipixie-cpu": CPU}
