"""The rules of the house: what imports what, and what a folder says of itself."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
# Arrows go down this list, between rooms and inside each: a folder or a file of a room imports only
# from those named before it. What stands in one line together knows nothing of each other.
FLOORS = {
    "fem": (
        "note", "errors", "validation", "registry", "device", "table", "material", "mesh",
        "scene", "laws", "elements", "linalg", "grain", "solve", "mpm", "reduced", "springs",
        "identify", "scenarios", "safety", "uncertainty",
    ),
    "predictors": (
        "packed", "asset", "grid", "field", "encoders", "text", "appearance", "prediction",
        "resolve", "partition", "predictor", "construction", "matter", "regions", "film",
        "unipixie", "assign",
    ),
    "converters": (
        "registry", "files", "npz", "archives", "kernels", "mesh", "grids", "points", "embedding",
        "transfer", "programs",
    ),
    "toolkit": (
        "asset", "meshing", "options", "walls", "driving", "verdict", "report", "simulation",
        "features", "segment", "pipeline", "film", "transfer", "listing", "batch",
        "cli",
    ),
    "research": (
        "row_vectors", "voxels", "on_device", "datasets", "training", "evaluation",
        "image_features", "prepare", "learning", "commands",
    ),
}  # fmt: skip
FOLDERS = sorted({init.parent for room in FLOORS for init in (ROOT / room).rglob("__init__.py")})
CODE = [path for folder in FOLDERS for path in sorted(folder.glob("*.py"))]


def name_of(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@cache
def arrows() -> dict[str, set[str]]:
    """Module -> the modules of ours that it imports, at any depth of its code."""
    modules = {name_of(path) for path in CODE}
    out: dict[str, set[str]] = {}
    for path in CODE:
        package = list(path.relative_to(ROOT).parent.parts)
        found = out.setdefault(name_of(path), set())
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and node.level:
                base = package[: len(package) - node.level + 1]
                home = ".".join([*base, *((node.module or "").split("."))]).strip(".")
                inside = {f"{home}.{alias.name}" for alias in node.names} & modules
                found |= inside or ({home} & modules)
        found.discard(name_of(path))
    return out


def floor_of(module: str) -> tuple[str, str]:
    room, _, rest = module.partition(".")
    return room, rest.partition(".")[0]


def test_imports_only_go_down():
    """Between rooms, and between the folders and files of one room."""
    rooms = list(FLOORS)
    wrong = []
    for module, taken in arrows().items():
        room, floor = floor_of(module)
        for other in taken:
            other_room, other_floor = floor_of(other)
            if not floor or not other_floor:  # a room's own face, or the package's
                continue
            if rooms.index(other_room) > rooms.index(room):
                wrong.append(f"{module} -> {other}")
            order = FLOORS[room]
            if other_room == room and order.index(other_floor) > order.index(floor):
                wrong.append(f"{module} -> {other}")
    assert not wrong


def test_no_circles():
    """Not between two files, wherever in them the import stands."""
    state: dict[str, int] = {}
    circles = []

    def walk(module: str, path: tuple[str, ...]) -> None:
        state[module] = 1
        for other in sorted(arrows()[module]):
            if state.get(other) == 1:
                circles.append(" -> ".join([*path[path.index(other) :], other]))
            elif other not in state:
                walk(other, (*path, other))
        state[module] = 2

    for module in arrows():
        if module not in state:
            walk(module, (module,))
    assert not circles


def test_no_product_verb_imports_research():
    """What a user runs needs neither data sets nor trainers; three verbs load them when called."""
    wrong = [
        f"{module} -> {other}"
        for module, taken in arrows().items()
        for other in taken
        if other.startswith("research") and not module.startswith("research")
    ]
    assert not wrong


def test_a_folder_can_be_read():
    """Its face says in five lines what goes in, what comes out, what to read."""
    for folder in FOLDERS:
        files = sorted(path.stem for path in folder.glob("*.py"))
        said = ast.get_docstring(ast.parse((folder / "__init__.py").read_text())) or ""
        keys = ("In", "Out", "Read")
        lines = {key: said.partition(f"{key}: ")[2].partition("\n")[0] for key in keys}
        assert all(lines.values()), f"{folder}: its __init__ wants the lines In, Out and Read"
        named = lines["Read"].strip(".").split(", ")
        there = {*files, *(inner.parent.name for inner in folder.glob("*/__init__.py"))}
        assert set(named) <= there, f"{folder}: {set(named) - there} to read is not there"


# Three words and more, one of them of those that join words: lists of words to read are none.
WORD = re.compile(r"(?<![\w-])[A-Za-z]?[a-z'-]+(?![\w-])|(?<![\w-])[aA](?![\w-])")
JOINS = {
    "a", "an", "and", "are", "as", "at", "be", "beside", "but", "by", "for", "from", "got", "had",
    "has", "have", "how", "in", "into", "is", "it", "its", "no", "not", "of", "off", "on", "or",
    "over", "than", "that", "the", "their", "there", "they", "this", "to", "until", "wanted", "was",
    "were", "what", "where", "which", "with", "without",
}  # fmt: skip
FLAG = re.compile(r"(?<![\w-])--[a-z][\w-]*")
# Of a regular expression; of a file's text, or a kernel's: a deck, a tree of tags, statements.
PATTERN = re.compile(r"\(\?|\\[bdswWSD]|\[\^|\.\*|\w\|\w|^\s*[<*#]|;\n|^ {4}|\nimport ")
LOGGED = {"debug", "info", "warning", "error", "exception"}
BELOW = ("fem", "converters", "predictors")


def strings(tree: ast.AST, *, inside: tuple[ast.AST, ...] = ()) -> Iterator[tuple]:
    """Each string of a tree, holes of an f-string as {}, and the nodes that it lies in.

    Docstrings, log lines, annotations (shapes) and what is split into words are left out.
    """
    if isinstance(tree, ast.Constant | ast.JoinedStr):
        parts = tree.values if isinstance(tree, ast.JoinedStr) else [tree]
        texts = [getattr(part, "value", None) for part in parts]
        joined = "".join(text if isinstance(text, str) else "{}" for text in texts)
        if isinstance(tree, ast.JoinedStr) or isinstance(tree.value, str):
            yield joined, tree.lineno, inside
    for name, value in ast.iter_fields(tree):
        for node in value if isinstance(value, list) else [value]:
            if not isinstance(node, ast.AST) or name in ("annotation", "returns"):
                continue
            if isinstance(tree, ast.JoinedStr) and isinstance(node, ast.Constant):
                continue  # a piece of what was told above
            if isinstance(tree, ast.Expr) and isinstance(node, ast.Constant | ast.JoinedStr):
                continue  # a docstring
            function = getattr(node, "func", None)
            if isinstance(function, ast.Attribute):
                owner = getattr(function.value, "id", "")
                if owner in ("log", "_log", "logger") and function.attr in LOGGED:
                    continue
                if function.attr in ("split", "splitlines", "partition", "einsum"):
                    continue
                if owner == "re":
                    continue
            yield from strings(node, inside=(*inside, tree))


# Names of categories, states and features, and words that the network is told.
TABLES = (
    "fem/table.py", "predictors/construction.py", "predictors/matter.py",
    "predictors/film/words.py",
)  # fmt: skip


def is_sentence(text: str) -> bool:
    words = WORD.findall(text)
    joined = JOINS & {word.lower() for word in words}
    return len(words) > 2 and bool(joined) and " " in text and not PATTERN.search(text)


def worded(path: Path) -> list[tuple]:
    """Sentences and flags of a file, with the nodes that they lie in."""
    return [
        found
        for found in strings(ast.parse(path.read_text()))
        if is_sentence(found[0]) or FLAG.search(found[0])
    ]


def test_numbers_below_words_above():
    """Errors carry what, got and wanted, results typed checks: `toolkit/verdict` words them.

    No English of three words and more below it, and no flag of the command line: a caller from
    Python has none. Tables at the top of a file are data.
    """
    spoken = [
        f"{path.relative_to(ROOT)}:{line}: {text}"
        for room in BELOW
        for path in sorted((ROOT / room).rglob("*.py"))
        for text, line, inside in worded(path)
        if any(isinstance(node, ast.FunctionDef | ast.ClassDef) for node in inside)
        or path.relative_to(ROOT).as_posix() not in TABLES
    ]
    assert spoken == []


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("raise InputError(f'{x} is no part of it')", ["{} is no part of it"]),
        ("raise UsageError('--fix: unknown')", ["--fix: unknown"]),
        ("x = 'one of ' 'these'", ["one of these"]),
        ("def f():\n    'Sag of a beam.'", []),
        ("log.info('step of %g s failed', 1)", []),
        ("x = 'is of a the in'.split()", []),
        ("def f(x: Float[np.ndarray, 'a in of']): ...", []),
        (r"x = re.compile('a of (the|an)'), r'(?i)\bof the\b'", []),
        ("x = 'oak pine steel'", []),
        ("x = 'part:name'", []),
    ],
)
def test_what_a_sentence_is(source, found):
    """Docstrings, log lines, patterns, shapes and lists of words are none."""
    told = [text for text, *_ in strings(ast.parse(source)) if is_sentence(text)]
    assert [text for text in found if not FLAG.search(text)] == told
    assert [t for t, *_ in strings(ast.parse(source)) if is_sentence(t) or FLAG.search(t)] == found
