"""Laws of reading one clause: what it speaks of, of what it is, and how that is."""

import numpy as np
import pytest
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.field import DEFAULT
from autophyx_tet.predictors.film.words import CHANNELS, Lexicon, PlainWords, Reader, subject
from autophyx_tet.predictors.text.parts import THINGS, Vocabulary, known_words
from autophyx_tet.research.datasets.grammar import Grammar
from autophyx_tet.research.datasets.objects import CATEGORIES
from autophyx_tet.research.datasets.parts import LEVELS, material_at_level, part_kinds

READ = Reader(Vocabulary(load_table().phrases))


def test_subject_and_material():
    """Whatever the frame, the words for the part and the material's phrase are told apart."""
    for text, of, material in (
        ("the legs are oak", "leg", "oak"),
        ("oak for the legs", "leg", "oak"),
        ("use velvet for the fabric", "fabric", "velvet"),
        ("make the seat leather", "seat", "leather"),
        ("with a cast iron crossbar around it", "crossbar", "cast iron"),
        ("the boulder is medium firm upholstery foam", "boulder", "upholstery foam"),
        ("clay soil", "soil", "clay"),
        ("the soil and the pot are heavy", "soil pot", None),
        ("very heavy soil", "soil", None),
        ("the seat is soft as wool", "seat", None),
        ("whose rim cannot be bent", "rim", None),
        ("it is all oak", "everything", "oak"),
    ):
        said = READ(text)
        assert (said.subject, said.material) == (of, material), text


def test_a_level_moves_a_material_within_its_own_range():
    """The lexicon reads "very stiff oak" as the grammar means it, to the last digit."""
    oak = load_table().exact("oak")
    wanted = DEFAULT.normalise(*material_at_level(oak, LEVELS["very stiff"]))
    hints = Lexicon().channels("the leg is made of very stiff oak")
    start = CHANNELS.index("E")
    assert np.allclose(hints[start : start + 3], wanted, atol=1e-6)


@pytest.mark.slow
def test_materials_of_the_grammar_are_read():
    """Of 400 clauses in frames of training 98 % are read to the value they were written for."""
    grammar = Grammar(np.random.default_rng(2))
    lexicon, start = Lexicon(), CHANNELS.index("E")
    seen = [i for i, kind in enumerate(part_kinds().values()) if not kind.held_out]
    right = 0
    for key in np.random.default_rng(3).choice(seen, 400):
        phrase = grammar.part(int(key))
        assert phrase.value is not None
        found = lexicon.channels(phrase.text)[start : start + 3]
        right += np.allclose(found, DEFAULT.normalise(*phrase.value), atol=1e-5)
    assert right >= 392


def test_plain_words_speak_of_the_same_part():
    """A clause said again keeps its subject, and one that names a material stays as it was."""
    plain = PlainWords(Lexicon())
    for text in ("it has a soft seat", "the arm gives way at the slightest touch"):
        assert subject(plain(text)) == subject(text)
    said = "it has a mild steel hard shell"
    assert plain(said) == said


def test_words_for_things_are_those_of_training():
    """The names of whole things, which the reader knows, are the categories that training draws."""
    assert tuple(CATEGORIES) == THINGS
    assert {"potted plant", "backrest"} <= set(known_words())
    assert not {w for k in part_kinds().values() if k.held_out for w in k.words} & set(
        known_words()
    )
