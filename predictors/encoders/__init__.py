"""Encoders: text and pictures as vectors of one space.

In: sentences; pictures (views, height, width, 3 or 4) in [0, 1].
Out: unit vectors, one a sentence, and one a cell of a coarser grid over every picture.
Read: minilm, plain, openclip.

An encoder is one file and one line here, or a call of ``register``. A name may carry weights after
a colon, where the encoder takes some: ``openclip:FILE``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol, cast, runtime_checkable

from ...fem.errors import UsageError
from ...fem.registry import Registry

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Float


ENCODERS: Registry[type[ImageEncoder]] = Registry(
    "encoder",
    __package__ or "",
    {
        "embedded": "plain:Embedded",
        "openclip": "openclip:OpenClip",
        "rgb": "plain:Rgb",
        "occupancy": "plain:Occupancy",
    },
)


def check_encoder(name: str, *, speaks: bool = False) -> None:
    """Refuse a name that no encoder has, before any work is done or any weights are read.

    name: Name of an encoder, with its weights after a colon or without.
    speaks: Whether it has to read words too.
    Raises UsageError: Where there is no such encoder, it takes no weights, or reads no words.
    """
    kind, colon, _ = name.partition(":")
    member = ENCODERS[kind]
    if colon and not hasattr(member, "with_weights"):
        raise UsageError("registry.encoder_takes", kind=kind, name=name)
    if speaks and not hasattr(member, "text"):
        able = " or ".join(other for other in ENCODERS if hasattr(ENCODERS[other], "text"))
        raise UsageError("registry.encoder_reads", name=name, able=able)


def load_encoder(name: str = "embedded") -> ImageEncoder:
    """Return an encoder by name; ``openclip:TAG`` and ``openclip:FILE`` choose its weights.

    Raises UsageError: Where there is no such encoder; see ``check_encoder``.
    Raises InputError: Where its package or its weights are missing.
    """
    check_encoder(name)
    kind, _, weights = name.partition(":")
    member = ENCODERS[kind]
    return member.with_weights(weights) if weights else member()  # type: ignore


def speaking_encoder(name: str = "embedded") -> Encoder:
    """Return an encoder that reads words too; raises what ``load_encoder`` raises."""
    check_encoder(name, speaks=True)
    return cast(Encoder, load_encoder(name))


# What an encoder is: pictures, and words, to vectors of one space.


@runtime_checkable
class TextEncoder(Protocol):
    """Embeds sentences as unit vectors."""

    def text(self, sentences: Sequence[str]) -> Float[np.ndarray, "n dim"]:
        """Unit embedding of each sentence, shape (n, dim)."""


@runtime_checkable
class ImageEncoder(Protocol):
    """Turns pictures into dense features; ``name`` goes into the provenance of every result."""

    name: str
    dim: int

    def dense(
        self, images: Float[np.ndarray, "views height width channels"]
    ) -> Float[np.ndarray, "views rows columns dim"]:
        """Features of pictures in [0, 1], a vector per cell of a coarser grid over each.

        Channels are red, green, blue and, if there is a fourth, opacity; colours lie on a plain
        background already.
        """


@runtime_checkable
class Encoder(ImageEncoder, TextEncoder, Protocol):
    """An image encoder with words in the same space, both of unit norm."""
