"""The kept embeddings of the table's rows: all of them, and those that the encoder gives."""

import numpy as np
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.encoders.minilm import MiniLM
from autophyx_tet.predictors.resolve.similarity import kept_vectors, row_text

TABLE = load_table()


def test_every_row_is_kept():
    missing = {row_text(row) for row in TABLE if not row.grade} - set(kept_vectors())
    assert not missing, "run `python -m autophyx_tet.research.row_vectors`"


def test_they_are_the_encoders_own():
    texts = [row_text(row) for row in TABLE if not row.grade][::40]
    kept = np.stack([kept_vectors()[text] for text in texts])
    # half precision keeps eleven bits of numbers below 1/4
    np.testing.assert_allclose(kept, MiniLM().text(texts), atol=2**-13)
