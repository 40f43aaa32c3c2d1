"""Picture: panels side by side, still or in motion, traced on the CPU.

In: an asset, a tet mesh with values, a simulation or a run of particles.
Out: PNG, GIF and WebP files.
Read: tracer, panels, snapshot, feature_picture.
"""

from .panels import (
    Panel,
    asset_panel,
    exaggeration,
    mesh_panel,
    render_animation,
    render_png,
    story,
)

__all__ = [
    "Panel",
    "asset_panel",
    "exaggeration",
    "mesh_panel",
    "render_animation",
    "render_png",
    "story",
]
