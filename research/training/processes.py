"""Several processes as ``torchrun`` starts them, one for each GPU; or this one alone."""

from __future__ import annotations

import atexit
import os
from datetime import timedelta
from typing import Any

import torch
import torch.distributed.nn
from torch import Tensor, distributed

_PATIENCE = timedelta(minutes=10)  # a process that compiles keeps the others waiting


def join(device: str) -> None:
    """Join the group of processes that ``torchrun`` announces, if there is one, until the end.

    Not anew for every run: the addresses of a group that was left are still known to the others.
    And not before ``torch.distributed.nn`` is imported: its functions hold the group of that moment
    as their default, and one so held keeps its threads past the interpreter, which may then abort.
    """
    if "RANK" not in os.environ or distributed.is_initialized():
        return
    on_gpu = device.startswith("cuda")
    if on_gpu:
        torch.cuda.set_device(int(os.environ["LOCAL_RANK"]))
    distributed.init_process_group("nccl" if on_gpu else "gloo", timeout=_PATIENCE)
    atexit.register(distributed.destroy_process_group)


def rank() -> int:
    """Number of this process; the first one, 0, reports and writes."""
    return distributed.get_rank() if distributed.is_initialized() else 0


def processes() -> int:
    """Return how many train together."""
    return distributed.get_world_size() if distributed.is_initialized() else 1


def agreed(seconds: float, device: str) -> float:
    """Return the first process's seconds, the same in every process."""
    if processes() == 1:
        return seconds
    tensor = torch.tensor([seconds], device=device, dtype=torch.float64)
    distributed.broadcast(tensor, 0)
    return float(tensor)


def mean(values: Tensor) -> Tensor:
    """Return the mean over the processes."""
    if processes() > 1:
        distributed.all_reduce(values)
    return values / processes()


def gathered(item: Any) -> list[Any]:
    """Return the items of all processes in their order."""
    if processes() == 1:
        return [item]
    every: list[Any] = [None] * processes()
    distributed.all_gather_object(every, item)
    return every
