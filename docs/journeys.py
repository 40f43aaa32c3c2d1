"""The two journeys through the house, followed while the code runs: a sentence, and one E.

``python docs/journeys.py`` runs ``assign`` and ``simulate`` on a small box, notes every function of
ours that is handed the traveller, and writes what it saw: the lists in ``architecture.md`` and the
picture ``architecture.png``. A stay is an unbroken run of calls into one file; a return is a stay
in a file that had been left. The limits are in tests/test_journeys.py.
"""

from __future__ import annotations

import re
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import autophyx_tet as apx
import numpy as np
from autophyx_tet.fem.material import ElementMaterial, LameParameters
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.predictors.field import MaterialField
from autophyx_tet.predictors.prediction import PartChoice, Prediction
from autophyx_tet.predictors.resolve.resolve import PartStatement
from autophyx_tet.predictors.text.clauses import Bound, Clause, Sentence
from autophyx_tet.predictors.text.lexing import Lexed, Lexeme
from autophyx_tet.predictors.text.numerals import Numeral, Quantity
from autophyx_tet.predictors.text.reader import Constituent, Draft, Group, Mention
from autophyx_tet.toolkit.options import AssignOptions

HERE = Path(__file__).resolve().parent
ROOMS = ("fem", "predictors", "converters", "toolkit")
TEXT = "the legs are oak"  # and the seat is left to the network
CELLS = 12  # of its grid: the way is the same as on a fine one
DEEP = 6  # a report holds a result, its scene, its mesh, its material, and that the array


@cache
def file_of(file: str) -> str:
    """Path of a file of ours from the root of the tree, "" for all others."""
    path = Path(file)
    place = path.relative_to(HERE.parent) if path.is_relative_to(HERE.parent) else Path()
    return place.as_posix() if place.parts[:1] and place.parts[0] in ROOMS else ""


@cache
def parameters(code: CodeType) -> tuple[str, ...]:
    """Names of all that a function is handed, ``*args`` and ``**given`` too."""
    starred = bool(code.co_flags & 0x04) + bool(code.co_flags & 0x08)
    return code.co_varnames[: code.co_argcount + code.co_kwonlyargcount + starred]


@dataclass(eq=False)
class Entry:
    """One call: the traveller lies in an argument, or deeper in one (``holds``), or neither."""

    file: str
    function: str
    caller: Entry | None
    frame: FrameType  # kept, so that no other frame gets its id
    holds: bool
    on_the_way: bool = False


@dataclass
class Stay:
    """A file and those of its functions through which the traveller came, in order."""

    file: str
    functions: list[str] = field(default_factory=list)


class Walk:
    """A profiler that notes who is handed the traveller, and who hands it down to them.

    ``carries`` tells of a value whether it is the traveller, ``holds`` whether it has the traveller
    somewhere inside. A function that is handed a holder is on the way only where the value itself
    comes out below it: one that asks a mesh for its bounds is not. What a value tells of itself
    (a property) is no stay.
    """

    def __init__(
        self, carries: Callable[[Any], bool], holds: Callable[[Any], bool] = lambda _: False
    ) -> None:
        self.carries, self.holds = carries, holds
        self._entries: dict[int, Entry] = {}

    def __enter__(self) -> Walk:
        sys.setprofile(self._noted)
        return self

    def __exit__(self, *_: object) -> None:
        sys.setprofile(None)

    def _noted(self, frame: FrameType, event: str, _: object) -> None:
        code = frame.f_code
        if event != "call" or not file_of(code.co_filename) or code.co_name.startswith("<"):
            return
        if id(frame) in self._entries:  # a generator goes on
            return
        names = parameters(code)
        handed = [frame.f_locals.get(name) for name in names]
        itself = names == ("self",) and self.carries(handed[0])
        arrives = not itself and any(map(self.carries, handed))
        entry = Entry(
            file_of(code.co_filename),
            code.co_qualname,
            self._caller(frame),
            frame,
            not itself and (arrives or any(map(self.holds, handed))),
        )
        self._entries[id(frame)] = entry
        above = entry if arrives else None
        while above is not None and not above.on_the_way:
            above.on_the_way, above = True, above.caller

    def _caller(self, frame: FrameType) -> Entry | None:
        """The nearest call of ours below which this one is."""
        above = frame.f_back
        while above is not None and id(above) not in self._entries:
            above = above.f_back
        return None if above is None else self._entries[id(above)]

    @property
    def stays(self) -> list[Stay]:
        """All stays, in order."""
        stays: list[Stay] = []
        for entry in self._entries.values():
            if not (entry.on_the_way and entry.holds):
                continue
            if not stays or stays[-1].file != entry.file:
                stays.append(Stay(entry.file))
            if entry.function not in stays[-1].functions:
                stays[-1].functions.append(entry.function)
        return stays

    @property
    def returns(self) -> int:
        """How often a file that had been left is entered again."""
        return len(self.stays) - len({stay.file for stay in self.stays})


# What a text becomes, and then the choices that are made of it, down to the material of the tets.
READ = (
    Lexed, Lexeme, Numeral, Quantity, Constituent, Mention, Group, Draft,
    Sentence, Bound, Clause,
)  # fmt: skip
CHOSEN = (PartStatement, PartChoice, Prediction, MaterialField, ElementMaterial)


