"""Predictors: appearance and text to a material field on a voxel grid.

In: an asset's parts as voxels, what is seen of them, and a sentence.
Out: E [Pa], nu [1] and rho [kg/m^3] of every cell, and why each part got what it got.
Read: assignment, predictor, prediction, language, lookup, retrieval, film, images, encoders.

The public names load on first use: ``from autophyx_tet.predictors import train_film``.
"""

from __future__ import annotations

from ..fem.public_names import on_first_use

# Public name -> module that owns it.
_HOME = {
    "Asset": "asset",
    "Grid": "grid",
    "MaterialField": "field",
    "MiniLM": "encoders.minilm",
    "HintedEncoder": "hearing.hints",
    "hemisphere": "images.cameras",
    "count_parameters": "film.unet",
    "build_text_table": "datasets.text_table",
    "save_text_table": "datasets.text_table",
    "CPU": "training.film.presets",
    "train_film": "training.film.recipe",
}
__all__ = [*_HOME]  # noqa: PLE0604  # pyright: ignore[reportUnsupportedDunderAll]
__getattr__, __dir__ = on_first_use(__name__, _HOME)
