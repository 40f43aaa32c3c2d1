"""How long a sentence takes to read: the first of a process, the next ones, and ``--help``.

    python benchmarks/reading.py --json

CPU seconds of whole fresh processes less those of one that only imports the material table; of the
next sentences the median over the building half, in the process that read the first.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from statistics import median

FIRST = "A bonsai with a stiff trunk, flexible leaves, a ceramic pot and loose soil"
TABLE = "from autophyx_tet.fem.table import load_table; table = load_table()"
READ = f"""{TABLE}
from autophyx_tet.predictors.text.reader import parse
parse({FIRST!r}, table, ("trunk", "leaves", "pot", "soil"))"""
NEXT = f"""{READ}
import json, sys, time, tomllib
corpus = tomllib.load(open({{path!r}}, "rb"))["sentence"]
spent = []
for sentence in corpus:
    began = time.process_time()
    parse(sentence["text"], table, tuple(sentence["parts"]))
    spent.append(1e3 * (time.process_time() - began))
json.dump(spent, sys.stdout)"""


def spent(command: list[str]) -> float:
    """CPU seconds of a command and its children."""
    before = os.times()
    subprocess.run(command, check=True, capture_output=True)
    after = os.times()
    return (
        after.children_user - before.children_user + after.children_system - before.children_system
    )


def main() -> None:
    """Print the three figures."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    python, runs = [sys.executable, "-c"], range(options.repeats)
    cold = [spent([*python, READ]) - spent([*python, TABLE]) for _ in runs]
    helped = [spent([sys.executable, "-m", "autophyx_tet", "--help"]) for _ in runs]
    path = os.path.join(os.path.dirname(__file__), "data", "sentences_building.toml")
    done = subprocess.run(
        [*python, NEXT.format(path=path)], check=True, capture_output=True, text=True
    )
    found = {
        "first_s": round(median(cold), 3),
        "next_ms": round(median(json.loads(done.stdout)), 2),
        "help_s": round(median(helped), 3),
    }
    if options.json:
        print(json.dumps(found))
    else:
        print("first {first_s} s, next {next_ms} ms, --help {help_s} s".format(**found))


if __name__ == "__main__":
    main()
