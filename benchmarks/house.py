"""How this code is cut, beside newton, scikit-fem, diffrax and trimesh, by one rule for all.

    python benchmarks/house.py --json house.json --peer newton=~/newton/newton

Files, lines, the lengths of files and functions; private functions (one underscore, of a module or
a class) and how many of them are referred to exactly once in their module; exported names and
what their docstrings say; examples. Peers are taken where they are installed, found without being
imported, or from the folders given; tests, and examples in the first row, are not their sources.

Targets of the product (``fem``, ``predictors``, ``converters``, ``toolkit`` and the two files of
the root): at most 54,000 lines in at most 230 files, and at most 52 % of its private functions
referred to once. They say where to look; no test holds them.
"""

from __future__ import annotations

import argparse
import ast
import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PRODUCT = ("fem", "predictors", "converters", "toolkit", "__init__.py", "__main__.py")
BESIDE = ("research", "tests", "benchmarks")  # counted one by one
PEERS = {"newton": "newton", "scikit-fem": "skfem", "diffrax": "diffrax", "trimesh": "trimesh"}
TARGETS = {"lines": 54_000, "files": 230, "called_once": 0.52}
# Folders of a peer that are no sources of it.
LEFT_OUT = {"tests", "test", "examples", "docs", "benchmarks", "build", "__pycache__"}

_ATOM = r"(?:[kMGTmcn]?(?:Pa|m|g|s|Hz|N|J|W|K|A|V)|kg|rad|deg|degrees|°C?|mol|1|%)"
_POWER = _ATOM + r"(?:(?:\^|\*\*)?-?\d|[²³⁻¹]+)?"
_PRODUCT = rf"\(?{_POWER}(?:\s?[/*·.\s]\s?\(?{_POWER}\)?)*\)?"
# [Pa], [kg/m^3], [m or rad], [m, world frame]; no index (x[1]) and no reference ([1]_, .. [1]).
UNIT = re.compile(rf"(?<![\w\])`.])(?<!\.\. )\[{_PRODUCT}(?:(?:,(?! ?\d)| or )[^\]]*)?\](?!_)")
# (n, 3), (tets,), shape (rows, columns).
_SIDE = r"[\w.*+-]+(?: ?[*+-] ?\w+)?"
SHAPE = re.compile(
    rf"shapes? *:?=? *(?:of )?`*[(\[]|\({_SIDE},\)|\((?=[^)]*[A-Za-z])(?:{_SIDE}, *)+\d+\)"
    rf"|\((?=[^)]*[A-Za-z])\d+, *{_SIDE}\)"
)
# jaxtyping's: Float[np.ndarray, "n 3"].
TYPED_SHAPE = re.compile(
    r"(?:Float|Int|Bool|Shaped|Inexact|Real|UInt|Num)\[[^\"']*[\"'][^\"']*[\"']\]"
)


