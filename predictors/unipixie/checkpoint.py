"""Files of trained weights: float16 safetensors with the network's sizes and normalisation."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import NamedTuple

from ...fem.errors import InputError
from ..normalisation import DEFAULT, Normalisation
from .config import UniPixieConfig
from .network import SKINNING, UniPixie

_HEAD_OF = {"matter": "mpm", "body": SKINNING, "elastic": "lbs", "springs": "spring"}


class RangeCalibration(NamedTuple):
    """What was measured of a network's ranges and samples, and mends them.

    The ends of a range move outwards by ``margin`` (of normalised log E), so that 95 % of parts lie
    between them (conformal prediction, Vovk et al. 2005); samples lie ``spread`` times further from
    their mean, so that their middle 80 % holds the truth as often.
    """

    margin: float = 0.0
    spread: float = 1.0


class Loaded(NamedTuple):
    """A network with what its numbers mean and how far its ranges hold."""

    network: UniPixie
    normalisation: Normalisation
    calibration: RangeCalibration


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


def load_unipixie(path: Path) -> Loaded:
    """Read what ``save_unipixie`` wrote, in float32 on the CPU, with the heads that it has.

    Raises
    ------
    InputError
        Where the file holds no such network.
    """
    from safetensors import SafetensorError, safe_open

    try:
        with safe_open(path, framework="pt") as file:
            facts = file.metadata()
            config = UniPixieConfig(**json.loads(facts["network"]))
            normalisation = Normalisation.from_dict(json.loads(facts["normalisation"]))
            calibration = RangeCalibration(**json.loads(facts["calibration"]))
            tensors = {key: file.get_tensor(key).float() for key in file.keys()}
    except (SafetensorError, OSError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path} is not a checkpoint of a UniPixie network: {error}") from error
    modules = {key.split(".")[0] for key in tensors}
    network = UniPixie(config, tuple(h for module, h in _HEAD_OF.items() if module in modules))
    network.load_state_dict(tensors)
    return Loaded(network.eval(), normalisation, calibration)
