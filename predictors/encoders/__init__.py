"""Encoders of text and images into one space."""

from __future__ import annotations

from typing import Literal, get_args

from ...fem.errors import UsageError
from .protocol import Encoder, ImageEncoder

EncoderName = Literal["embedded", "openclip", "rgb", "occupancy"]
ENCODERS: tuple[EncoderName, ...] = get_args(EncoderName)


def load_encoder(name: str = "embedded") -> ImageEncoder:
    """Return an encoder by name; ``openclip:TAG`` and ``openclip:FILE`` choose its weights.

    Raises
    ------
    UsageError
        Where there is no such encoder.
    InputError
        Where its package or its weights are missing.
    """
    kind, _, detail = name.partition(":")
    if kind == "embedded":
        from .embedded import Embedded

        return Embedded()
    if kind == "openclip":
        from .openclip import OpenClip

        return OpenClip(pretrained=detail) if detail else OpenClip()
    if kind in ("rgb", "occupancy"):
        from .plain import Occupancy, Rgb

        return Rgb() if kind == "rgb" else Occupancy()
    raise UsageError(f"encoder must be one of {', '.join(ENCODERS)}, got {name!r}")


def speaking_encoder(name: str = "embedded") -> Encoder:
    """Return an encoder that reads words too; raises what ``load_encoder`` raises."""
    encoder = load_encoder(name)
    if not isinstance(encoder, Encoder):
        raise UsageError(f"the encoder {name!r} reads no words: wanted embedded or openclip")
    return encoder


__all__ = [
    "ENCODERS",
    "Encoder",
    "EncoderName",
    "ImageEncoder",
    "load_encoder",
    "speaking_encoder",
]
