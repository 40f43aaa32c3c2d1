"""The encoders there are; an encoder is one file and one line here, or a call of ``register``.

A name may carry weights after a colon, where the encoder takes some: ``openclip:FILE``.
"""

from __future__ import annotations

from typing import cast

from ...fem.errors import UsageError
from ...fem.registry import Registry
from .protocol import Encoder, ImageEncoder

ENCODERS: Registry[type[ImageEncoder]] = Registry(
    "encoder",
    __package__ or "",
    {
        "embedded": "embedded:Embedded",
        "openclip": "openclip:OpenClip",
        "rgb": "plain:Rgb",
        "occupancy": "plain:Occupancy",
    },
)


def check_encoder(name: str, *, speaks: bool = False) -> None:
    """Refuse a name that no encoder has, before any work is done or any weights are read.

    Parameters
    ----------
    name
        Name of an encoder, with its weights after a colon or without.
    speaks
        Whether it has to read words too.

    Raises
    ------
    UsageError
        Where there is no such encoder, it takes no weights, or reads no words.
    """
    kind, colon, _ = name.partition(":")
    member = ENCODERS[kind]
    if colon and not hasattr(member, "with_weights"):
        raise UsageError(f"the encoder {kind!r} takes nothing after a colon, got {name!r}")
    if speaks and not hasattr(member, "text"):
        able = " or ".join(other for other in ENCODERS if hasattr(ENCODERS[other], "text"))
        raise UsageError(f"the encoder {name!r} reads no words: wanted {able}")


def load_encoder(name: str = "embedded") -> ImageEncoder:
    """Return an encoder by name; ``openclip:TAG`` and ``openclip:FILE`` choose its weights.

    Raises
    ------
    UsageError
        Where there is no such encoder; see ``check_encoder``.
    InputError
        Where its package or its weights are missing.
    """
    check_encoder(name)
    kind, _, weights = name.partition(":")
    member = ENCODERS[kind]
    return member.with_weights(weights) if weights else member()  # type: ignore[attr-defined]


def speaking_encoder(name: str = "embedded") -> Encoder:
    """Return an encoder that reads words too; raises what ``load_encoder`` raises."""
    check_encoder(name, speaks=True)
    return cast(Encoder, load_encoder(name))