@dataclass(frozen=True)
class Spread:
    """Of many lengths the middle one, the one that nine in ten do not exceed, and the largest."""

    median: int
    p90: int
    max: int

    @classmethod
    def of(cls, numbers: Iterable[int]) -> Spread:
        """Spread of ``numbers``, zero of none."""
        ordered = sorted(numbers) or [0]
        last = len(ordered) - 1
        return cls(ordered[last // 2], ordered[round(0.9 * last)], ordered[-1])

    def __str__(self) -> str:
        return f"{self.median:,}/{self.p90:,}/{self.max:,}"


@dataclass(frozen=True)
class Count:
    """What one tree is made of.

    ``called_once`` of the ``private`` functions are referred to exactly once in their module. Of
    ``own_words``, functions within others among them, ``words_twice`` stand as a word exactly twice
    in its text, comments and all: a second rule, near the first, that needs no syntax tree.
    ``exported`` functions and classes stand in an ``__all__``, or are what the face of a public
    folder imports; of them so many have a unit, a shape and a doctest in their docstring, or a
    shape in their annotations. ``functions`` includes those within others.
    """

    name: str
    files: int
    lines: int
    file_lines: Spread
    functions: int
    function_lines: Spread
    private: int
    called_once: int
    own_words: int
    words_twice: int
    exported: int
    units: int
    shapes: int
    doctests: int
    examples: int


Function = ast.FunctionDef | ast.AsyncFunctionDef
Definition = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef


def private_functions(tree: ast.Module) -> list[str]:
    """Names that start with one underscore, of functions of a module and of its classes."""
    owners = [tree, *(node for node in ast.walk(tree) if isinstance(node, ast.ClassDef))]
    names = [node.name for owner in owners for node in owner.body if isinstance(node, Function)]
    return [name for name in names if name.startswith("_") and not name.startswith("__")]


def private_words(tree: ast.Module) -> list[str]:
    """Names that start with one underscore, of all functions, those within others too."""
    names = [node.name for node in ast.walk(tree) if isinstance(node, Function)]
    return [name for name in names if name.startswith("_") and not name.startswith("__")]


def references(tree: ast.Module) -> Counter[str]:
    """How often each name is read in a module, alone or as an attribute."""
    return Counter(
        node.id if isinstance(node, ast.Name) else node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Name | ast.Attribute) and isinstance(node.ctx, ast.Load)
    )


def exported_names(tree: ast.Module, *, face: bool) -> set[str]:
    """Names in ``__all__``, keys of a table that it is made of too; a face's imports without it."""
    tables = {
        target.id: {key.value for key in node.value.keys if isinstance(key, ast.Constant)}
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Dict)
        for target in node.targets
        if isinstance(target, ast.Name)
    }
    found: set[str] = set()
    listed = False
    for node in tree.body:
        if not isinstance(node, ast.Assign | ast.AugAssign | ast.AnnAssign) or node.value is None:
            continue
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        if not any(isinstance(target, ast.Name) and target.id == "__all__" for target in targets):
            continue
        listed = True
        for part in ast.walk(node.value):
            if isinstance(part, ast.Constant) and isinstance(part.value, str):
                found.add(part.value)
            elif isinstance(part, ast.Name):
                found |= tables.get(part.id, set())
    if face and not listed:
        found = {
            alias.asname or alias.name
            for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom) and node.level
            for alias in node.names
        }
    return {name for name in found if not name.startswith("_")}


def said_of(node: Definition) -> tuple[str, str]:
    """Docstring of a function, or of a class and its ``__init__``; and all its annotations."""
    inits = [
        inner for inner in getattr(node, "body", ())
        if isinstance(node, ast.ClassDef)
        and isinstance(inner, Function)
        and inner.name == "__init__"
    ]  # fmt: skip
    text = "\n".join(ast.get_docstring(one) or "" for one in (node, *inits))
    fields = [inner for inner in node.body if isinstance(inner, ast.AnnAssign)]
    arguments = [
        argument
        for one in (node, *inits)
        if isinstance(one, Function)
        for argument in ast.walk(one.args)
        if isinstance(argument, ast.arg)
    ]
    hints = [one.annotation for one in (*arguments, *fields) if one.annotation is not None]
    if isinstance(node, Function) and node.returns is not None:
        hints.append(node.returns)
    return text, "\n".join(map(ast.unparse, hints))


def sources(folder: Path, left_out: Iterable[str] = ()) -> Iterator[Path]:
    """Python files of a folder, or the file; without folders of a name that is left out."""
    for path in [folder] if folder.is_file() else sorted(folder.rglob("*.py")):
        inside = path.relative_to(folder).parts[:-1]
        if not any(part in left_out or part.startswith(".") for part in inside):
            yield path


