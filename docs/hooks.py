"""What the pages take from the program itself: help texts, tables of formats, numbers, pictures.

A line ``{{ name argument }}`` of a page is replaced by what ``FILLERS[name]`` makes of it; every
picture of the executed notebooks is at ``pictures/NOTEBOOK-NUMBER.png``, a moving one ``.gif``.
"""

import base64
import io
import json
import os
import re
import shutil
from contextlib import redirect_stdout, suppress
from pathlib import Path
from unittest.mock import patch

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parent.parent
DATA = ROOT / "docs" / "data"
PICTURES = ("png", "gif")
ROOMS = ("fem", "predictors", "converters", "toolkit", "research")
_BLANK = re.compile(r"^\{\{ (\w+) ?(.*?) \}\}$", re.MULTILINE)


def on_startup(**_) -> None:
    """Copy the sources of the rooms: who reads them for a page walks all that lies beside them."""
    copy = ROOT / ".cache" / "rooms" / "autophyx_tet"
    shutil.rmtree(copy, ignore_errors=True)
    sources = [path for room in ROOMS for path in (ROOT / room).rglob("*.py")]
    for path in (ROOT / "__init__.py", *sources):
        there = copy / path.relative_to(ROOT)
        there.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, there)


def on_page_markdown(markdown: str, **_) -> str:
    """Fill the blanks of a page; an unknown one is an error."""
    return _BLANK.sub(lambda found: FILLERS[found[1]](*found[2].split()), markdown)


def on_files(files: Files, config) -> Files:
    """Add the pictures of the notebooks."""
    for path in sorted((ROOT / "notebooks").glob("*.ipynb")):
        cells = json.loads(path.read_text())["cells"]
        outputs = [out for cell in cells for out in cell.get("outputs", [])]
        pictures = [
            (kind, out["data"][f"image/{kind}"])
            for out in outputs
            for kind in PICTURES
            if f"image/{kind}" in out.get("data", {})
        ]
        for number, (kind, picture) in enumerate(pictures):
            name = f"pictures/{path.stem}-{number}.{kind}"
            content = base64.b64decode(picture)
            files.append(File.generated(config, name, content=content))
    return files


def commands() -> str:
    """One section a command: what ``--help-all`` prints."""
    from autophyx_tet.toolkit.cli.main import COMMANDS

    return "\n".join(f"## {name}\n\n```text\n{_help(name)}\n```\n" for name in COMMANDS)


def _help(command: str) -> str:
    from autophyx_tet.toolkit.cli.main import main

    plain, said = {"COLUMNS": "92", "NO_COLOR": "1"}, io.TextIOWrapper(io.BytesIO(), "utf-8")
    with patch.dict(os.environ, plain), redirect_stdout(said), suppress(SystemExit):
        main([command, "--help-all"])
    said.seek(0)
    return said.read().strip()


def formats(kind: str) -> str:
    """Table of the suffixes that the readers and writers know, and of what survives in a file."""
    from autophyx_tet.converters.registry import GRID_FORMATS, MESH_FORMATS, POINT_FORMATS, PROGRAMS
    from autophyx_tet.toolkit.asset.formats import ASSET_FORMATS

    if kind == "exports":
        rows = [
            (
                f"`{name}`",
                f"`{form.suffixes[0]}`",
                form.title,
                _listed(form.keeps),
                _listed(form.binned),
            )
            for name in PROGRAMS
            for form in PROGRAMS[name].formats
        ]
        return _table(("program", "file", "what", "keeps", "a value a bin"), rows)
    known = {
        "surfaces": ASSET_FORMATS,
        "meshes": MESH_FORMATS,
        "points": POINT_FORMATS,
        "grids": GRID_FORMATS,
    }[kind]
    rows = []
    for form in dict.fromkeys(known[suffix] for suffix in known):
        suffixes = ", ".join(f"`{suffix}`" for suffix in known if known[suffix] is form)
        says = ["yes" if given else "" for given in (form.read, form.write)]
        rows.append((suffixes, form.title, *says, _listed(form.keeps)))
    return _table(("suffix", "what", "read", "written", "keeps"), rows)


