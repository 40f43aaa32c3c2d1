"""The options of a training run of the FiLM network."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

from ....fem.errors import InputError
from ....predictors.film.unet import NetworkConfig
from ..options import TrainerOptions
from .mixture import Mixture


@dataclass(frozen=True)
class TrainingConfig:
    """A run. ``minutes`` ends it early; a run is repeatable only if ``steps`` end it."""

    cells: int = 32
    batch: int = 96
    steps: int = 10_000
    minutes: float | None = None
    rate: float = 1e-3
    final_rate: float = 2e-5
    warm_up: int = 200
    decay: float = 0.999  # of the moving average of the weights
    clip: float = 1.0
    edge: float = 0.0  # how much more voxels count that touch another part
    text_batch: int = 2048  # clauses a step that train the slots alone, without an object
    objects: int = 12_000
    composites: int = 4_000
    seed: int = 0
    device: str = "cuda"
    bfloat16: bool = True
    compile: bool = False
    every: int = 100  # steps between two reports
    network: NetworkConfig = field(default_factory=NetworkConfig)
    mixture: Mixture = field(default_factory=Mixture)

    @property
    def grounded(self) -> bool:
        """Whether clauses are bound to voxels, and the binding is supervised."""
        return self.network.conditioning == "grounded"

    @property
    def options(self) -> TrainerOptions:
        """What the trainer needs of it."""
        names = {f.name for f in fields(TrainerOptions)} & {f.name for f in fields(self)}
        # The ablations leave parts of the network without a use.
        return TrainerOptions(**{n: getattr(self, n) for n in names}, sparse=not self.grounded)

    @classmethod
    def from_dict(cls, data: dict) -> TrainingConfig:
        """Build from plain data, as a TOML file holds it."""
        data = dict(data)
        network = NetworkConfig.from_dict(data.pop("network", {}))
        mixture = data.pop("mixture", {})
        if "noise" in mixture:
            mixture = {**mixture, "noise": tuple(mixture["noise"])}
        try:
            return cls(**data, network=network, mixture=Mixture(**mixture))  # type: ignore
        except TypeError as error:
            raise InputError(f"training config: {error}") from error