def parts_mesh() -> TetMesh:
    """A box of two parts: legs below, a seat above."""
    mesh = box_mesh((0.1, 0.1, 0.3), (2, 2, 6))
    above = (mesh.centroids[:, 2] > 0.2).astype(int)
    return TetMesh(mesh.points, mesh.tets, above, ("legs", "seat"))


def walk_of_a_sentence() -> Walk:
    """Follow the text of ``assign``, what it is read as and what is chosen of it, to the mesh."""
    kinds = (*READ, *CHOSEN)

    def carries(value: object) -> bool:
        if isinstance(value, str):
            return value == TEXT
        if isinstance(value, list | tuple) and value and not isinstance(value, kinds):
            value = value[0]
        return isinstance(value, kinds)

    mesh = parts_mesh()
    with Walk(carries) as walk:
        apx.assign(mesh, TEXT, options=AssignOptions(cells=CELLS))
    return walk


def inside(value: object) -> Iterable[object]:
    """What a container, or an object of ours, holds; nothing for all others."""
    if isinstance(value, list | tuple):
        return value
    if isinstance(value, Mapping):
        return value.values()
    ours = type(value).__module__.startswith(apx.__name__) and hasattr(value, "__dict__")
    return vars(value).values() if ours else ()


def walk_of_a_modulus() -> Walk:
    """Follow E of a mesh through ``simulate`` to the report: as E, as lam and mu, as a material."""
    mesh = parts_mesh()
    tets = len(mesh.tets)
    E = np.geomspace(1e8, 2e8, tets)
    material = ElementMaterial(E, np.full(tets, 0.3), np.full(tets, 1e3))
    known = (E, *ElementMaterial(E, material.nu, material.rho).lame)

    def carries(value: Any) -> bool:
        if isinstance(value, ElementMaterial | LameParameters):
            return True
        if type(value).__module__.startswith("warp") and getattr(value, "size", 0) == tets:
            value = value.numpy()  # an array on the device
        numbers = isinstance(value, np.ndarray) and value.dtype.kind == "f" and value.size == tets
        return numbers and any(np.allclose(value.ravel(), own, rtol=1e-6) for own in known)

    def holds(value: Any, deep: int = DEEP) -> bool:
        return any(carries(part) or (deep > 1 and holds(part, deep - 1)) for part in inside(value))

    body = mesh.with_material(material)
    with tempfile.TemporaryDirectory() as folder, Walk(carries, holds) as walk:
        apx.simulate(body, report=Path(folder, "report.html"))
    return walk


def listed(walk: Walk) -> str:
    """The stays as a numbered list, and how many of them are returns."""
    seen: set[str] = set()
    lines = []
    for number, stay in enumerate(walk.stays, 1):
        again = " (again)" if stay.file in seen else ""
        seen.add(stay.file)
        names = list(dict.fromkeys(name.rpartition(".")[2] for name in stay.functions))
        more = ["..."] if len(names) > SHOWN else []
        called = ", ".join([*(f"`{name}`" for name in names[:SHOWN]), *more])
        lines.append(f"{number}. `{stay.file}`{again}: {called}")
    counts = f"{len(walk.stays)} stays in {len(seen)} files, {walk.returns} returns."
    return "\n".join([*lines, "", counts])


SHOWN = 4  # functions of a stay


def written(page: str, walks: dict[str, Walk]) -> str:
    """``page`` with the lists between its markers replaced."""
    for name, walk in walks.items():
        marks = f"<!-- {name} -->", f"<!-- end of {name} -->"
        block = re.compile(f"{marks[0]}.*?{marks[1]}", re.DOTALL)
        page = block.sub(lambda _, w=walk, m=marks: f"{m[0]}\n{listed(w)}\n{m[1]}", page)
    return page


def draw(path: Path, walks: dict[str, Walk]) -> None:
    """Draw every journey as a line over its files, the floors of the house from bottom to top."""
    import matplotlib.pyplot as plt

    order = {room: i for i, room in enumerate(ROOMS)}
    shades = ("#eef3f8", "#f7f1e6", "#eef6ee", "#f6eef4")
    figure, axes = plt.subplots(len(walks), 1, figsize=(11, 13), layout="constrained")
    for axis, (name, walk) in zip(axes, walks.items(), strict=True):
        stays = walk.stays
        files = sorted({stay.file for stay in stays},
                       key=lambda file: (order[file.split("/")[0]], file))  # fmt: skip
        for row, file in enumerate(files):
            axis.axhspan(row - 0.5, row + 0.5, color=shades[order[file.split("/")[0]]])
        steps = [files.index(stay.file) for stay in stays]
        axis.plot(range(1, len(steps) + 1), steps, "-o", color="#1f4e79", markersize=6)
        axis.set_title(f"{name}: {len(steps)} stays, {walk.returns} returns", fontsize=10)
        axis.set_xlabel("stay")
        axis.set_xticks(range(1, len(steps) + 1, 2))
        axis.set_yticks(range(len(files)), files, fontsize=8)
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
