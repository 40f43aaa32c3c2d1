"""How many sentences are understood by ``autophyx-tet assign`` with its defaults, as users get it.

``python benchmarks/sentences.py`` runs the command on every sentence of the sets: a mesh of named
parts with the sidecar of `convert`, the sentence, and nothing else; of what it prints the parts'
values and the doubts about words are scored. All in one process: 40 ms a sentence, seconds where
words leave parts open and the network is asked, minutes in all. What stands on the line beside the
options here goes to `assign` (``--predictor retrieval``).

One set served to build the reader. Each later one (``second`` to ``twentyseventh``) was written
before the reader was run on it. All but the last then served to mend it: ``held_out`` after it had
been scored twelve times, the tenth to twenty-sixth, by three hands each, after once. Sets held
out, those in ``data/held_out``, are scored with ``--held-out`` alone; every look is written down in
``data/held_out_looks.jsonl``, and their rows say how many there were. Their sentences are never
listed. The files say how they were written.

A part is right where E and rho lie in the band of the material that was said, where stated numbers
come out exactly, where a relation between parts holds, or where nothing can be known and a doubt
names the part. It is *silently wrong* where it is wrong and no doubt names it. A sentence that ends
the command in an error is wrong in all its parts, said so by its exit code, and counted by itself.
Some sentences, or their parts, allow that a part is wrong where a doubt names it: *plainly* right
is what is right without that. A doubt is *needless* in a sentence that is plainly right and needs
none.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import tempfile
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
from autophyx_tet.converters.mesh.meshdata import write_mesh
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.toolkit.asset.document import Sidecar
from autophyx_tet.toolkit.cli.main import main as autophyx_tet

CORPUS = Path(__file__).resolve().parent / "data"
LOOKS = CORPUS / "held_out_looks.jsonl"
CLOSED = CORPUS / "held_out"  # scored once, then opened: moved beside the others, into SETS
HELD_OUT = tuple(p.stem.removeprefix("sentences_") for p in sorted(CLOSED.glob("*.toml")))
# In the order in which they were written; those after the first know the bands of those before.
SETS = (
    "building", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth",
    "held_out", "tenth_engineers", "tenth_trades", "tenth_languages",
    "eleventh_engineers", "eleventh_trades", "eleventh_languages",
    "twelfth_engineers", "twelfth_trades", "twelfth_languages",
    "thirteenth_engineers", "thirteenth_trades", "thirteenth_languages",
    "fourteenth_engineers", "fourteenth_trades", "fourteenth_languages",
    "fifteenth_engineers", "fifteenth_trades", "fifteenth_languages",
    "sixteenth_engineers", "sixteenth_trades", "sixteenth_languages",
    "seventeenth_engineers", "seventeenth_trades", "seventeenth_languages",
    "eighteenth_engineers", "eighteenth_trades", "eighteenth_languages",
    "nineteenth_engineers", "nineteenth_trades", "nineteenth_languages",
    "twentieth_engineers", "twentieth_trades", "twentieth_languages",
    "twentyfirst_engineers", "twentyfirst_trades", "twentyfirst_languages",
    "twentysecond_engineers", "twentysecond_trades", "twentysecond_languages",
    "twentythird_engineers", "twentythird_trades", "twentythird_languages",
    "twentyfourth_engineers", "twentyfourth_trades", "twentyfourth_languages",
    "twentyfifth_engineers", "twentyfifth_trades", "twentyfifth_languages",
    "twentysixth_engineers", "twentysixth_trades", "twentysixth_languages",
    # Written for development, and never held out: ten of engineers, four of other languages,
    # four of trades, one of all, two about things of one part.
    *(f"development_{letter}" for letter in "abcdefghijklmnopqrstu"),
)  # fmt: skip
EXACT = 1e-4  # stated numbers come out as stated; who converted psi by hand kept five digits
NOTHING_KNOWN = ("unknown", "open")


@dataclass(frozen=True)
class PartScore:
    """One part of one sentence: whether it is right, whether a doubt names it, how it ended."""

    kind: str
    style: str
    sentence: str
    part: str
    right: bool
    plainly: bool
    warned: bool
    exit_code: int
    found: str
    wanted: str
    needless: int | None = None  # doubts of its sentence, None where one is wanted


def parts_mesh(names: tuple[str, ...]) -> TetMesh:
    """Boxes of 0.1 m in a row that do not touch, one a name."""
    boxes = [box_mesh((0.1, 0.1, 0.1), (1, 1, 1), lo=(0.2 * i, 0, 0)) for i in range(len(names))]
    count = len(boxes[0].points)
    return TetMesh(
        np.concatenate([box.points for box in boxes]),
        np.concatenate([box.tets + count * i for i, box in enumerate(boxes)]),
        region=np.repeat(np.arange(len(boxes)), len(boxes[0].tets)),
        region_names=names,
    )


def assigned(
    names: tuple[str, ...], text: str, folder: Path, others: Sequence[str] = ()
) -> tuple[int, dict[str, Any] | str]:
    """Exit code of ``autophyx-tet assign`` and the document that it prints, or its error."""
    mesh, out, err = folder / "parts.msh", io.StringIO(), io.StringIO()
    write_mesh(mesh, parts_mesh(names))
    Sidecar("z", labels=dict.fromkeys(names, ())).write(mesh)
    command = ["assign", str(mesh), "--text", text, "-o", str(folder / "stiff.msh"), "--json"]
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = autophyx_tet([*command, *others])
        except SystemExit as stop:  # a line that cannot be parsed
            code = int(stop.code or 0)
    return code, err.getvalue() if code else json.loads(out.getvalue())


def score_sentence(
    sentence: Mapping[str, Any], bands: Mapping[str, Any], folder: Path, others: Sequence[str] = ()
) -> list[PartScore]:
    """Scores of the parts of one sentence."""
    code, said = assigned(tuple(sentence["parts"]), sentence["text"], folder, others)
    about = sentence["kind"], sentence["style"], sentence["id"]
    if isinstance(said, str):
        return [
            PartScore(*about, part, False, False, True, code, said, str(wanted))
            for part, wanted in sentence["parts"].items()
        ]
    values = {row["name"]: row for row in said["parts"]}
    scores = []
    for name, wanted in sentence["parts"].items():
        warned = any(repr(name) in doubt for doubt in said["doubts"])
        found, right = "divided by its shape", False
        if name in values:
            found = "{material} E={E:.3g} nu={nu:.3g} rho={rho:.4g}".format(**values[name])
            right = is_right(wanted, values[name], values, bands, warned)
        allowed = right or (allows(sentence, wanted) and warned)
        scores.append(PartScore(*about, name, allowed, right, warned, code, found, str(wanted)))
    if sentence.get("must_warn") and not (said["doubts"] or said["notes"]):
        return [replace(score, right=False, plainly=False) for score in scores]
    wants = sentence.get("must_warn") or any(
        allows(sentence, each) or str(each) in NOTHING_KNOWN for each in sentence["parts"].values()
    )
    return scores if wants else [replace(s, needless=len(said["doubts"])) for s in scores]


def allows(sentence: Mapping[str, Any], wanted: str | Mapping[str, Any]) -> bool:
    """Whether a wrong value of a part is all right where a doubt names the part."""
    return bool(sentence.get("or_warn") or (not isinstance(wanted, str) and wanted.get("or_warn")))


def is_right(
    wanted: str | Mapping[str, Any],
    value: Mapping[str, Any],
    values: Mapping[str, Mapping[str, Any]],
    bands: Mapping[str, Any],
    warned: bool,
) -> bool:
    """Whether a part's ``value`` is what was ``wanted``: a band, numbers, a relation, a warning."""
    if wanted in NOTHING_KNOWN:
        return warned
    if isinstance(wanted, str):
        wanted = {"band": wanted}
    stated = {name: wanted[name] for name in ("E", "nu", "rho") if name in wanted}
    for name, number in stated.items():
        if abs(value[name] / number - 1) > EXACT:
            return False
    band = bands[wanted["band"]] if "band" in wanted else {}
    for name in {"E", "nu", "rho"} & set(band) - set(stated):
        low, high = band[name]
        if not low <= value[name] <= high:
            return False
    factor = wanted.get("E_factor", 1.0)
    if "less_than" in wanted and value["E"] * factor > values[wanted["less_than"]]["E"]:
        return False
    return not (
        "greater_than" in wanted and value["E"] < factor * values[wanted["greater_than"]]["E"]
    )


