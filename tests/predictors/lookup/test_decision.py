"""What the clauses about one part settle, clauses given by hand."""

import pytest
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.resolve.resolve import (
    DENSITY,
    STIFFNESS,
    Decider,
    PartStatement,
    with_relations,
)
from autophyx_tet.predictors.resolve.similarity import RowKernel
from autophyx_tet.predictors.text.clauses import Clause, Subject
from autophyx_tet.predictors.text.numerals import Comparison, Quantity
from autophyx_tet.predictors.text.parts import NamedPart, vocabulary_of

TABLE = load_table()
DECIDER = Decider(TABLE, RowKernel(TABLE))
GPA = Quantity("E", 2e9, "2 GPa")


def clause(text="", material=None, **fields) -> Clause:
    row = TABLE.exact(material) if material else None
    return Clause(
        text or material or "", (0, 0), Subject("parts"), row and row.name, material or "", **fields
    )


def decide(part, *clauses, alpha=None, **fields):
    named = NamedPart.of(part.split("/"), vocabulary_of(TABLE), 1e-3)
    return DECIDER.decide(named, PartStatement(tuple(clauses), **fields), alpha=alpha, volume=1e-3)


def test_what_is_named_wins_over_the_assets_own_word():
    choice, told = decide("seat/Wood_Oak", clause("rubber seat", "rubber"))
    assert choice.row is TABLE.exact("rubber")
    assert choice.settled
    assert not choice.guessed
    assert not told
    assert decide("seat/Wood_Oak")[0].row is TABLE.exact("oak")


def test_degrees_move_within_the_row_that_is_named():
    """Very soft < soft < plain < stiff < very stiff, all inside oak's range."""
    values = [
        decide("leg", clause("oak", "oak", stiffness=degree))[0].value.E
        for degree in (1, 2, 3, 4, 5)
    ]
    assert values == sorted(values)
    oak = TABLE.exact("oak")
    assert oak.E.min < values[0] < values[-1] < oak.E.max
    assert values[2] == pytest.approx(oak.value().E)


def test_soft_foam_is_a_row_of_its_own():
    choice, _ = decide("seat", clause("the foam is soft", "foam", stiffness=2))
    assert choice.row is TABLE.exact("soft foam")


def test_a_degree_alone_is_absolute():
    """A soft toy lies in 1e4 to 1e6 Pa, whatever the part is called; it is said to be a guess."""
    for part, said, degree in (
        ("toy", "a soft toy", 2),
        ("body", "squishy body", 1),
        ("bracket", "stiff bracket", 4),
        ("spine", "very stiff spine", 5),
    ):
        choice, _ = decide(part, clause(said, stiffness=degree))
        low, high = STIFFNESS[degree]
        assert low <= choice.value.E <= high, part
        assert choice.guessed
        assert choice.settled
    heavy, _ = decide("base", clause("heavy base", density=4))
    assert DENSITY[4].min <= heavy.value.rho <= DENSITY[4].max


def test_what_is_ruled_out_is_not_taken():
    metals = {row.name for row in TABLE if row.category == "metal"}
    choice, _ = decide("frame/Steel", clause("not metal", excluded=("metal",)))
    assert choice.row.name not in metals
    assert choice.guessed


def test_a_kind_alone_is_kept():
    choice, _ = decide("pot", clause("some ceramic", kind="glass-ceramic"))
    assert choice.row.category == "glass-ceramic"


def test_an_unknown_word_is_not_understood():
    """Its part is marked and told with the nearest words; no predictor takes it for settled."""
    choice, _ = decide("pot", clause("the pot is blarg", unknown="blarg", nearest=("glass",)))
    told = choice.warnings
    assert not choice.understood
    assert not choice.settled
    assert "'pot'" in told[0]
    assert "'blarg'" in told[0]
    assert "'glass'" in told[0]
    kept, _ = decide("pot/Ceramic", clause("the pot is blarg", unknown="blarg"))
    assert kept.row is TABLE.exact("ceramic")
    assert not kept.understood
    assert kept.row.name in kept.warnings[0]


def test_two_materials_for_one_part_are_told():
    _, told = decide("leg", clause("oak legs", "oak"), clause("steel legs", "steel"))
    assert "oak" in told[0]
    assert "steel" in told[0]


def test_what_a_thing_holds_is_not_what_it_is_made_of():
    """That is for the walls to tell."""
    choice, told = decide("mug", clause("ceramic mug full of coffee", "ceramic", filling="coffee"))
    assert choice.row is TABLE.exact("ceramic")
    assert not told


def test_relations_hold_between_parts():
    """Twice as stiff is twice; softer keeps a row that already is, and else moves it."""
    steel, _ = decide("legs", clause("steel", "steel"))
    bare, _ = decide("ring")
    for relation, wanted in (
        (Comparison("E", 2.0, True, ("legs",)), 2 * steel.value.E),
        (Comparison("E", 0.25, False, ("legs",)), 0.25 * steel.value.E),
    ):
        found, told = with_relations(
            [steel, bare], [(), (relation,)], lambda words: [0], named=[True, False]
        )
        assert found[1].value.E == pytest.approx(wanted)
        assert not told
    foam, _ = decide("seat", clause("soft foam", "soft foam"))
    softer = Comparison("E", 0.25, False, ("legs",))
    found, _ = with_relations([steel, foam], [(), (softer,)], lambda w: [0], named=[True, True])
    assert found[1] is foam
    _, told = with_relations([steel, foam], [(), (softer,)], lambda w: [], named=[True, True])
    assert "'seat'" in told[0]


def test_a_circle_of_comparisons_is_told():
    a, b = (decide(name)[0] for name in ("a", "b"))
    relations = [(Comparison("E", 2.0, True, (other,)),) for other in "ba"]
    called = {("a",): [0], ("b",): [1]}
    _, told = with_relations([a, b], relations, called.__getitem__, named=[False, False])
    assert "circle" in told[0]


def test_full_numbers_settle_a_part_without_a_word():
    numbers = (Quantity("E", 1e9, ""), Quantity("nu", 0.3, ""), Quantity("rho", 900.0, ""))
    choice, _ = decide("mystery", clause("E 1 GPa", numbers=numbers))
    assert choice.value == (1e9, 0.3, 900.0)
    assert choice.settled
    assert not choice.guessed


def test_numbers_of_an_unknown_material_stay_as_they_were_said():
    """They settle the part, which is none the less not understood."""
    choice, _ = decide("blob", clause("blarg, 2 GPa", unknown="blarg", numbers=(GPA,)))
    assert choice.value.E == GPA.value
    assert choice.settled
    assert not choice.understood
    assert "blarg" in choice.warnings[0]


def test_where_no_matter_is_as_is_said_that_is_told():
    """Nothing is metal, and neither metal nor anything else: the nearest of all is a guess."""
    every = tuple({row.category for row in TABLE})
    choice, _ = decide("blob", clause("metal", kind="metal", excluded=every))
    assert choice.guessed
    assert "no material" in choice.warnings[0]
    assert not decide("blob", clause("metal", kind="metal"))[0].warnings


def test_only_what_covers_a_part_is_told():
    choice, _ = decide("knob", clause("covered with leather", coating="leather"))
    assert choice.row is TABLE.exact("leather")
    assert choice.guessed
    assert "only what covers it" in choice.warnings[0]
    assert not decide("knob", clause("leather on oak", "oak", coating="leather"))[0].warnings
