"""The row of a table that is nearest to values which a network found."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Float

from ...fem.scene.materials import Material, MaterialTable
from ..normalisation import Normalisation


def nearest_row(
    table: MaterialTable,
    normalisation: Normalisation,
    values: Float[np.ndarray, "3"],
    *,
    grades: bool = True,
) -> Material:
    """Return the row nearest to normalised log E, nu, log rho; ``grades`` may be left out."""
    rows, known = _known_values(table, normalisation, grades)
    return rows[int(np.square(known - values).sum(axis=1).argmin())]


@lru_cache(maxsize=4)
def _known_values(
    table: MaterialTable, normalisation: Normalisation, grades: bool
) -> tuple[list[Material], Float[np.ndarray, "rows 3"]]:
    rows = [row for row in table if grades or not row.grade]
    return rows, np.array([normalisation.normalise(*row.value()) for row in rows])
