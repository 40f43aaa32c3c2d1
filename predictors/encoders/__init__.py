"""Encoders: text and pictures as vectors of one space.

In: sentences; pictures (views, height, width, 3 or 4) in [0, 1].
Out: unit vectors, one a sentence, and one a cell of a coarser grid over every picture.
Read: registry, minilm, plain, openclip.
"""

from .registry import (
    ENCODERS,
    Encoder,
    ImageEncoder,
    TextEncoder,
    check_encoder,
    load_encoder,
    speaking_encoder,
)

__all__ = [
    "ENCODERS",
    "Encoder",
    "ImageEncoder",
    "TextEncoder",
    "check_encoder",
    "load_encoder",
    "speaking_encoder",
]
