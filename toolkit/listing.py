"""Commands that only look: the material table and what a mesh file holds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .io.document import mesh_document

if TYPE_CHECKING:
    from ..fem.scene.materials import Material


def materials(query: str = "", *, contents: bool = False) -> dict[str, Any]:
    """Rows of the material table that match ``query`` (all rows without one).

    ``contents`` asks for what fills things instead. Where nothing matches, a ``UsageError`` names
    the nearest words.
    """
    from ..fem.scene.materials import load_contents, load_table

    table = load_contents() if contents else load_table()
    rows = table.search(query) if query else list(table.rows)
    if not rows:
        table.exact(query)  # knows what was meant, and refuses
    return {"query": query, "materials": [_row(row) for row in rows]}


def _row(row: Material) -> dict[str, Any]:
    """All that is known of a material; what is not known is null."""
    from ..fem.scene.material_properties import (
        load_colours,
        load_flows,
        load_grains,
        load_strengths,
    )

    return {
        "name": row.name,
        "category": row.category,
        "E": row.E,
        "nu": row.nu,
        "rho": row.rho,
        "aliases": row.aliases,
        "source": row.source,
        "note": row.note,
        "estimated": row.estimated,
        "grade": row.grade,
        "strength": load_strengths().get(row.name),
        "flow": load_flows().get(row.name),
        "grain": load_grains().get(row.name),
        "colour": load_colours().get(row.name),
    }


def info(file: Path) -> dict[str, Any]:
    """Size, regions with lowest and highest E, nu, rho, volume, mass and quality of a mesh file."""
    from ..converters.mesh.mesh_file import read_mesh
    from .meshing.quality import quality

    mesh = read_mesh(file)
    document = mesh_document(mesh)
    if mesh.material is not None:
        for number, row in enumerate(document["regions"]):
            mine = mesh.region == number
            row |= {name: _ends(getattr(mesh.material, name)[mine]) for name in ("E", "nu", "rho")}
    return {"file": file, **document, "quality": quality(mesh)}


def _ends(values: np.ndarray) -> tuple[float, float] | None:
    """Lowest and highest, of no tets nothing."""
    return (float(values.min()), float(values.max())) if len(values) else None
