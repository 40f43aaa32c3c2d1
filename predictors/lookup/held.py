"""What a part is called after without being made of it: what it holds."""

from __future__ import annotations

from ...fem.scene.materials import Material
from ..hearing.binding import NamedPart
from ..vocabulary.lexicon import words


def is_held(part: NamedPart, row: Material) -> bool:
    """Whether a part is called after what it holds: a butter dish is not of butter."""
    containers, own = words()["containers"], part.name_words
    held = part.material_label == part.name and row.category in containers["matter"]
    return held and len(own) > 1 and own[-1] in containers["words"]
