"""autophyx_tet: from a 3D asset and a sentence to a simulation-ready tetrahedral mesh.

The public names load on first use, so importing the package is instant.
"""

from __future__ import annotations

from .fem.note import speak_by
from .fem.registry import on_first_use

speak_by("autophyx_tet.toolkit.verdict", "template")
__version__ = "0.1.0"

# Public name -> module that owns it.
_HOME = {
    "convert": "toolkit.pipeline",
    "assign": "toolkit.pipeline",
    "simulate": "toolkit.simulation.simulate",
    "run": "toolkit.pipeline",
    "reduce": "toolkit.simulation.reducing",
    "match": "toolkit.simulation.reducing",
    "transfer": "toolkit.transfer",
    "export": "toolkit.transfer",
    "features": "toolkit.features",
    "segment": "toolkit.segment",
    "batch": "toolkit.batch",
    "train": "research.learning",
    "evaluate": "research.learning",
    "materials": "toolkit.listing",
    "info": "toolkit.listing",
    "doctor": "toolkit.listing",
    "show_report": "toolkit.report.pages",
    "load_asset": "toolkit.asset.load",
    "story": "toolkit.report.picture",
    "asset_panel": "toolkit.report.picture",
    "mesh_panel": "toolkit.report.picture",
    "exaggeration": "toolkit.report.picture",
    "render_png": "toolkit.report.picture",
    "region_png": "toolkit.report.picture",
    "render_animation": "toolkit.report.picture",
    "Scale": "toolkit.report.picture",
    "bonsai": "toolkit.asset.bonsai",
    "write_bonsai": "toolkit.asset.bonsai",
    "catalog": "research.datasets.sweethome3d",
    "extract": "research.datasets.sweethome3d",
    "load_table": "fem.table",
    "ConvertOptions": "toolkit.options",
    "AssignOptions": "toolkit.options",
    "SimulateOptions": "toolkit.options",
    "TransferOptions": "toolkit.options",
    "ExportOptions": "toolkit.options",
    "FeatureOptions": "toolkit.options",
    "BatchOptions": "toolkit.options",
    "WallOptions": "toolkit.options",
    "Check": "toolkit.verdict.check",
    "AutophyxError": "fem.errors",
    "UsageError": "fem.errors",
    "InputError": "fem.errors",
    "NoVolumeError": "fem.errors",
    "BandError": "fem.errors",
    "ConvergenceError": "fem.errors",
    "TetMesh": "fem.mesh",
    "ElementMaterial": "fem.material",
    "Grid": "predictors.grid",
    "MaterialField": "predictors.field",
    "Asset": "predictors.asset",
}
__all__ = ["__version__", *_HOME]  # noqa: PLE0604
__getattr__, __dir__ = on_first_use(__name__, _HOME)
