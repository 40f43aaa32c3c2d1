"""What each step of the reader does for sentences: ``python benchmarks/rules.py --sets NAME ...``.

A step is taken out where it changed something, and the sentence is scored again by the command, as
``sentences.py`` does. Printed for each: how many sentences it changes, how many of these are right
with it alone and how many without it alone, and what taking it out does to parts wrong without a
doubt and to doubts that nothing needs. Sets that nobody had read who wrote the steps tell most; a
quarter of a second a sentence and a step. Of two steps that cover each other neither shows, and no
set has things of one part, which no second opinion is asked about.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from autophyx_tet.predictors.resolve import resolve
from autophyx_tet.predictors.text import clauses, lexing, materials, numerals, reader, tagger
from sentences import SETS, PartScore, _read, bands_of, score_sentence


class Step(NamedTuple):
    """A function of the reader, and one that does nothing in its place; ``modules`` have both."""

    modules: tuple[Any, ...]
    name: str
    idle: Callable[..., Any]

    def put(self, function: Callable[..., Any]) -> None:
        """Let every module that uses it call this function."""
        for module in self.modules:
            if hasattr(module, self.name):
                setattr(module, self.name, function)


def _same(first: Any, *_: Any) -> Any:
    return first if isinstance(first, str) else list(first)


def _nothing(*_: Any, **__: Any) -> None: ...


def _false(*_: Any) -> bool:
    return False


PASSES = "finer same_again point_back join_comparisons bare_numbers lone_grades one_of spelt_out"
NOTATIONS = (
    "_with_positions _unabridged _by_position _under_units _grouped _decks _in_units rewritten"
)
DRAFTS = "take_caption settle take_state take_strange take_values _tell_compounds"
BONDS = "_beside_it _is_excepted names_object"
STEPS = (
    *(Step((lexing, reader), name, _same) for name in f"{PASSES} {NOTATIONS}".split()),
    Step((lexing,), "without_loads", lambda text: (text, [])),
    Step((lexing,), "_definitions", lambda text, _: (text, {})),
    Step((lexing,), "_column", lambda _: ""),
    Step((lexing,), "mended_spelling", lambda _, cut, *__: (cut, [], set(), {})),
    Step((materials,), "laminates", lambda *_: []),
    Step((numerals,), "in_digits", lambda text: (text, {})),
    Step((reader,), "in_english", _nothing),
    *(Step((reader,), name, _nothing) for name in DRAFTS.split()),
    Step((reader,), "_numbers_joined", lambda drafts, _: list(drafts)),
    *(Step((lexing, reader), name, _false) for name in ("puts_hue", "is_hue")),
    Step((reader,), "_filled", lambda *_: []),
    Step((reader,), "is_mixed", _false),
    *(Step((clauses, resolve), name, _false) for name in BONDS.split()),
    Step((tagger,), "_beside", _nothing),
    Step((tagger,), "_is_settled", _false),
    Step((tagger,), "_in_capitals", lambda words, _: words),
    Step((tagger,), "without_prefix", _same),
    Step((tagger,), "shared_out", _same),
)


def watched(step: Step, function: Callable[..., Any], changed: set[str]) -> Callable[..., Any]:
    """The function, noting where what it gives is no idle one's, or where it changes its input."""

    def call(*given: Any, **named: Any) -> Any:
        before, idle = repr(given), repr(step.idle(*given, **named))
        out = function(*given, **named)
        if repr(out) != idle or repr(given) != before:
            changed.add(step.name)
        return out

    return call


def counted(scores: Sequence[PartScore]) -> tuple[bool, int, int]:
    """Whether a sentence is right, its parts wrong without a doubt, its needless doubts."""
    silent = sum(not score.right and not score.warned for score in scores)
    plainly = all(score.plainly for score in scores)
    return all(score.right for score in scores), silent, plainly * (scores[0].needless or 0)


def main() -> None:
    """Score the sets with every step and without those that change something."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], allow_abbrev=False)
    parser.add_argument("--sets", nargs="+", choices=SETS, required=True)
    options = parser.parse_args()
    kept = {step: getattr(step.modules[0], step.name) for step in STEPS}
    table: dict[str, Counter[str]] = {step.name: Counter() for step in STEPS}
    total = right = 0
    with tempfile.TemporaryDirectory() as folder:
        for name in options.sets:
            bands = bands_of(name)
            for sentence in _read(name)["sentence"]:
                changed: set[str] = set()
                for step, function in kept.items():
                    step.put(watched(step, function, changed))
                with_all = counted(score_sentence(sentence, bands, Path(folder)))
                for step, function in kept.items():
                    step.put(function)
                total, right = total + 1, right + with_all[0]
                for step in (step for step in STEPS if step.name in changed):
                    step.put(step.idle)
                    without = counted(score_sentence(sentence, bands, Path(folder)))
                    step.put(kept[step])
                    row = table[step.name]
                    row["changed"] += 1
                    row["with"] += with_all[0] > without[0]
                    row["without"] += without[0] > with_all[0]
                    row["silent"] += without[1] - with_all[1]
                    row["needless"] += without[2] - with_all[2]
    print(f"{right} of {total} sentences are right with every step\n")
    print(f"{'without':18}changes   lost   won  silent  needless")
    for name, row in sorted(table.items(), key=lambda item: item[1]["with"] - item[1]["without"]):
        print(
            f"{name:18}{row['changed']:7}{row['with']:7}{row['without']:6}"
            f"{row['silent']:+8}{row['needless']:+10}"
        )


if __name__ == "__main__":
    main()
