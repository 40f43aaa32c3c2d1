"""How the FiLM network is trained: stores and clauses, loss, first weights, and its file."""

from __future__ import annotations

import json
import logging
from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from ....predictors.field import Normalisation
from ....predictors.film.unet import FilmUNet, composed
from ...datasets.objects import make_composites, make_objects
from ...datasets.real import RealObject, load_real
from ...datasets.text_table import load_text_table
from ..processes import join, rank
from ..real_slots import RealSlots, shapes_with_real_slots, with_exchanged_slots
from ..sentences import Sentences
from ..stores import procedural_store, real_store
from ..trainer import Report, Trained, train_network
from .batch import TrainingBatch
from .config import TrainingConfig
from .loss import FilmLoss, FilmOutput
from .sampler import VoxelSampler

log = logging.getLogger(__name__)
_APART = 7919  # between the seeds of two processes


def train_film(
    config: TrainingConfig,
    *,
    text: Path,
    real: Path | None = None,
    start: Path | None = None,
    resume: Path | None = None,
    output: Path | None = None,
    report: Report | None = None,
    pause: float | None = None,
) -> Trained[FilmUNet]:
    """Train the FiLM network.

    Parameters
    ----------
    config
        The run.
    text, real
        Files of clauses and of real objects for training.
    start
        Weights to begin with; the optimiser is new.
    resume
        Folder of a whole state: continued if it is there, kept up to date at every report.
    output
        Checkpoint to write at the end.
    report
        Called with each report: step, loss, mse, right, rate, samples per second.
    pause
        Seconds after which to stop for now: ``resume`` holds the state to go on from.
    """
    join(config.device)
    torch.manual_seed(config.seed + rank())
    sampler = make_sampler(config, text, real)
    torch.manual_seed(config.seed)  # the same first weights in every process
    network = new_network(config, start)
    torch.manual_seed(config.seed + rank())

    def save(trained: FilmUNet, steps: int) -> None:
        if output is not None:
            normalisation = sampler.sentences.normalisation
            facts = {"steps": steps}
            save_checkpoint(output, trained, normalisation=normalisation, facts=facts)

    return train_network(
        network, sampler, FilmLoss(config.grounded, config.edge), config.options,
        forward=forward, resume=resume, config=asdict(config), save=save, report=report,
        pause=pause,
    )  # fmt: skip


def forward(network: FilmUNet, batch: TrainingBatch) -> FilmOutput:
    """Return the network's output for the objects, and the values of clauses alone."""
    output, alone = network(batch.scene), batch.alone
    if alone is None:
        return FilmOutput(output, None)
    return FilmOutput(output, text_values(network, alone.embedding, alone.kind))


def new_network(config: TrainingConfig, start: Path | None) -> FilmUNet:
    """Return the network on its device, with random weights or those of ``start``."""
    network = FilmUNet(config.network)
    if start is not None:
        load_matching(network, start)
    network.to(device=config.device)
    network.to(memory_format=torch.channels_last_3d)  # type: ignore
    return network


def make_sampler(config: TrainingConfig, text: Path, real: Path | None) -> VoxelSampler:
    """Build the stores of shapes and load the clauses; each process draws its own."""
    rng = np.random.default_rng((config.seed, rank()))
    table = load_text_table(text)
    cells, device = config.cells, config.device
    sentences = Sentences(table, device)
    shapes = procedural_store(make_objects(config.objects, rng), cells=cells, device=device)
    composites = furniture = dressed = looks = None
    if config.composites:
        made = make_composites(config.composites, rng)
        composites = procedural_store(made, cells=cells, device=device)
    if real is not None:
        objects = load_real(real)
        slots = RealSlots(objects, table)
        dressed = shapes_with_real_slots(shapes, slots, sentences, seed=config.seed)
        furniture = real_store(objects, table, cells=cells, device=device)
        furniture = with_exchanged_slots(furniture, slots, rng)
        looks = looks_of(objects, device) if config.mixture.features else None
    return VoxelSampler(
        sentences, shapes, composites, furniture, mixture=config.mixture,
        seed=config.seed + _APART * rank(), dressed=dressed, clauses=config.text_batch,
        coarse_evidence=config.network.fine, looks=looks,
    )  # fmt: skip


def looks_of(objects: list[RealObject], device: str) -> torch.Tensor | None:
    """What an image encoder saw of all slots (rows, F), None where it looked at no object."""
    dims = {o.features.shape[1] for o in objects if o.features is not None}
    if not dims:
        return None
    (dim,) = dims
    rows = [
        np.zeros((len(o.slots), dim), np.float16) if o.features is None else o.features
        for o in objects
    ]
    return torch.tensor(np.concatenate(rows), device=device)


def load_matching(network: FilmUNet, path: Path) -> None:
    """Take over the weights of a checkpoint that fit; a network of another shape keeps its own."""
    from safetensors.torch import load_file

    own = network.state_dict()
    saved = {
        k: v.float() for k, v in load_file(path).items() if k in own and own[k].shape == v.shape
    }
    log.info("%d of %d tensors taken from %s", len(saved), len(own), path)
    network.load_state_dict({**own, **saved})


def save_checkpoint(
    path: Path,
    network: FilmUNet,
    *,
    normalisation: Normalisation | None = None,
    facts: dict | None = None,
) -> None:
    """Write the network as float16 safetensors, with its config and what its numbers mean.

    ``normalisation`` is by default the network's own.
    """
    from safetensors.torch import save_file

    tensors = {k: v.detach().half().cpu().contiguous() for k, v in network.state_dict().items()}
    metadata = {
        "network": json.dumps(network.config.to_dict()),
        "normalisation": json.dumps((normalisation or network.normalisation).to_dict()),
        "facts": json.dumps(facts or {}),
    }
    save_file(tensors, path, metadata=metadata)


def text_values(network: FilmUNet, embedding: Tensor, kind: Tensor) -> Tensor:
    """Values (n, 3) that clauses propose by themselves: embeddings (n, D), slot types (n,)."""
    heard = embedding[:, None, : network.config.text_dim]
    hidden = [network.slots(heard, k)[:, 0] for k in (0, 3)]
    chosen = torch.where((kind == 3)[:, None], hidden[1], hidden[0])
    says = network.sayings(chosen, heard[:, 0])
    alone = torch.ones_like(says[:, None, None, None, :1])
    nothing = torch.zeros_like(says[:, :3, None, None, None])
    return composed(nothing, alone, says[:, None])[:, :, 0, 0, 0]
