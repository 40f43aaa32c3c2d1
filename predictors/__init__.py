"""Predictors: appearance and text to a material field on a voxel grid.

In: an asset's parts as voxels, what is seen of them, and a sentence.
Out: E [Pa], nu [1] and rho [kg/m^3] of every cell, and why each part got what it got.
Read: assign, text, resolve, appearance, encoders, film, unipixie, prediction.

The public names load on first use: ``from autophyx_tet.predictors import Grid``.
"""

from __future__ import annotations

from ..fem.registry import on_first_use

# Public name -> module that owns it.
_HOME = {
    "Asset": "asset",
    "Grid": "grid",
    "MaterialField": "field",
    "MiniLM": "encoders.minilm",
    "HintedEncoder": "film.words",
    "hemisphere": "appearance.views",
    "count_parameters": "film.unet",
}
__all__ = [*_HOME]  # noqa: PLE0604
__getattr__, __dir__ = on_first_use(__name__, _HOME)
