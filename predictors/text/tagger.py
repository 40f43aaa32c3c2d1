"""The span tagger: which words of a text speak of the matter of each part.

all-MiniLM-L6-v2 with low-rank changes of its weights (LoRA, Hu et al. 2021) reads "part [SEP] the
other parts [SEP] text" and gives each piece of the text a role. A word's role is decided by the
mean over its pieces. ``autophyx-tet train tagger`` learns the changes from made texts.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..encoders.minilm import MAX_TOKENS, MiniLM

WEIGHTS = Path(__file__).parents[1] / "weights" / "tagger.safetensors"
# What a word says of the part that is asked about; the first two after none decide its material.
ROLES = (
    "none", "matter", "number", "coating", "content", "excluded", "alternative", "relation",
)  # fmt: skip
CLS, SEP = 101, 102  # tokens of BERT
LONGEST_QUESTION = 96  # tokens; the names of more neighbours are left out
_SIDES = {
    "l": "left", "lh": "left", "r": "right", "rh": "right",
    "fl": "front left", "fr": "front right", "rl": "rear left", "rr": "rear right",
    "bl": "rear left", "br": "rear right",
}  # fmt: skip
_CUT = re.compile(r"(?<=[a-z])(?=[A-Z])|(?<=[^\W\d_])(?=\d)|(?<=\d)(?=[^\W\d_]{2})|[\W_]+")
_NUMBER = re.compile(r"(?: \d+)+$")


def shown_name(name: str) -> str:
    """Words of a part's name: "legFL_01" -> "leg front left 1"."""
    words = [word for word in _CUT.split(name) if word]
    shown = [
        _SIDES.get(word.lower(), word.lower()) if i else word.lower()
        for i, word in enumerate(words)
    ]
    return " ".join(str(int(w)) if w.isdecimal() else w for w in shown) or "part"


def question(names: Sequence[str], i: int) -> str:
    """What is asked about a part: its name, then the others' without their numbers."""
    others = (_NUMBER.sub("", shown_name(n)) for j, n in enumerate(names) if j != i)
    return f"{shown_name(names[i])} [SEP] " + ", ".join(dict.fromkeys(others))


def asked(question: Sequence[int], text: Sequence[int]) -> tuple[list[int], int]:
    """Tokens of a question and a text, and how many of them stand before the text."""
    head = [CLS, *question[:LONGEST_QUESTION], SEP]
    return [*head, *text, SEP], len(head)
