"""The gallery of the documentation: things of Debian's sweethome3d-furniture, in pictures.

python benchmarks/gallery.py [NAME ...]     writes docs/gallery/NAME.webp and docs/data/gallery.json

What is there already is made again only by name. Every row runs the very command that it shows.
"""

import argparse
import json
import os
import shlex
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from subprocess import run

from autophyx_tet.research.datasets.sweethome3d import SOURCES, Furniture, catalog, extract
from PIL import Image

DOCS = Path(__file__).resolve().parent.parent / "docs"
QUALITY = 80  # of a WebP: about 30 kB a picture


@dataclass(frozen=True)
class Show:
    """A thing of the catalogue, what is said of it and what is done to it."""

    key: str
    text: str
    options: str = ""  # of `run`, beside --size, --text and -o


LATTICE = "--mesher stuffing --edge-length-rel 0.03"
SHOWN = (
    Show("Scopia/bowl", "porcelain", "--scenario poke"),
    Show(
        "KatorLegaz/concrete-bench",
        "the supports are concrete, the slats are oak",
        "--mesher stuffing --edge-length-rel 0.025 --load part:Bench_slats=0,-1500,0",
    ),
    Show("Scopia/puff", "soft polyurethane foam", LATTICE),
    Show("Scopia/com_bath2_esponja", "soft polyurethane foam", LATTICE),
    Show("Scopia/wood_logs", "pine wood", LATTICE),
    Show("BlendSwap-CC-0/stoneLantern", "granite", f"{LATTICE} --scenario wind"),
    Show("BlendSwap-CC-0/rock1", "granite", LATTICE),
    Show(
        "Scopia/marteau",
        "the handle is ash wood, the head is steel",
        "--part iron_Cube.001=steel --fix plane:x>0.05 --load part:iron_Cube.001=0,-50,0",
    ),
    Show(
        "Scopia/tournevis",
        "the handle is polypropylene, the metal is steel",
        f"{LATTICE} --fix part:metal --torque part:handle=2,0,0",
    ),
    Show("BlendSwap-CC-0/woodToy", "beech wood", LATTICE),
    Show("KatorLegaz/coffee-mug", "stoneware", "--scenario poke"),
    Show("BlendSwap-CC-0/basketball", "rubber", "--wall 0.004 --scenario poke"),
    Show("Scopia/rabbit", "silicone rubber"),
    Show("BlendSwap-CC-0/deer", "pine wood"),
    Show("BlendSwap-CC-0/plasticChair", "polypropylene", "--scenario poke"),
    Show("BlendSwap-CC-0/thonet", "beech wood", "--scenario poke"),
    Show("Scopia/diving-board", "the base is concrete, the rest is fibreglass"),
    Show("KatorLegaz/bar-stool", "aluminium", "--scenario poke"),
    Show(
        "Scopia/skateboard",
        "the tires are polyurethane, the rest is steel",
        "--part Circle=maple --scenario poke",
    ),
    Show("Scopia/children_chair", "beech wood", "--scenario poke"),
)


def main() -> None:
    """Make what is missing or named."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("names", nargs="*")
    names = parser.parse_args().names
    things = {item.key: item for source in SOURCES for item in catalog(source)}
    record = DOCS / "data" / "gallery.json"
    known = json.loads(record.read_text())["rows"] if record.exists() else []
    rows = {row["asset"]: row for row in known}
    for show in SHOWN:
        name = show.key.partition("/")[2]
        picture = DOCS / "gallery" / f"{name}.webp"
        if name in names or (not names and (show.key not in rows or not picture.exists())):
            rows[show.key] = made(things[show.key], show, picture)
            write(record, [rows[one.key] for one in SHOWN if one.key in rows])


def made(item: Furniture, show: Show, picture: Path) -> dict:
    """Run the command of one thing, and keep its picture and a few numbers."""
    with tempfile.TemporaryDirectory() as folder:
        obj = extract(item, Path(folder))
        words = [obj.name, "--size", f"{max(item.size):g}", *shlex.split(show.options)]
        words = ["run", *words, "--text", show.text, "-o", "out"]
        program = [sys.executable, "-m", "autophyx_tet", *words, "--json", "--no-cache"]
        before = os.times()
        done = run(program, cwd=obj.parent, check=True, capture_output=True, text=True)
        after = os.times()
        document = json.loads(done.stdout)
        small(obj.parent / "out" / "picture.png", picture)
    spent = after.children_user - before.children_user
    spent += after.children_system - before.children_system
    return {
        "asset": item.key,
        "name": item.name,
        "command": shlex.join(["autophyx-tet", *words]),
        "tets": document["tets"],
        "mass_kg": document["mass"],
        "largest_displacement_m": document["sag"]["max_displacement"],
        "warnings": len(document["warnings"]),
        "cpu_seconds": round(spent, 1),
    }


def small(source: Path, target: Path) -> None:
    """Write a picture as WebP."""
    target.parent.mkdir(exist_ok=True)
    with Image.open(source) as image:
        image.convert("RGB").save(target, "WEBP", quality=QUALITY, method=6)


def write(path: Path, rows: list[dict]) -> None:
    """Write the numbers as other benchmarks do."""
    machine = {"what": "one of two shared cores; CPU seconds of the command and its children"}
    document = {"command": "python benchmarks/gallery.py", "machine": machine, "rows": rows}
    path.write_text(json.dumps(document, indent=1) + "\n")


if __name__ == "__main__":
    main()
