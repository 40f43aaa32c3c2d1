"""Torchvision beside a torch of another build: two operators that it registers may be missing."""


def with_operators():
    """Define what a CPU build of torch lacks of torchvision's CUDA wheel, and nothing uses here."""
    import torch

    for operator in ("nms", "qnms"):
        name = f"torchvision::{operator}"
        if not hasattr(torch.ops.torchvision, operator):
            torch.library.define(name, "(Tensor dets, Tensor scores, float threshold) -> Tensor")
