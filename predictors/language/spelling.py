"""Spelling: words that are nearly one that the reader knows, and texts that are not English."""

from __future__ import annotations

import re

from .lexicon import Atom, ReaderLexicon

SHORTEST_MENDED = 4  # letters: a shorter word has too many neighbours
# A text is not English where this share of its words is in no dictionary and no table.
FOREIGN_SHARE = 0.4


def mended_spelling(
    cut: list[Atom], lexicon: ReaderLexicon, known: set[str]
) -> tuple[list[Atom], list[str], set[int]]:
    """Mend what is misspelt; tell what is in no dictionary, and a text that is not English."""
    odd = [i for i, atom in enumerate(cut) if not _is_known(atom, lexicon, known)]
    letters = [atom for atom in cut if atom.text.isalpha() and len(atom.text) > 1]
    mended, notes = list(cut), []
    for i in odd:
        near = _nearest(cut[i], lexicon, known)
        if near and not _in_designation(cut, i):
            mended[i] = cut[i]._replace(stem=near, text=near)
            notes.append(f"read {cut[i].text!r} as {near!r}")
    left = [i for i in odd if mended[i] is cut[i]]
    strange = {cut[i].start for i in left}
    if len(left) >= 3 and len(left) >= FOREIGN_SHARE * len(letters):
        share = len(left) / len(letters)
        note = f"{share:.0%} of the words are not English: only English is understood"
        return cut, [note], {cut[i].start for i in odd}
    return mended, notes, strange


def _is_known(atom: Atom, lexicon: ReaderLexicon, known: set[str]) -> bool:
    word = atom.text.lower()
    return (
        not word[0].isalpha()
        or len(word) < SHORTEST_MENDED
        or word in known
        or atom.stem in known
        or word in lexicon.spellings
        or atom.stem in lexicon.spellings
        or lexicon.model.is_word(word)
        or (word,) in lexicon.meanings
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

    if atom.text.isupper() and len(atom.text) <= SHORTEST_MENDED + 1:
        return None  # an acronym
    best: dict[str, float] = {}
    for word in {*lexicon.spellings, *(w for w in known if len(w) > 3 and w.isalpha())}:
        for said in {atom.text.lower(), atom.stem}:
            skeleton = _skeleton(said) == _skeleton(word)
            limit = 2 if skeleton or len(said) >= 7 else 1
            off = OSA.distance(said, word, score_cutoff=limit)
            if off <= limit and said[0] == word[0] and off <= len(said) / 2:
                best[word] = min(best.get(word, 9.0), off - 0.5 * skeleton)
    ranked = sorted(best.items(), key=lambda item: (item[1], item[0] not in known))
    nearest = [word for word, off in ranked if off == ranked[0][1]]
    nearest = [word for word in nearest if word in known] or nearest
    # "fiber" and "fibre" are one word: either will do.
    return nearest[0] if len({_skeleton(word) for word in nearest}) == 1 else None


def _skeleton(word: str) -> str:
    """Consonants of a word, doubled ones once: what a spelling by ear keeps."""
    return re.sub(r"(.)\1", r"\1", re.sub(r"(?<!^)[aeiouyh]", "", word))
