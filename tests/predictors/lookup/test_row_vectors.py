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
    true = MiniLM().text(texts)
    half_a_step = np.abs(true).max(axis=1, keepdims=True) / 254  # of the bytes of its row
    assert (np.abs(kept - true) <= 1.001 * half_a_step + 1e-6).all()  # single precision, threads