def score_set(name: str, folder: Path, others: Sequence[str] = ()) -> Iterator[PartScore]:
    """Scores of all parts of all sentences of a set."""
    bands = bands_of(name)
    for sentence in _read(name)["sentence"]:
        yield from score_sentence(sentence, bands, folder, others)


def bands_of(name: str) -> dict[str, Any]:
    """Bands that sentences of a set may name: its own and those of all sets before."""
    before = SETS[: SETS.index(name)] if name in SETS else SETS
    return {k: v for one in (*before, name) for k, v in _read(one)["band"].items()}


def _read(name: str) -> dict[str, Any]:
    folder = CLOSED if name in HELD_OUT else CORPUS
    return tomllib.loads((folder / f"sentences_{name}.toml").read_text(encoding="utf-8"))


def row(name: str, scores: Sequence[PartScore]) -> dict[str, Any]:
    """Counts of one set: sentences and parts right, parts silently wrong, sentences in error."""
    sentences = {score.sentence for score in scores}
    wrong = {score.sentence for score in scores if not score.right}
    allowed = {score.sentence for score in scores if not score.plainly}
    needless = {
        score.sentence: score.needless
        for score in scores
        if score.needless is not None and score.sentence not in allowed
    }
    errors = {score.sentence for score in scores if score.exit_code}
    silent = sum(not score.right and not score.warned for score in scores)
    return {
        "set": name,
        "sentences": len(sentences),
        "right": len(sentences) - len(wrong),
        "plainly_right": len(sentences) - len(allowed),
        "in_error": len(errors),
        "parts": len(scores),
        "parts_right": sum(score.right for score in scores),
        "silently_wrong": silent,
        "right_percent": round(100 * (1 - len(wrong) / len(sentences)), 1),
        "silently_wrong_percent": round(100 * silent / len(scores), 1),
        "needless_doubts": round(sum(needless.values()) / max(len(needless), 1), 2),
    }


