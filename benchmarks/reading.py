"""How long a sentence takes to read: a whole cold ``assign`` of words alone, the next sentences.

    python benchmarks/reading.py --json

CPU seconds of whole fresh processes: ``assign`` of a chair's three boxes, and ``--help``, which
reads nothing. Of the next sentences the median over a set, read and judged as by ``assign``, in a
process that has read one before.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
import tomllib
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from autophyx_tet.converters.mesh.meshdata import write_mesh
from autophyx_tet.fem.device import one_thread
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.text.reader import read_sentence
from autophyx_tet.predictors.text.tagger import with_second_opinion
from sentences import parts_mesh

FIRST = "the legs are oak, the seat is soft foam and the back is cane"
PARTS = ("leg", "seat", "back")
SET = Path(__file__).parent / "data" / "sentences_twelfth_engineers.toml"


def spent(*command: str | Path) -> float:
    """CPU seconds of an ``autophyx-tet`` command and its children."""
    before = os.times()
    done = [sys.executable, "-m", "autophyx_tet", *map(str, command)]
    subprocess.run(done, check=True, capture_output=True)
    after = os.times()
    return (
        after.children_user - before.children_user + after.children_system - before.children_system
    )


def next_ms() -> float:
    """CPU milliseconds that a sentence of a set takes to be read and judged."""
    table, found = load_table(), []
    with one_thread():
        for sentence in tomllib.loads(SET.read_text(encoding="utf-8"))["sentence"]:
            labels = [[part] for part in sentence["parts"]]
            began = time.process_time()
            with_second_opinion(read_sentence(sentence["text"], labels, table), labels, table)
            found.append(1e3 * (time.process_time() - began))
    return median(found[1:])


def main() -> None:
    """Print the three figures."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    with TemporaryDirectory() as folder:
        mesh = Path(folder) / "chair.msh"
        write_mesh(mesh, parts_mesh(PARTS))
        cold = ["assign", mesh, "--text", FIRST, "-o", Path(folder) / "out.msh"]
        first = median(spent(*cold) for _ in range(options.repeats))
    found = {
        "first_s": round(first, 3),
        "next_ms": round(next_ms(), 2),
        "help_s": round(median(spent("--help") for _ in range(options.repeats)), 3),
    }
    if options.json:
        print(json.dumps(found))
    else:
        print("first {first_s} s, next {next_ms} ms, --help {help_s} s".format(**found))


if __name__ == "__main__":
    main()
