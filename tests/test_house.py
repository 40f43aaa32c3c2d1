"""The rules of the house: direction of imports, package list, start-up time, what loads."""

import ast
import subprocess
import sys
import tomllib

import pytest

ORDER = ["fem", "predictors", "converters", "toolkit"]
HEAVY = {
    "torch", "warp", "open3d", "pymeshlab", "pytetwild", "igl", "trimesh", "meshio", "scipy",
    "plotly", "transformers",
}  # fmt: skip


def _room_imports(path, root):
    """Rooms that a file of ours imports from, by relative import at any depth."""
    depth = len(path.relative_to(root).parent.parts)
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.level:
            base = path.relative_to(root).parent.parts[: depth - node.level + 1]
            full = (*base, *(node.module or "").split("."))
            names = [n.name for n in node.names] if not full or not full[0] else [full[0]]
            yield from names
        elif isinstance(node, ast.Import | ast.ImportFrom):
            module = node.module if isinstance(node, ast.ImportFrom) else node.names[0].name
            assert not (module or "").startswith("autophyx_tet"), f"{path}: absolute import"


@pytest.mark.parametrize("room", ORDER)
def test_imports_only_go_down(room, root):
    above = set(ORDER[ORDER.index(room) + 1 :])
    files = list((root / room).rglob("*.py"))
    assert files
    for path in files:
        assert not above & set(_room_imports(path, root)), f"{path} imports from above"


def test_package_list_matches_the_tree(root):
    listed = set(
        tomllib.loads((root / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]
    )
    found = {"autophyx_tet"} | {
        "autophyx_tet." + init.parent.relative_to(root).as_posix().replace("/", ".")
        for room in ORDER
        for init in (root / room).rglob("__init__.py")
    }
    assert listed == found


def test_only_the_four_rooms_hold_library_code(root):
    assert [p.name for p in root.glob("*.py")] == ["__init__.py"]
    assert not [p for room in ORDER for p in (root / room).rglob("utils.py")]


def _loaded(code: str) -> set[str]:
    script = f"{code}\nimport sys; print(*sorted({{m.split('.')[0] for m in sys.modules}}))"
    out = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    ).stdout
    return set(out.splitlines()[-1].split())


def test_import_loads_no_heavy_package():
    assert not _loaded("import autophyx_tet") & (HEAVY | {"numpy"})
