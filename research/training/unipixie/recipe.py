"""How the UniPixie network is trained: stores and names, loss, and its file."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch

from ....predictors.field import DEFAULT, Normalisation
from ....predictors.unipixie.network import UniPixie
from ....predictors.unipixie.predictor import RangeCalibration
from ...datasets.objects import HELD_OUT, Objects, make_objects
from ...datasets.ranges import RangeTable
from ...datasets.real import RealObject, load_real
from ...datasets.shapes import MAX_PARTS
from ..processes import join, rank
from ..stores import coarsened, procedural_labels
from ..trainer import Report, Trained, train_network
from .config import MatterConfig, Model
from .diffusion import DiffusionUNet, denoise
from .loss import MatterLoss, matter_forward
from .names_on_device import Names
from .regression import RegressionUNet, regress
from .sampler import MatterSampler, Shapes

_FORWARD: dict[Model, Callable[[Any, Any], Any]] = {
    "flow": matter_forward,
    "regression": regress,
    "diffusion": denoise,
}
MatterNetwork = UniPixie | RegressionUNet
_APART = 7919  # between the seeds of two processes


def train_matter(
    config: MatterConfig,
    *,
    ranges: Path,
    real: Path | None = None,
    resume: Path | None = None,
    output: Path | None = None,
    report: Report | None = None,
    pause: float | None = None,
) -> Trained[MatterNetwork]:
    """Train the encoder and the head of the material point method, or what they are compared with.

    Parameters
    ----------
    config
        The run.
    ranges, real
        Files of the table of ranges and of real objects.
    resume, report, pause
        See ``train_network``.
    output
        Checkpoint to write at the end; of the flow's network alone.
    """
    join(config.device)
    torch.manual_seed(config.seed + rank())
    sampler = make_matter_sampler(config, ranges, real)
    torch.manual_seed(config.seed)  # the same first weights in every process
    network = new_matter_network(config)
    torch.manual_seed(config.seed + rank())

    def save(trained: MatterNetwork, steps: int) -> None:
        if output is not None and isinstance(trained, UniPixie):
            save_unipixie(output, trained, facts={"steps": steps})

    flow = config.model == "flow"
    velocity = flow and config.network.predicts == "velocity"
    # Only the flow has a start, at which it leans.
    loss = MatterLoss(config.lean if config.model != "diffusion" else 0.0, velocity)
    return train_network(
        network, sampler, loss, config.options, forward=_FORWARD[config.model],
        resume=resume, config=asdict(config), save=save, report=report, pause=pause,
    )  # fmt: skip


def new_matter_network(config: MatterConfig) -> MatterNetwork:
    """Return the network of a run with its first weights."""
    if config.model == "flow":
        return UniPixie(config.network)
    return (RegressionUNet if config.model == "regression" else DiffusionUNet)(config.network)


def make_matter_sampler(config: MatterConfig, ranges: Path, real: Path | None) -> MatterSampler:
    """Build the stores of shapes and load the names; each process draws its own."""
    names = Names(RangeTable.load(ranges), config.device)
    return make_matter_objects(names, config, real)


def make_matter_objects(
    names: Names, config: MatterConfig, real: Path | None = None
) -> MatterSampler:
    """Build the stores of shapes for names that are loaded."""
    rng = np.random.default_rng((config.seed, rank()))
    shapes = shapes_of(make_objects(config.objects, rng), config)
    known = real_shapes(load_real(real), config) if real and config.real else None
    return MatterSampler(names, shapes, known, config, config.seed + _APART * rank())


def new_objects_sampler(
    names: Names, config: MatterConfig, count: int, seed: int, *, held_out: bool
) -> MatterSampler:
    """Draw from ``count`` new objects, of categories that training saw or of the ``held_out``."""
    categories = list(HELD_OUT) if held_out else None
    made = make_objects(count, np.random.default_rng(seed), names=categories)
    return MatterSampler(names, shapes_of(made, config), None, config, seed)


def shapes_of(objects: Objects, config: MatterConfig) -> Shapes:
    """Procedural objects on the device."""
    label = procedural_labels(objects, cells=config.network.cells, device=config.device)
    kind = torch.tensor(objects.kinds, device=config.device)
    colour = torch.full((*kind.shape, 3), torch.nan, device=config.device)
    return Shapes(label, kind, torch.full_like(kind, -1), colour)


def real_shapes(objects: list[RealObject], config: MatterConfig) -> Shapes:
    """Real objects on the device, with the rows that the names of their slots tell."""
    from ....fem.table import load_table

    number = {row.name: i for i, row in enumerate(load_table())}
    label = torch.tensor(np.stack([o.label for o in objects]), device=config.device)
    row = torch.full((len(objects), MAX_PARTS), -1)
    colour = torch.full((len(objects), MAX_PARTS, 3), torch.nan)
    for i, o in enumerate(objects):
        row[i, : len(o.slots)] = torch.tensor([number[m.name] if m else -1 for m in o.materials()])
        colour[i, : len(o.slots)] = torch.tensor(o.colours, dtype=torch.float32)
    kind = torch.full_like(row, -1)
    columns = (kind.to(config.device), row.to(config.device), colour.to(config.device))
    return Shapes(coarsened(label, config.network.cells), *columns)


def save_unipixie(
    path: Path,
    network: UniPixie,
    *,
    normalisation: Normalisation = DEFAULT,
    calibration: RangeCalibration | None = None,
    facts: dict | None = None,
) -> None:
    """Write the network as float16 safetensors, with its config and what its numbers mean."""
    from safetensors.torch import save_file

    tensors = {k: v.detach().half().cpu().contiguous() for k, v in network.state_dict().items()}
    metadata = {
        "network": json.dumps(asdict(network.config)),
        "normalisation": json.dumps(normalisation.to_dict()),
        "calibration": json.dumps((calibration or RangeCalibration())._asdict()),
        "facts": json.dumps(facts or {}),
    }
    save_file(tensors, path, metadata=metadata)
