"""``python -m autophyx_tet.research.row_vectors`` embeds the table's rows anew."""

from __future__ import annotations

import json

from ..fem.table import MaterialTable, load_table
from ..predictors.packed import packed
from ..predictors.resolve.similarity import FILE, row_text


def keep_vectors(table: MaterialTable) -> None:
    """Embed the rows that are no grade, and write them."""
    from safetensors.numpy import save_file

    from ..predictors.encoders.minilm import MiniLM

    texts = [row_text(row) for row in table if not row.grade]
    stored = packed({"vectors": MiniLM().text(texts)})
    save_file(stored, FILE, metadata={"texts": json.dumps(texts)})


if __name__ == "__main__":
    keep_vectors(load_table())
