"""Research: data sets, training, evaluation and the tables of the two papers.

In: assets with known materials.
Out: weights for the predictors, and how good they are.
Read: commands, learning, datasets, training, evaluation.

The public names load on first use: ``from autophyx_tet.research import train_film``.
"""

from __future__ import annotations

from ..fem.registry import on_first_use

# Public name -> module that owns it.
_HOME = {
    "build_text_table": "datasets.text_table",
    "save_text_table": "datasets.text_table",
    "CPU": "training.film.presets",
    "train_film": "training.film.recipe",
}
__all__ = [*_HOME]  # noqa: PLE0604
__getattr__, __dir__ = on_first_use(__name__, _HOME)
