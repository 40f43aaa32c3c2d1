"""The package as a whole: where its code lies, start-up, versions, licences of what it needs."""

import os
import re
import subprocess
import sys
import tomllib

ROOMS = ("fem", "predictors", "converters", "toolkit", "research")
HEAVY = {
    "torch", "warp", "open3d", "pymeshlab", "pytetwild", "igl", "trimesh", "meshio", "scipy",
    "plotly", "transformers", "tokenizers", "safetensors", "pyvista", "matplotlib", "PIL",
}  # fmt: skip


def test_only_the_rooms_hold_library_code(root):
    assert {p.name for p in root.glob("*.py")} == {"__init__.py", "__main__.py", "setup.py"}
    assert not [p for room in ROOMS for p in (root / room).rglob("utils.py")]


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


def test_system_libraries_are_found_without_the_path_of_root(root):
    """ldconfig stands in /sbin, which is not on the path of a user who is not root."""
    call = ["bash", str(root / ".ci" / "system")]
    said = [
        subprocess.run(call, env={"PATH": path}, capture_output=True, text=True, check=True).stdout
        for path in ("/usr/bin:/bin", "/usr/bin:/bin:/usr/sbin:/sbin")
    ]
    assert said[0] == said[1]
