"""Relations between parts, by the words that tell them, in four languages."""

import pytest
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.text.materials import lexicon_of
from autophyx_tet.predictors.text.relations import relation_of

LEXICON = lexicon_of(load_table())
LABELS = [["Rib"], ["plate"], ["pad_A"]]
PLATE, PAD = 1, 2


@pytest.mark.parametrize(
    ("words", "other", "measure", "factor"),
    [
        ("ten times the stiffness of the plate", PLATE, "E", 10),
        ("3x stiffer (E) than the plate", PLATE, "E", 3),
        ("modulus should come out at least 1.5 x the one of the plate", PLATE, "E", 1.5),
        ("a tenth of the stiffness of pad A", PAD, "E", 0.1),
        ("half as stiff as the plate", PLATE, "E", 0.5),
        ("20 % stiffer than the plate", PLATE, "E", 1.2),
        ("as stiff as the plate", PLATE, "E", 1),
        ("twice as dense as the plate", PLATE, "rho", 2),
        ("doppelt so hoher E-Modul wie die Platte", PLATE, "E", 2),
        ("1,5-fach so steif wie die Platte", PLATE, "E", 1.5),
        ("ca. den dreifachen E-Modul der Platte", PLATE, "E", 3),
        ("halb so schwer wie die Platte", PLATE, "rho", 0.5),
        ("deux fois plus rigide (module) que la plaque", PLATE, "E", 2),
        ("trois fois moins raide que la plaque", PLATE, "E", 1 / 3),
        ("aussi rigide que la plaque", PLATE, "E", 1),
        ("dos veces más rígido que la placa", PLATE, "E", 2),
        ("la mitad de rígido que la placa", PLATE, "E", 0.5),
        ("tres veces el módulo de la placa", PLATE, "E", 3),
    ],
)
def test_how_many_times(words, other, measure, factor):
    found = relation_of(words, 0, LABELS, None, LEXICON)
    assert (found.other, found.comparison.measure) == (other, measure)
    assert found.comparison.factor == pytest.approx(factor)
    assert found.comparison.exact


@pytest.mark.parametrize(
    ("words", "more"),
    [
        ("somewhat softer than the plate", False), ("stiffer than the plate", True),
        ("weicher als die Platte", False), ("moins raide que la plaque", False),
        ("plus souple que la plaque", False), ("más blando que la placa", False),
        ("heavier than the plate", True), ("menos rígido que la placa", False),
    ],
)  # fmt: skip
def test_more_or_less(words, more):
    found = relation_of(words, 0, LABELS, None, LEXICON)
    assert found.other == PLATE
    assert not found.comparison.exact
    assert (found.comparison.factor > 1) == more


@pytest.mark.parametrize("words", ["wie Platte", "same as the plate", "comme la plaque"])
def test_the_same_matter(words):
    assert relation_of(words, 0, LABELS, None, LEXICON) == (PLATE, None)


@pytest.mark.parametrize("words", ["dto.", "ditto", "same alloy", "ídem", "pareil"])
def test_the_same_as_what_came_before(words):
    """The part before, and nothing where there is none."""
    assert relation_of(words, 0, LABELS, PAD, LEXICON) == (PAD, None)
    assert relation_of(words, 0, LABELS, None, LEXICON) is None
