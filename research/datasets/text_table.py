"""Clauses with their embeddings and meanings, as arrays: what a trainer needs of language."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Float16, Int

from ...fem.errors import InputError
from ...predictors.field import DEFAULT, Normalisation
from ...predictors.text.parts import FOREIGN, bare_words
from .grammar import Phrase, Role, level_value, object_phrases, part_pairs, write_phrases
from .objects import category_names
from .parts import LEVELS, Level, part_kinds
from .real import RealObject

Embed = Callable[[Sequence[str]], np.ndarray]


def name_text(name: str) -> str:
    """Return an asset's name as words to embed: "legno_scuro_02" becomes "wood scuro"."""
    return " ".join(FOREIGN.get(word, word) for word in bare_words(name)) or "part"


@dataclass(frozen=True, eq=False)
class TextTable:
    """Clauses as rows, sorted by role and key.

    Parameters
    ----------
    embedding
        Unit sentence embeddings.
    role, key, level
        As in ``Phrase``; level is -1 where the clause names no level.
    value
        Normalised (log E, nu, log rho) of the material it names, NaN where it names none.
    levels
        Normalised values of every kind of part at every level; the last column is the mean.
    pairs
        Part kinds of every part pair.
    real_names
        Row of the default template of each real object, and of the name of each of its slots,
        (objects, 1 + 6), -1 where there is none.
    """

    embedding: Float16[np.ndarray, "rows dim"]
    role: Int[np.ndarray, "rows"]
    key: Int[np.ndarray, "rows"]
    level: Int[np.ndarray, "rows"]
    value: Float[np.ndarray, "rows 3"]
    levels: Float[np.ndarray, "kinds levels 3"]
    pairs: Int[np.ndarray, "pairs 2"]
    real_names: Int[np.ndarray, "objects 7"]
    normalisation: Normalisation = DEFAULT
    texts: tuple[str, ...] = ()  # of the rows; not kept in files


def build_text_table(
    rng: np.random.Generator,
    embed: Embed,
    *,
    per_part: int = 300,
    held_out: bool = False,
    real: Sequence[RealObject] = (),
) -> TextTable:
    """Write clauses, embed each distinct text once, and turn their meanings into numbers."""
    categories = category_names()
    phrases = write_phrases(rng, per_part=per_part, held_out=held_out)
    # Real objects and slots get keys beyond those that training draws at random.
    phrases += object_phrases([*categories, *(o.name for o in real)])
    beyond = len(part_kinds())
    slots = sorted({name_text(slot) for o in real for slot in o.slots})
    phrases += [Phrase(text, Role.NAME, beyond + i) for i, text in enumerate(slots)]
    phrases.sort(key=lambda phrase: (phrase.role, phrase.key))
    texts = sorted({phrase.text for phrase in phrases}, key=len)
    number = {text: i for i, text in enumerate(texts)}
    vectors = embed(texts).astype(np.float16)
    first: dict[tuple[int, int], int] = {}
    for row, phrase in enumerate(phrases):
        first.setdefault((phrase.role, phrase.key), row)
    named = np.full((len(real), 7), -1, dtype=np.int32)
    for i, o in enumerate(real):
        named[i, 0] = first[Role.OBJECT, len(categories) + i]
        for j, slot in enumerate(o.slots[:6]):
            named[i, 1 + j] = first[Role.NAME, beyond + slots.index(name_text(slot))]
    unknown = (np.nan,) * 3
    values = [p.value if p.value is None else DEFAULT.normalise(*p.value) for p in phrases]
    return TextTable(
        vectors[[number[phrase.text] for phrase in phrases]],
        np.array([phrase.role for phrase in phrases], dtype=np.int32),
        np.array([phrase.key for phrase in phrases], dtype=np.int32),
        np.array([phrase.level for phrase in phrases], dtype=np.int32),
        np.array([unknown if v is None else v for v in values], dtype=np.float32),
        _level_values(),
        np.array(part_pairs(), dtype=np.int32),
        named,
        texts=tuple(phrase.text for phrase in phrases),
    )


def _level_values() -> np.ndarray:
    """Normalised value of every kind of part at every level, then at none."""
    return np.array(
        [
            [DEFAULT.normalise(*level_value(kind, level)) for level in (*LEVELS.values(), Level())]
            for kind in part_kinds().values()
        ],
        dtype=np.float32,
    )


_ARRAYS = ("embedding", "role", "key", "level", "value", "levels", "pairs", "real_names")


def save_text_table(path: Path, table: TextTable) -> None:
    """Write the table as safetensors."""
    from safetensors.numpy import save_file

    save_file(
        {name: np.ascontiguousarray(getattr(table, name)) for name in _ARRAYS},
        path,
        metadata={"normalisation": json.dumps(table.normalisation.to_dict())},
    )


def load_text_table(path: Path) -> TextTable:
    """Read what ``save_text_table`` wrote."""
    from safetensors import SafetensorError, safe_open

    try:
        with safe_open(path, framework="np") as file:
            arrays = [file.get_tensor(name) for name in _ARRAYS]
            normalisation = Normalisation.from_dict(json.loads(file.metadata()["normalisation"]))
    except (SafetensorError, OSError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path} is not a table of clauses: {error}") from error
    return TextTable(**dict(zip(_ARRAYS, arrays, strict=True)), normalisation=normalisation)
