"""The rules of the house: what imports what, and what a folder says of itself."""

import ast
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
# Arrows go down this list, between rooms and inside each: a folder or a file of a room imports only
# from those named before it. What stands in one line together knows nothing of each other.
FLOORS = {
    "fem": (
        "errors", "validation", "registry", "device", "table", "material", "mesh",
        "scene", "laws", "elements", "linalg", "grain", "solve", "mpm", "reduced", "springs",
        "identify", "scenarios", "safety", "uncertainty", "verdicts",
    ),
    "predictors": (
        "asset", "grid", "field", "encoders", "text", "appearance", "prediction", "lookup",
        "partition", "predictor", "construction", "matter", "film", "unipixie", "assign",
    ),
    "converters": (
        "registry", "files", "archives", "kernels", "mesh", "grids", "points", "embedding",
        "transfer", "carriers", "programs",
    ),
    "toolkit": (
        "asset", "meshing", "options", "walls", "driving", "verdict", "report", "simulation",
        "features", "pipeline", "transfer", "listing", "estimate", "batch", "cli",
    ),
    "research": (
        "datasets", "training", "evaluation", "image_features", "prepare", "learning", "commands",
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
