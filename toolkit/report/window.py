"""A window on a result that lies in a file: a mesh, or a motion with a slider for its frames."""

from __future__ import annotations

import os
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

from ...fem.errors import InputError

FIRST = ("motion.pvd", "mesh.vtu", "mesh.msh")  # of a run's folder


def show_in_window(result: Path, *, colour: str | None = None, picture: Path | None = None) -> None:
    """Open a window on a mesh or a motion, or draw the picture; a slider has the frames.

    ``result`` is a .pvd, .vtu, .vtk or .msh file, or the folder of a run; ``colour`` names the
    array to colour by.

    Raises
    ------
    InputError
        Where pyvista or a display is missing, or the file has no such array.
    """
    try:
        pyvista: Any = import_module("pyvista")  # typed, it would take a checker longer than us
    except ImportError as error:
        raise InputError("view needs pyvista: pip install 'autophyx-tet[view]'") from error
    path = _file(result)
    frames = _frames(path)
    grids = [pyvista.UnstructuredGrid(*grid) for grid, _ in frames]
    for grid, (_, arrays) in zip(grids, frames, strict=True):
        for name, (kind, values) in arrays.items():
            (grid.point_data if kind == "point" else grid.cell_data)[name] = values
    known = grids[-1].array_names
    chosen = colour or next((n for n in ("von_mises", "displacement", "E") if n in known), None)
    if colour is not None and colour not in known:
        raise InputError(f"{path} has no {colour!r}: there are {', '.join(known)}")
    if picture is None and not _has_display():
        raise InputError("view: there is no display to open a window on; --picture FILE.png draws")
    plotter: Any = pyvista.Plotter(off_screen=picture is not None, title=str(path))

    def show(frame: float) -> None:
        plotter.add_mesh(grids[round(frame)], scalars=chosen, name="body", show_edges=True)

    show(len(grids) - 1)
    plotter.add_axes()
    if len(grids) > 1 and picture is None:
        plotter.add_slider_widget(show, [0, len(grids) - 1], title="frame", fmt="%.0f")
    plotter.show(screenshot=picture or False)


def _has_display() -> bool:
    """Whether a window can open: on Linux X or Wayland is named in the environment."""
    named = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    return not sys.platform.startswith("linux") or bool(named)


def _file(result: Path) -> Path:
    """The file to look at: of a folder, its motion or its mesh."""
    if not result.is_dir():
        return result
    found = next((result / name for name in FIRST if (result / name).is_file()), None)
    if found is None:
        raise InputError(f"{result} has none of {', '.join(FIRST)}: give the folder of a run")
    return found


def _frames(path: Path) -> list[tuple[tuple[Any, ...], dict[str, tuple[str, Any]]]]:
    """Of every frame the cells, their types and the moved points, and the arrays by name."""
    import numpy as np

    from ...converters.mesh.mesh_file import read_data
    from ...converters.mesh.pvd import read_pvd

    series = [data for _, data in read_pvd(path)] if path.suffix.lower() == ".pvd" else None
    found = []
    for data in series or [read_data(path)]:
        mesh = data.mesh
        cells = np.insert(mesh.tets, 0, 4, axis=1).ravel()
        moved = mesh.points + data.point_data.get("displacement", 0)
        arrays = {name: ("point", values) for name, values in data.point_data.items()}
        arrays |= {name: ("cell", values) for name, values in data.cell_data.items()}
        if mesh.material is not None:
            names = ("E", "nu", "rho")
            arrays |= {name: ("cell", getattr(mesh.material, name)) for name in names}
        kinds = np.full(len(mesh.tets), 10, np.uint8)  # VTK's number of a tetrahedron
        found.append(((cells, kinds, moved), arrays))
    return found
