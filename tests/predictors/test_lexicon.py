"""Laws of the lexicon: what a clause says word by word."""

import numpy as np
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.field import DEFAULT
from autophyx_tet.predictors.film.words import (
    CHANNELS,
    LOUDNESS,
    HintedEncoder,
    Lexicon,
    PlainWords,
    with_lexicon,
)
from autophyx_tet.research.datasets.parts import LEVELS
from autophyx_tet.research.datasets.wordings import sentence, wordings
from scipy.stats import spearmanr

LEXICON = Lexicon()


def channel(text: str, name: str) -> float:
    return float(LEXICON.channels(text)[CHANNELS.index(name)])


def test_scores_rise_with_the_level():
    """Over all wordings of all levels the score and the asked level correlate by >= .97."""
    for name, field in (("stiffness score", "stiffness"), ("weight score", "density")):
        asked, found = [], []
        for level, shares in LEVELS.items():
            share = getattr(shares, field)
            if share is not None and shares.nu is None:
                said = [
                    w for out in (False, True) for w in sorted(set(wordings(level, held_out=out)))
                ]
                asked += [share] * len(said)
                found += [channel(sentence("the seat", w), name) for w in said]
        assert spearmanr(asked, found)[0] >= 0.97, name


def test_a_material_is_read_exactly():
    """A named row gives its own normalised value; what is only compared with it does not."""
    oak = DEFAULT.normalise(*load_table().exact("oak").value())
    hints = LEXICON.channels("the chair legs are made of oak")
    assert np.allclose(hints[:4], [1, *oak], atol=1e-6)
    assert channel("the base is heavy as lead", "material") == 0


def test_negation_turns_the_sign():
    """What does not bend is stiff, what is not heavy is light."""
    for text, name, sign in (
        ("the seat does not bend at all", "stiffness score", 1),
        ("a flexible seat", "stiffness score", -1),
        ("the pole is not heavy", "weight score", -1),
        ("a hefty base", "weight score", 1),
    ):
        assert channel(text, name) * sign > 0, text


def test_water():
    """What floats and what sinks are told apart, negated or not."""
    assert channel("the hull floats", "floats") == channel("it never sinks", "floats") == 1
    assert channel("it cannot float", "sinks") == channel("heavier than water", "sinks") == 1


def test_hints_follow_the_embedding():
    """The embedding comes first and unchanged; a silent clause has no hint."""
    unit = np.eye(3, dtype=np.float32)[:2]
    joined = with_lexicon(unit, ["the leg", "steel leg"])
    assert np.array_equal(joined[:, :3], unit)
    assert not joined[0, 3:].any()
    assert np.isclose(joined[1, 3], LOUDNESS / np.sqrt(3))


def test_plain_words():
    """What is understood is said in plain words, once and for all; materials stay as they are."""
    plainly = PlainWords(LEXICON)
    for said, plain in (
        ("the seat gives way at the slightest touch", "the seat is very soft"),
        ("the legs are rather pliant", "the legs are soft"),
        ("a feather light wing", "a very light wing"),
        ("whose hull would not sink in water", "whose hull floats on water"),
        ("the dial breaks like a biscuit", "the dial is brittle"),
        ("soft rubber sole", "soft rubber sole"),
        ("the legs are made of oak", "the legs are made of oak"),
        ("the mushroom cap is quite firm", "the mushroom cap is stiff"),
    ):
        assert plainly(said) == plain
        assert plainly(plain) == plain


def test_training_hears_every_word():
    """With ``plain`` off the encoder hears the sentence as it was said."""
    heard = []

    class Encoder:
        def text(self, sentences):
            heard.extend(sentences)
            return np.zeros((len(sentences), 2), dtype=np.float32)

    HintedEncoder(Encoder(), plain=0).text(["a feather light wing"])
    HintedEncoder(Encoder()).text(["a feather light wing"])
    assert heard == ["wing", "a feather light wing", "wing", "a very light wing"]
