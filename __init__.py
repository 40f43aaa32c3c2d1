"""autophyx_tet: from a 3D asset and a sentence to a simulation-ready tetrahedral mesh.

The public names load on first use, so importing the package is instant.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

# Public name -> module that owns it.
_HOME = {
    "convert": ".toolkit.pipeline",
    "assign": ".toolkit.pipeline",
    "simulate": ".toolkit.simulation.simulate",
    "run": ".toolkit.pipeline",
    "transfer": ".toolkit.transfer",
    "export": ".toolkit.transfer",
    "features": ".toolkit.features",
    "batch": ".toolkit.batch.batch",
    "train": ".toolkit.learning",
    "evaluate": ".toolkit.learning",
    "materials": ".toolkit.listing",
    "info": ".toolkit.listing",
    "doctor": ".toolkit.doctor",
    "show_report": ".toolkit.report.pages",
    "load_asset": ".toolkit.io.load",
    "ConvertOptions": ".toolkit.options",
    "AssignOptions": ".toolkit.options",
    "SimulateOptions": ".toolkit.options",
    "TransferOptions": ".toolkit.options",
    "ExportOptions": ".toolkit.options",
    "WallOptions": ".toolkit.walls.wall_options",
    "AutophyxError": ".fem.errors",
    "TetMesh": ".fem.scene.mesh",
    "ElementMaterial": ".fem.scene.material",
    "Grid": ".predictors.grid",
    "MaterialField": ".predictors.field",
    "Asset": ".predictors.asset",
}
__all__ = ["__version__", *_HOME]  # noqa: PLE0604


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'autophyx_tet' has no attribute {name!r}")
    return getattr(import_module(_HOME[name], __name__), name)


def __dir__() -> list[str]:
    return sorted(__all__)
