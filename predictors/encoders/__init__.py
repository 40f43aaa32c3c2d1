"""Encoders: text and pictures as vectors of one space.

In: sentences; pictures (views, height, width, 3 or 4) in [0, 1].
Out: unit vectors, one a sentence, and one a cell of a coarser grid over every picture.
Read: protocol, registry, minilm, embedded, network, openclip, plain.
"""

from .protocol import Encoder, ImageEncoder, TextEncoder
from .registry import ENCODERS, check_encoder, load_encoder, speaking_encoder

__all__ = [
    "ENCODERS",
    "Encoder",
    "ImageEncoder",
    "TextEncoder",
    "check_encoder",
    "load_encoder",
    "speaking_encoder",
]
