"""Sentence embeddings of the table's rows, kept in a file: embedding them takes seconds a start.

``python -m autophyx_tet.predictors.lookup.row_vectors`` writes the file anew. A row that it lacks
is embedded when it is asked for, so a table that has changed is slower, not wrong.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np

from ...fem.scene.materials import Material, MaterialTable, load_table

FILE = Path(__file__).resolve().parent.parent / "weights" / "row_vectors.safetensors"


def row_text(row: Material) -> str:
    """Return what is embedded of a row: its name without the small print, and an everyday word."""
    return ", ".join([re.sub(r"\s*\(.*\)", "", row.name), *row.aliases[:2]])


@cache
def kept_vectors() -> Mapping[str, np.ndarray]:
    """Unit vectors (384,) by text, of ``all-MiniLM-L6-v2``, rounded to half precision."""
    from safetensors import safe_open

    with safe_open(FILE, framework="np") as file:
        texts = json.loads(file.metadata()["texts"])
        return dict(zip(texts, file.get_tensor("vectors").astype(np.float32), strict=True))


def keep_vectors(table: MaterialTable) -> None:
    """Embed the rows that are no grade, and write them."""
    from safetensors.numpy import save_file

    from ..encoders.minilm import MiniLM

    texts = [row_text(row) for row in table if not row.grade]
    vectors = MiniLM().text(texts).astype(np.float16)
    save_file({"vectors": vectors}, FILE, metadata={"texts": json.dumps(texts)})


if __name__ == "__main__":
    keep_vectors(load_table())
