"""autophyx_tet: from a 3D asset and a sentence to a simulation-ready tetrahedral mesh.

The public names load on first use, so importing the package is instant.
"""

from __future__ import annotations

from .fem.public_names import on_first_use

__version__ = "0.1.0"

# Public name -> module that owns it.
_HOME = {
    "convert": "toolkit.pipeline",
    "assign": "toolkit.pipeline",
    "simulate": "toolkit.simulation.simulate",
    "run": "toolkit.pipeline",
    "transfer": "toolkit.transfer",
    "export": "toolkit.transfer",
    "features": "toolkit.features",
    "batch": "toolkit.batch.batch",
    "train": "toolkit.learning",
    "evaluate": "toolkit.learning",
    "materials": "toolkit.listing",
    "info": "toolkit.listing",
    "doctor": "toolkit.doctor",
    "show_report": "toolkit.report.pages",
    "load_asset": "toolkit.io.load",
    "story": "toolkit.report.picture.panels",
    "asset_panel": "toolkit.report.picture.panels",
    "mesh_panel": "toolkit.report.picture.panels",
    "exaggeration": "toolkit.report.picture.panels",
    "render_png": "toolkit.report.picture.panels",
    "render_animation": "toolkit.report.picture.panels",
    "Scale": "toolkit.report.scale",
    "bonsai": "toolkit.io.bonsai",
    "write_bonsai": "toolkit.io.bonsai",
    "catalog": "toolkit.io.sweethome3d",
    "extract": "toolkit.io.sweethome3d",
    "load_table": "fem.scene.materials",
    "ConvertOptions": "toolkit.options",
    "AssignOptions": "toolkit.options",
    "SimulateOptions": "toolkit.options",
    "TransferOptions": "toolkit.options",
    "ExportOptions": "toolkit.options",
    "WallOptions": "toolkit.walls.wall_options",
    "AutophyxError": "fem.errors",
    "TetMesh": "fem.scene.mesh",
    "ElementMaterial": "fem.scene.material",
    "Grid": "predictors.grid",
    "MaterialField": "predictors.field",
    "Asset": "predictors.asset",
}
__all__ = ["__version__", *_HOME]  # noqa: PLE0604
__getattr__, __dir__ = on_first_use(__name__, _HOME)