def looked(found: Mapping[str, Any], others: Sequence[str]) -> int:
    """Write down that a held-out set was scored, and return how often it has been."""
    names = ("right_percent", "silently_wrong_percent", "in_error")
    line = {
        "set": found["set"],
        "date": date.today().isoformat(),
        "command": " ".join(["assign", *others]),
        **{name: found[name] for name in names},
    }
    with LOOKS.open("a") as file:
        file.write(json.dumps(line) + "\n")
    return sum(json.loads(look)["set"] == found["set"] for look in LOOKS.read_text().splitlines())


def main() -> None:
    """Print what came out of each set."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], allow_abbrev=False)
    parser.add_argument("--sets", nargs="*", choices=SETS, default=SETS, help="default: these all")
    parser.add_argument(
        "--held-out", action="store_true", help="those held out too: a look, written down"
    )
    parser.add_argument("--wrong", action="store_true", help="list what is wrong (not held out)")
    parser.add_argument("--json", action="store_true")
    options, others = parser.parse_known_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for name in (*options.sets, *HELD_OUT * options.held_out):
            scores = list(score_set(name, Path(folder), others))
            rows.append(row(name, scores))
            if name in HELD_OUT:
                rows[-1]["scored_times"] = looked(rows[-1], others)
            if not options.json:
                print(text_of(rows[-1], scores))
            listed = scores if options.wrong and name not in HELD_OUT else ()
            for score in listed:
                if not score.right:
                    print(score)
    if options.json:
        print(json.dumps({"rows": rows}))


def text_of(found: Mapping[str, Any], scores: Sequence[PartScore]) -> str:
    """What came out of a set, and of each kind of its sentences."""
    facts = "{right} of {sentences} sentences right ({right_percent} %), {plainly_right} plainly, "
    facts += "{in_error} in error; {parts_right} of {parts} parts, {silently_wrong} silently wrong "
    facts += "({silently_wrong_percent} %), {needless_doubts} needless doubts a sentence"
    lines = [f"{found['set']}: {facts.format(**found)}"]
    for kind in sorted({score.kind for score in scores}):
        of_kind = row(kind, [score for score in scores if score.kind == kind])
        lines.append(
            "  {set:<16} {right:>3} of {sentences:>3} right, {plainly_right:>3} plainly, "
            "{silently_wrong:>2} parts silent, {needless_doubts:.2f} needless".format(**of_kind)
        )
    return "\n".join(lines)


if __name__ == "__main__":
    main()
