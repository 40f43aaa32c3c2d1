"""Commands that only look: the material table and what a mesh file holds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from .io.document import mesh_document


def materials(query: str = "") -> dict[str, Any]:
    """Rows of the material table that match ``query`` (all rows without one)."""
    from ..fem.scene.materials import load_table

    table = load_table()
    rows = table.search(query) if query else table.rows
    return {
        "query": query,
        "materials": [
            {
                "name": row.name,
                "category": row.category,
                "E": row.E,
                "nu": row.nu,
                "rho": row.rho,
                "aliases": row.aliases,
                "source": row.source,
            }
            for row in rows
        ],
    }


def info(file: Path) -> dict[str, Any]:
    """Size, regions, volume [m^3], mass [kg] and quality of a mesh file."""
    from ..converters.mesh.mesh_file import read_mesh
    from .meshing.quality import quality

    mesh = read_mesh(file)
    return {"file": file, **mesh_document(mesh), "quality": quality(mesh)}