def count(
    name: str, folders: Iterable[Path], *, left_out: Iterable[str] = (), examples: int = 0
) -> Count:
    """Count the Python files of ``folders`` (or files), by the same rule whose ever they are."""
    lengths, functions = list[int](), list[int]()
    once = private = own_words = words_twice = 0
    names: set[str] = set()
    homes: dict[str, Definition] = {}
    for folder in folders:
        for path in sources(folder, left_out):
            text = path.read_text(encoding="utf-8", errors="replace")
            tree = ast.parse(text)
            lengths.append(len(text.splitlines()))
            functions += [
                node.end_lineno - node.lineno + 1
                for node in ast.walk(tree)
                if isinstance(node, Function) and node.end_lineno is not None
            ]
            read, own = references(tree), private_functions(tree)
            private += len(own)
            once += sum(read[function] == 1 for function in own)
            words, every = Counter(re.findall(r"\w+", text)), private_words(tree)
            own_words += len(every)
            words_twice += sum(words[function] == 2 for function in every)
            inside = path.relative_to(folder).parts
            if not any(part.startswith("_") and part != "__init__.py" for part in inside):
                names |= exported_names(tree, face=path.name == "__init__.py")
            for node in tree.body:
                if isinstance(node, Definition):
                    homes.setdefault(node.name, node)
    said = [said_of(homes[one]) for one in sorted(names & homes.keys())]
    return Count(
        name=name,
        files=len(lengths),
        lines=sum(lengths),
        file_lines=Spread.of(lengths),
        functions=len(functions),
        function_lines=Spread.of(functions),
        private=private,
        called_once=once,
        own_words=own_words,
        words_twice=words_twice,
        exported=len(said),
        units=sum(bool(UNIT.search(text)) for text, _ in said),
        shapes=sum(bool(SHAPE.search(text) or TYPED_SHAPE.search(h)) for text, h in said),
        doctests=sum(">>>" in text for text, _ in said),
        examples=examples,
    )


def example_files(folder: Path) -> int:
    """Scripts and notebooks in folders called ``examples``, at any depth."""
    return sum(
        "examples" in path.relative_to(folder.parent).parts[:-1]
        for suffix in ("*.py", "*.ipynb")
        for path in folder.rglob(suffix)
        if path.name != "__init__.py"
    )


def peer_folders(given: Iterable[str]) -> dict[str, Path]:
    """Folders of the peers: those given as NAME=PATH, and those that are installed."""
    found = {}
    for name, module in PEERS.items():
        spec = find_spec(module)
        if spec is not None and spec.submodule_search_locations:
            found[name] = Path(spec.submodule_search_locations[0])
    for entry in given:
        name, equals, path = entry.partition("=")
        if not equals or not Path(path).expanduser().is_dir():
            raise SystemExit(f"--peer {entry}: wanted NAME=FOLDER")
        found[name] = Path(path).expanduser()
    return found


def counts(given: Iterable[str] = ()) -> list[Count]:
    """Count this tree, and the peers."""
    shown = example_files(ROOT / "examples") if (ROOT / "examples").is_dir() else 0
    rows = [count("product", [ROOT / part for part in PRODUCT], examples=shown)]
    rows += [count(name, [ROOT / name]) for name in BESIDE]
    for name, folder in peer_folders(given).items():
        rows.append(count(name, [folder], left_out=LEFT_OUT, examples=example_files(folder)))
    return rows


def table(rows: Iterable[Count]) -> str:
    """Two plain tables: how each is cut, and what it exports."""
    cut = [
        (
            "",
            "files",
            "lines",
            "a file",
            "functions",
            "a function",
            "private",
            "called once",
            "as words",
        )
    ]
    face = [("", "exported", "with a unit", "a shape", "a doctest", "examples")]
    for row in rows:
        share, words = (
            f"{100 * part / max(whole, 1):.0f} %"
            for part, whole in ((row.called_once, row.private), (row.words_twice, row.own_words))
        )
        sizes = (f"{row.files:,}", f"{row.lines:,}", str(row.file_lines), f"{row.functions:,}")
        cut.append((row.name, *sizes, str(row.function_lines), f"{row.private:,}", share, words))
        numbers = (row.exported, row.units, row.shapes, row.doctests, row.examples)
        face.append((row.name, *map(str, numbers)))
    target = f"{100 * TARGETS['called_once']:.0f} %"
    cut.append(
        ("target", f"{TARGETS['files']:,}", f"{TARGETS['lines']:,}", "", "", "", "", target, "")
    )
    return "\n\n".join(map(_aligned, (cut, face)))


def _aligned(rows: list[tuple[str, ...]]) -> str:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join(
        "  ".join(
            cell.rjust(width) if i else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    )


def main() -> None:
    """Print the tables, and write the numbers where they are wanted."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--peer", action="append", default=[], metavar="NAME=FOLDER")
    parser.add_argument("--json", type=Path, metavar="FILE")
    options = parser.parse_args()
    rows = counts(options.peer)
    print("lengths in lines: median/nine in ten/largest\n")
    print(table(rows))
    if options.json is not None:
        made = {"targets": TARGETS, "trees": [asdict(row) for row in rows]}
        options.json.write_text(json.dumps(made, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
