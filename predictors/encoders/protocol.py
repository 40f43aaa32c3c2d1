"""What an encoder is: pictures, and words, to vectors of one space."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol, runtime_checkable

if TYPE_CHECKING:  # the command line wants the names alone
    import numpy as np
    from jaxtyping import Float


@runtime_checkable
class TextEncoder(Protocol):
    """Embeds sentences as unit vectors."""

    def text(self, sentences: Sequence[str]) -> Float[np.ndarray, "n dim"]:
        """Unit embedding of each sentence, shape (n, dim)."""
        ...


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
        ...


@runtime_checkable
class Encoder(ImageEncoder, TextEncoder, Protocol):
    """An image encoder with words in the same space, both of unit norm."""
