"""The rules of the house: direction of imports, package list, start-up time, what loads."""

import ast
import os
import re
import subprocess
import sys
import tomllib

import pytest

ORDER = ["fem", "predictors", "converters", "toolkit"]
HEAVY = {
    "torch", "warp", "open3d", "pymeshlab", "pytetwild", "igl", "trimesh", "meshio", "scipy",
    "plotly", "transformers", "tokenizers", "safetensors", "pyvista", "matplotlib", "PIL",
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


def test_the_command_line_parses_without_a_heavy_package():
    """What `--help` waits for: modules are counted, because seconds depend on who else works."""
    code = "from autophyx_tet.toolkit.cli import main as c\ntry: c.main(['--help'])\n"
    code += "except SystemExit: pass"
    assert not _loaded(code) & HEAVY


def test_versions_agree(root):
    """The package, its metadata and the newest entry of the changelog name one version."""
    import autophyx_tet

    declared = tomllib.loads((root / "pyproject.toml").read_text())["project"]["version"]
    changes = (root / "CHANGELOG.md").read_text()
    assert declared == autophyx_tet.__version__
    assert re.search(r"^## (\S+)", changes, re.MULTILINE)[1] == declared


def test_notice_names_every_dependency(root):
    """Each package that pip brings for users is listed with its licence."""
    project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    users = [name for name in extras if name not in ("dev", "docs", "external")]
    wanted = project["dependencies"] + [need for name in users for need in extras[name]]
    names = {re.match(r"[\w.-]+", need)[0].lower() for need in wanted}
    notice = (root / "NOTICE").read_text().lower()
    assert {name for name in names if name not in notice} == set()


def test_no_random_example_is_timed():
    """A busy machine fails no test: generated examples have no deadline, and are the same ones."""
    from hypothesis import settings

    assert settings().deadline is None
    assert settings().derandomize or "AUTOPHYX_EXPLORE" in os.environ