def _listed(items) -> str:
    """Items in the order in which the program lists them."""
    from autophyx_tet.converters.registry import Keeps

    return "; ".join(item for item in Keeps if item in items)


def measured(name: str, *columns: str) -> str:
    """Table of the chosen columns of a benchmark's rows, with its command and machine."""
    document = json.loads((DATA / f"{name}.json").read_text())
    rows = [[_cell(row.get(column)) for column in columns] for row in document["rows"]]
    heads = [column.replace("_", " ") for column in columns]
    return f"{_table(heads, rows)}\n\n{_origin(document)}"


def films() -> str:
    """A film, its command and what it took, for every scene of splats."""
    document, shown = json.loads((DATA / "splat_films.json").read_text()), []
    for row in document["rows"]:
        name = row["scene"].replace("_", " ")
        spent = f"{row['cpu_s']:.0f} CPU seconds, foretold {row['foretold_over_spent']:.2f} of that"
        shown += [
            f"### {name.capitalize()}",
            f"![{name}](films/{row['scene']}.webp)",
            f"```bash\n{row['command']}\n```",
            f"{row['splats']:,} splats; {spent}; {row['needles']} needles, {row['left']} lost",
        ]
    return "\n\n".join([*shown, _origin(document)])


def gallery() -> str:
    """A picture, its command and what came out, for every thing of the gallery."""
    from autophyx_tet.toolkit.verdict.check import mass_words, si

    shown = []
    for row in json.loads((DATA / "gallery.json").read_text())["rows"]:
        name = row["asset"].partition("/")[2]
        said = f"{row['tets']:,} tets, {mass_words(row['mass_kg'])}, moves by at most "
        said += f"{si(row['largest_displacement_m'], 'm')}; {row['cpu_seconds']:.0f} CPU seconds"
        shown += [
            f"## {row['name']}",
            f"![{row['name']}: asset, stiffness, load](gallery/{name}.webp)",
        ]
        shown += [f"```bash\n{row['command']}\n```", said]
    return "\n\n".join(shown)


def examples() -> str:
    """Every script of the examples under its question, in the order of their own page."""
    page = (ROOT / "examples" / "README.md").read_text()
    listed = re.findall(r"^\* \[(.*)\]\((\w+\.py)\)$", page, re.MULTILINE)
    shown = []
    for question, name in listed:
        code = (ROOT / "examples" / name).read_text().rstrip()
        shown += [f"## {question}", f"`examples/{name}`", f"```python\n{code}\n```"]
    return "\n\n".join(shown)


def batch(name: str) -> str:
    """What became of a batch: the counts, then the rows that failed or were tried again."""
    document = json.loads((DATA / f"{name}.json").read_text())
    facts = {key: value for key, value in document.items() if isinstance(value, int | float)}
    counts = _table([key.replace("_", " ") for key in facts], [map(_cell, facts.values())])
    odd = [row for row in document["rows"] if row["code"] or row["attempts"] > 1]
    columns = ("id", "code", "attempts", "seconds", "reason")
    rows = _table(columns, [[_cell(row[column]) for column in columns] for row in odd])
    return f"{counts}\n\n{rows if odd else 'No row failed.'}\n\n{_origin(document)}"


def _origin(document: dict) -> str:
    machine = ", ".join(f"{key} {value}" for key, value in document["machine"].items())
    return f"`{document['command']}` ({machine})"


def _cell(value) -> str:
    if isinstance(value, float):
        return f"{value:.3g}"
    return f"{value:,}" if isinstance(value, int) else str("" if value is None else value)


def _table(heads, rows) -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


FILLERS = {
    "batch": batch,
    "commands": commands,
    "examples": examples,
    "formats": formats,
    "films": films,
    "gallery": gallery,
    "measured": measured,
}
