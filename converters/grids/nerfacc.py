"""The occupancy of a nerfacc estimator, in a state dict of torch or safetensors."""

from __future__ import annotations

import os

import numpy as np

from ...fem.errors import InputError
from ..files import reading
from ..registry import Format
from .density import DensityGrid


def read_nerfacc(path: str | os.PathLike) -> DensityGrid:
    """Read the finest level of an estimator's occupancy; of a state dict, tensors only."""
    with reading(path, "a state dict with nerfacc's occs, aabbs and resolution") as source:
        if source.suffix.lower() == ".safetensors":
            from safetensors.torch import load_file

            state = load_file(source)
        else:
            import torch

            state = torch.load(source, map_location="cpu", weights_only=True)
            state = state.get("state_dict", state)
        found = {}
        for want in ("occs", "aabbs", "resolution"):
            names = [name for name in state if name.split(".")[-1] == want]
            if len(names) != 1:
                raise InputError(
                    f"{path}: one tensor named {want} wanted, got {names}: of a network's weights "
                    "only nerfacc's occupancy is read; export the density of others as .npz "
                    "(density, aabb_min, aabb_max)"
                )
            found[want] = state[names[0]].numpy()
        shape = tuple(int(n) for n in found["resolution"].ravel())
        finest = found["occs"].reshape(-1, int(np.prod(shape)))[0].reshape(shape)
        box = found["aabbs"].reshape(-1, 6)[0].astype(np.float64)
        return DensityGrid(box[:3], box[3:], finest)


NERFACC = Format("nerfacc state", (".pt", ".pth", ".ckpt", ".safetensors"), read_nerfacc)
