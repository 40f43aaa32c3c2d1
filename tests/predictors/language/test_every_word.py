"""Nothing that names or changes a matter is passed over: it is in a clause, ignored, or told."""

import itertools
import re
import tomllib
from pathlib import Path

import pytest
from autophyx_tet.predictors.text.english import bare, words
from autophyx_tet.predictors.text.languages import glossed, languages
from autophyx_tet.predictors.text.lexing import rewritten
from autophyx_tet.predictors.text.materials import atoms, lexicon_of
from autophyx_tet.predictors.text.parts import part_name_words
from autophyx_tet.predictors.text.reader import parse

SETS = Path(__file__).parents[3] / "benchmarks" / "data"
IGNORED = [re.compile(rf"(?<![\w.])(?:{each})(?!\w)") for each in words()["ignored"]["patterns"]]
IDLE = {word for phrase in words()["idle"]["words"] for word in phrase.split()}
# Small words and parts in other languages, which the reader glosses
IDLE |= {bare(word) for each in languages() for phrase in (*each.small, *each.parts)
         for word in phrase}  # fmt: skip
IDLE |= {"degc"}  # a unit, read with its number
SHORT = 4  # letters: a shorter word in small letters is no name that could be missed


def _lost(text, names, table):
    """Words and codes that speak of a matter and that the reader neither took nor told."""
    lexicon, sentence = lexicon_of(table), parse(text, table, names)
    if any("a language that is not read" in note for note in sentence.notes):
        return []
    told = " ".join(
        map(
            str,
            [*sentence.unread, *sentence.notes, *(d for c in sentence.clauses for d in c.doubts)],
        )
    ).lower()
    read = rewritten(sentence.text)  # a table has become sentences
    read = re.sub(r"\w+n['’]t", lambda m: " " * len(m[0]), read)
    spans = [clause.span for clause in sentence.clauses]
    spans += [m.span() for pattern in IGNORED for m in pattern.finditer(read)]
    known = {word for name in names for word in part_name_words(name)}
    known |= {re.sub("([aou])e", r"\1", word) for word in known}  # "Rückwand" of "Rueckwand"
    # In another language its English words are judged; of a phrase, those at its first word
    foreign = glossed(atoms(read, lexicon.model, known), lexicon, known)
    english = {a.start: a.text.lower() for a in foreign.atoms} if foreign else {}
    # A kind of matter is said with what says which: "rubber stop NBR 70"
    read_kinds = {table.exact(c.material).category for c in sentence.clauses if c.material}
    lost = []
    for m in re.finditer(r"[^\W\d_]{3,}", read):
        word = english.get(m.start(), "the") if foreign else m[0].lower()
        stem = lexicon.model.singular(word)
        matter = (stem,) in lexicon.rows or word in words()["states"]["words"]
        strange = not (
            lexicon.model.is_word(word)
            or (stem,) in lexicon.meanings
            or (word,) in lexicon.meanings
        )
        glued = re.search(r"[\d_]", read[max(m.start() - 1, 0) : m.end() + 1])  # of a code
        strange = strange and (len(word) >= SHORT or m[0].isupper())
        matter = matter and (m[0].isupper() or not lexicon.needs_capitals((stem,)))
        matter = matter and lexicon.kinds.get(word) not in read_kinds
        # "réglables" of a part "pied_reglable", "Stifte" of "Stift_8"
        own = {bare(word).removesuffix(end) for end in ("", "s", "e", "en")}
        if (matter or strange) and not glued and not {word, stem, *own} & (known | IDLE):
            inside = any(a <= m.start() < b for a, b in spans)
            # Told as the user writes it, or as its English gloss
            if not inside and word not in told and m[0].lower() not in told:
                lost.append(m[0])
    return lost


def _sentences():
    for path in sorted(SETS.glob("sentences_*.toml")):
        for sentence in tomllib.loads(path.read_text(encoding="utf-8"))["sentence"]:
            yield sentence["text"], list(sentence["parts"])


@pytest.mark.parametrize("step", [30, pytest.param(12, marks=pytest.mark.long)])
def test_of_every_sentence_no_word_is_passed_over(step, table):
    some = list(_sentences())[::step]
    lost = [(found, text) for text, names in some if (found := _lost(text, names, table))]
    assert not lost


MATTERS = ["oak", "brass", "PEEK", "S355J2", "wet beech", "vibranium", "papier-mâché", "10 GPa"]
FRAMES = [
    "the {p} is {m}, not {n}", "{p}: {m}; it only looks like {n}", "{p} of {m} (was {n})",
    "a {n} floor under the {p}, which is {m}", "{m} {p}, {n} shavings beside it",
    "pos;part;material\n1;{p};{m}\n2;lid;{n}", "we tried {n}; the {p} became {m}",
    "The {p} - an heirloom - is {m} and stands on {n}. My aunt loved {n}.",
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("frame", FRAMES)
def test_of_made_sentences_no_word_is_passed_over(frame, table):
    texts = [frame.format(p="frame", m=m, n=n) for m, n in itertools.permutations(MATTERS, 2)]
    lost = [(found, text) for text in texts if (found := _lost(text, ["frame", "leg"], table))]
    assert not lost


def test_what_is_of_no_part_is_told(table):
    """And only as a note: it changes nothing."""
    said = parse("the lid is oak; it only looks like marble", table, ["lid"])
    (told,) = (note for note in said.notes if "marble" in note)
    assert told.kind == "reader.aside"
