"""The two journeys through the house, followed while the code runs: a sentence, and one E.

``python docs/journeys.py`` runs ``assign`` and ``simulate`` on a small box, notes every function of
ours that is handed the traveller, and writes what it saw: the lists in ``architecture.md`` and the
picture ``architecture.png``. A stay is an unbroken run of calls into one room (a folder, or a file
that stands beside folders); a return is a stay in a room that had been left. tests/test_journeys.py
walks anew and counts the returns.
"""

from __future__ import annotations

import re
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import FrameType
from typing import Any

import autophyx_tet as apx
import numpy as np
from autophyx_tet.converters.mesh.meshdata import write_mesh
from autophyx_tet.fem.material import ElementMaterial, LameParameters
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.predictors.text.clauses import Bound, Clause, Sentence
from autophyx_tet.predictors.text.hearing import HeardClause, HeardSentence
from autophyx_tet.toolkit.options import AssignOptions

HERE = Path(__file__).resolve().parent
ROOMS = ("fem", "predictors", "converters", "toolkit")
TEXT = "the legs are oak"  # and the seat is left to the network
CELLS = 12  # of its grid: the way is the same as on a fine one


@cache
def place_of(file: str) -> tuple[str, ...]:
    """Folders and name of a file of ours, () for all others."""
    path = Path(file)
    place = path.relative_to(HERE.parent).parts if path.is_relative_to(HERE.parent) else ()
    return place if place[:1] and place[0] in ROOMS else ()


@dataclass
class Stay:
    """A room and the files of it through which the traveller came, in order."""

    room: str
    files: list[str] = field(default_factory=list)


class Walk:
    """A profiler that notes who is handed a value that ``carries`` the traveller."""

    def __init__(self, carries: Callable[[Any], bool]) -> None:
        self.carries, self.stays = carries, list[Stay]()

    def __enter__(self) -> Walk:
        sys.setprofile(self._noted)
        return self

    def __exit__(self, *_: object) -> None:
        sys.setprofile(None)

    def _noted(self, frame: FrameType, event: str, _: object) -> None:
        code = frame.f_code
        place = place_of(code.co_filename) if event == "call" else ()
        if not place:
            return
        names = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
        if not any(self.carries(frame.f_locals.get(name)) for name in names):
            return
        room = "/".join(place[:-1]) if len(place) > 2 else "/".join(place)
        if not self.stays or self.stays[-1].room != room:
            self.stays.append(Stay(room))
        if place[-1] not in self.stays[-1].files:
            self.stays[-1].files.append(place[-1])

    @property
    def returns(self) -> int:
        """How often a room that had been left is entered again."""
        return len(self.stays) - len({stay.room for stay in self.stays})


READ = (Sentence, Bound, Clause, HeardSentence, HeardClause)  # what a text becomes


def parts_mesh() -> TetMesh:
    """A box of two parts: legs below, a seat above."""
    mesh = box_mesh((0.1, 0.1, 0.3), (2, 2, 6))
    above = (mesh.centroids[:, 2] > 0.2).astype(int)
    return TetMesh(mesh.points, mesh.tets, above, ("legs", "seat"))


def walk_of_a_sentence() -> Walk:
    """Follow the text of ``assign``, and what it becomes: a sentence and its clauses."""

    def carries(value: object) -> bool:
        if isinstance(value, str):
            return value == TEXT
        if isinstance(value, list | tuple) and value and not isinstance(value, READ):
            value = value[0]
        return isinstance(value, READ)

    mesh = parts_mesh()
    with Walk(carries) as walk:
        apx.assign(mesh, TEXT, options=AssignOptions(cells=CELLS))
    return walk


def walk_of_a_modulus() -> Walk:
    """Follow E from a .msh through ``simulate`` to the report, as E or as lam and mu."""
    mesh = parts_mesh()
    tets = len(mesh.tets)
    E = np.geomspace(1e8, 2e8, tets)
    material = ElementMaterial(E, np.full(tets, 0.3), np.full(tets, 1e3))

    def carries(value: object) -> bool:
        if isinstance(value, ElementMaterial | LameParameters):
            return True
        known = (E, *material.lame)
        return isinstance(value, np.ndarray) and any(
            value.shape == own.shape and np.allclose(value, own, rtol=1e-6) for own in known
        )

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "body.msh")
        write_mesh(path, mesh.with_material(material))
        with Walk(carries) as walk:
            apx.simulate(path, report=Path(folder, "report.html"))
    return walk


def listed(walk: Walk) -> str:
    """The stays as a numbered list, and how many of them are returns."""
    seen: set[str] = set()
    lines = []
    for number, stay in enumerate(walk.stays, 1):
        again = " (again)" if stay.room in seen else ""
        seen.add(stay.room)
        own = stay.room.endswith(".py")
        inside = "" if own else f": {', '.join(f'`{name}`' for name in stay.files)}"
        lines.append(f"{number}. `{stay.room}`{again}{inside}")
    return "\n".join([*lines, "", f"Returns to a room that had been left: {walk.returns}."])


def written(page: str, walks: dict[str, Walk]) -> str:
    """``page`` with the lists between its markers replaced."""
    for name, walk in walks.items():
        marks = f"<!-- {name} -->", f"<!-- end of {name} -->"
        block = re.compile(f"{marks[0]}.*?{marks[1]}", re.DOTALL)
        page = block.sub(lambda _, w=walk, m=marks: f"{m[0]}\n{listed(w)}\n{m[1]}", page)
    return page


def draw(path: Path, walks: dict[str, Walk]) -> None:
    """Draw every journey as a line over the rooms, the floors of the house from bottom to top."""
    import matplotlib.pyplot as plt

    order = {room: i for i, room in enumerate(ROOMS)}
    rooms = sorted({s.room for w in walks.values() for s in w.stays},
                   key=lambda room: (order[room.split("/")[0]], room))  # fmt: skip
    figure, axes = plt.subplots(1, len(walks), figsize=(11, 0.34 * len(rooms) + 1.2), sharey=True)
    shades = ("#eef3f8", "#f7f1e6", "#eef6ee", "#f6eef4")
    for axis, (name, walk) in zip(axes, walks.items(), strict=True):
        for row, room in enumerate(rooms):
            axis.axhspan(row - 0.5, row + 0.5, color=shades[order[room.split("/")[0]]])
        steps = [rooms.index(stay.room) for stay in walk.stays]
        axis.plot(range(1, len(steps) + 1), steps, "-o", color="#1f4e79", markersize=7)
        axis.set_title(f"{name}: {len(steps)} stays, {walk.returns} returns", fontsize=10)
        axis.set_xlabel("stay")
        axis.set_xticks(range(1, len(steps) + 1))
    axes[0].set_yticks(range(len(rooms)), rooms, fontsize=8)
    figure.tight_layout()
    figure.savefig(path, dpi=110, metadata={"Software": None})
    plt.close(figure)


def main() -> None:
    """Walk both, write the page and the picture."""
    walks = {"a sentence": walk_of_a_sentence(), "a modulus": walk_of_a_modulus()}
    page = HERE / "architecture.md"
    page.write_text(written(page.read_text(encoding="utf-8"), walks), encoding="utf-8")
    draw(HERE / "architecture.png", walks)


if __name__ == "__main__":
    main()
