"""Spelling: words that are nearly one that the reader knows, and texts that are not English."""

from __future__ import annotations

import re
import runpy
from functools import lru_cache
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

from .lexicon import Atom, ReaderLexicon

SHORTEST_MENDED = 4  # letters: a shorter word has too many neighbours
# A text is not English where this share of its words is in no dictionary and no table.
FOREIGN_SHARE = 0.5
LANGUAGES = ("en", "de", "fr", "es", "it", "nl", "pt", "sv", "pl")


def mended_spelling(
    cut: list[Atom], lexicon: ReaderLexicon, known: set[str]
) -> tuple[list[Atom], list[str], set[int], dict[int, str]]:
    """Mend what is misspelt; tell what is in no dictionary, and a text that is not English.

    Returns the atoms, notes on the whole, where the words stand that nobody knows, and by place
    what was mended.
    """
    odd = [i for i, atom in enumerate(cut) if not _is_known(atom, lexicon, known)]
    mended, told = list(cut), {}
    for i in odd:
        near = _nearest(cut[i], lexicon, known)
        if near and not _in_designation(cut, i):
            mended[i] = cut[i]._replace(stem=near, text=near)
            told[cut[i].start] = f"read {cut[i].text!r} as {near!r}"
    for i, (atom, after) in enumerate(pairwise(mended)):  # "caste iron"
        near = _near_phrase(atom, after, lexicon)
        if near and atom.stem not in known:
            mended[i] = atom._replace(stem=near, text=near)
            told[atom.start] = f"read {atom.text!r} as {near!r}"
    left = [i for i in odd if mended[i] is cut[i]]
    strange = {cut[i].start for i in left}
    long = sum(atom.text.isalpha() and len(atom.text) >= SHORTEST_MENDED for atom in cut)
    left = [i for i in left if not cut[i].text.isupper()]
    if odd and (_is_foreign(cut) or (len(left) >= 3 and len(left) >= FOREIGN_SHARE * long)):
        note = f"{len(odd)} of {long} words are not English: only English is understood"
        return cut, [note], {cut[i].start for i in odd}, {}
    return mended, [], strange, told


def _is_foreign(cut: list[Atom]) -> bool:
    """Whether another language has more of a text's small words than English has."""
    said = [a.text.lower() for a in cut if a.text.isalpha() and not a.text.isupper()]
    small = {code: _small_words(code) for code in LANGUAGES}
    english = sum(word in small["en"] for word in said)
    alien = (sum(w in small[code] and w not in small["en"] for w in said) for code in LANGUAGES)
    return max(alien) > max(english, 1)


@lru_cache(maxsize=len(LANGUAGES))
def _small_words(code: str) -> frozenset[str]:
    """Articles, prepositions and the like of a language, from spaCy's list of it."""
    spec = find_spec("spacy")
    home = Path(str(spec.origin)).parent if spec else Path()
    # Its file by itself: the language's package brings seconds of rules for tokens.
    return frozenset(runpy.run_path(str(home / "lang" / code / "stop_words.py"))["STOP_WORDS"])


def _is_known(atom: Atom, lexicon: ReaderLexicon, known: set[str]) -> bool:
    word = atom.text.lower()
    return (
        not word[0].isalpha()
        or (len(word) < SHORTEST_MENDED and not (atom.text.isupper() and len(word) > 1))
        or word in known
        or atom.stem in known
        or word in lexicon.spellings
        or atom.stem in lexicon.spellings
        or lexicon.model.is_word(word)
        or (word,) in lexicon.meanings
        or (atom.stem,) in lexicon.rows
    )


def _in_designation(cut: list[Atom], i: int) -> bool:
    """Whether a word is glued to digits, as in "X50CrMoV15"."""
    sides = [cut[j] for j in (i - 1, i + 1) if 0 <= j < len(cut)]
    return any(
        side.text[0].isdigit() and (side.end == cut[i].start or cut[i].end == side.start)
        for side in sides
    )


def _nearest(atom: Atom, lexicon: ReaderLexicon, known: set[str]) -> str | None:
    """Return the one word that a misspelt one is near to, or None."""
    from rapidfuzz.distance import OSA
    from rapidfuzz.process import extract_iter

    if atom.text.isupper() and len(atom.text) <= SHORTEST_MENDED + 1:
        return None  # an acronym
    words = [*lexicon.spellings, *(w for w in known if len(w) >= SHORTEST_MENDED and w.isalpha())]
    best: dict[str, float] = {}
    for said in {atom.text.lower(), atom.stem}:
        for word, off, _ in extract_iter(said, words, scorer=OSA.distance, score_cutoff=2):
            skeleton = _skeleton(said) == _skeleton(word)
            limit = 2 if skeleton or len(said) >= 7 else 1
            if off <= limit and said[0] == word[0] and off <= len(said) / 2:
                best[word] = min(best.get(word, 9.0), off - 0.5 * skeleton)
    ranked = sorted(best.items(), key=lambda item: (item[1], item[0] not in known))
    nearest = [word for word, off in ranked if off == ranked[0][1]]
    nearest = [word for word in nearest if word in known] or nearest
    nearest.sort(key=lambda word: abs(len(word) - len(atom.text)))  # "silicoen" is no silicon
    # "fiber" and "fibre" are one word: either will do.
    return nearest[0] if len({_skeleton(word) for word in nearest}) == 1 else None


def _near_phrase(atom: Atom, after: Atom, lexicon: ReaderLexicon) -> str | None:
    """The first word of a row of two that a word before its second is one letter off from."""
    from rapidfuzz.distance import OSA

    firsts = lexicon.firsts.get(after.stem, ())
    if len(atom.text) < SHORTEST_MENDED or not atom.text.isalpha() or (atom.stem,) in lexicon.rows:
        return None
    if {atom.stem, atom.text.lower()} & {*firsts} or (atom.text.lower(),) in lexicon.meanings:
        return None
    if lexicon.model.is_word(atom.text.lower(), ("verb",)):  # "we took steel" is of no tool steel
        return None
    near = [word for word in firsts if OSA.distance(atom.text.lower(), word, score_cutoff=1) <= 1]
    return near[0] if len(near) == 1 else None


def _skeleton(word: str) -> str:
    """Consonants of a word, doubled ones once: what a spelling by ear keeps."""
    return re.sub(r"(.)\1", r"\1", re.sub(r"(?<!^)[aeiouyh]", "", word))
