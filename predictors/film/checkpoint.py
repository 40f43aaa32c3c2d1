"""Files of trained weights: float16 safetensors with the network's sizes and normalisation."""

from __future__ import annotations

import json
import logging
from pathlib import Path

from ...fem.errors import InputError
from ..normalisation import Normalisation
from .config import NetworkConfig
from .unet import FilmUNet

log = logging.getLogger(__name__)


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


def load_checkpoint(path: Path) -> FilmUNet:
    """Read a network that ``save_checkpoint`` wrote, in float32 on the CPU.

    Raises
    ------
    InputError
        Where the file holds no such network.
    """
    from safetensors import SafetensorError, safe_open

    try:
        with safe_open(path, framework="pt") as file:
            facts = file.metadata()
            config = NetworkConfig.from_dict(json.loads(facts["network"]))
            normalisation = Normalisation.from_dict(json.loads(facts["normalisation"]))
            tensors = {key: file.get_tensor(key).float() for key in file.keys()}
    except (SafetensorError, OSError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path} is not a checkpoint of the FiLM network: {error}") from error
    network = FilmUNet(config, normalisation=normalisation)
    network.load_state_dict(tensors)
    return network.eval()
