"""Laws of the lookup: words of the table are taken exactly, and each goes to the part it names."""

import math

import numpy as np
import pytest
from autophyx_tet.fem.errors import InputError, UsageError
from autophyx_tet.fem.table import load_table, outside_band
from autophyx_tet.predictors.grid import Grid, PartVoxels
from autophyx_tet.predictors.predictor import PREDICTORS, Predictor
from autophyx_tet.predictors.resolve.resolve import Lookup
from autophyx_tet.predictors.text.materials import lexicon_of
from autophyx_tet.predictors.text.reader import parse, read_sentence

from .phrasings import HELD_OUT, TUNED

TABLE = load_table()
STEEL_OAK, RUBBER_FOAM = "a steel frame with an oak seat", "a rubber frame with a foam seat"


LOOKUP = Lookup()


def choose(labels, text, **options):
    return LOOKUP.settle(labels, read_sentence(text, labels, TABLE), **options).choices


def materials(parts, text, **options):
    labels = [part.split("/") for part in parts.split()]
    return [choice.row for choice in choose(labels, text, **options)]


def is_right(parts, text, expected):
    found = materials(parts, text)
    if "/" in expected:  # any order: nothing tells these parts apart
        return {TABLE.exact(word).name for word in expected.split("/")} == {r.name for r in found}
    wanted = [word.strip() for word in expected.split(",")]
    assert len(wanted) == len(found)
    return all(w == "*" or row is TABLE.exact(w) for w, row in zip(wanted, found, strict=True))


@pytest.mark.slow
def test_each_word_goes_to_the_part_it_names():
    for parts, text, expected in TUNED:
        assert is_right(parts, text, expected), (parts, text)


def test_held_out_phrasings():
    """20 sentences that no rule was tuned on: at least 17 wholly right (18 were, at first try)."""
    right = [text for parts, text, want in HELD_OUT if is_right(parts, text, want)]
    assert len(right) >= 17


@pytest.mark.parametrize("every", [120, pytest.param(60, marks=pytest.mark.long)])
def test_a_bare_material_word_gives_the_table_value(every):
    """To 1e-6, for names and aliases, alone or before any noun; short acronyms in capitals."""
    lexicon = lexicon_of(TABLE)
    for row in TABLE.rows[::every]:
        for phrase in (row.name, *row.aliases):
            if lexicon.needs_capitals(lexicon.phrase(phrase)):  # "ps" may mean something else
                phrase = phrase.upper()
            for text in (phrase, f"{phrase} cube", f"a {phrase.upper()} gizmo, 10 cm"):
                (choice,) = choose([["cube"]], text)
                assert choice.row is row, text
                np.testing.assert_allclose(choice.value, row.value(), rtol=1e-6, err_msg=text)


def test_steel_ball_and_the_parts_of_one_chair():
    (ball,) = choose([["ball"]], "solid steel ball, 10 cm")
    assert math.isclose(ball.value.rho * math.pi / 6 * 0.1**3, 4.1, rel_tol=0.03)
    for parts in (
        "frame seat",
        "metal wood_seat plastic_feet",
        "mat_1 mat_2",
        "inox tela",
        "chair",
    ):
        a, b = (materials(parts, text)[0] for text in (STEEL_OAK, RUBBER_FOAM))
        assert a.value().E / b.value().E > 100, parts


def test_part_order_and_case_do_not_matter():
    parts = ["legs", "Seat/legno", "mat_7", "Back", "tela_rossa"]
    for text in (STEEL_OAK, "oak legs, leather back", "", "rubber", "the seat is soft foam"):
        wanted = dict(zip(parts, materials(" ".join(parts), text), strict=True))
        for order in (parts[::-1], parts[2:] + parts[:2]):
            found = materials(" ".join(order), text.upper())
            assert dict(zip(order, found, strict=True)) == wanted


def test_larger_parts_are_spoken_of_first():
    for volumes in ([1.0, 9.0], [9.0, 1.0]):
        rows = materials("mat_1 mat_2", STEEL_OAK, volumes=volumes)
        assert rows[int(np.argmax(volumes))] is TABLE.exact("steel")


def test_alpha_and_adjectives_move_E_within_the_row():
    oak = TABLE.exact("oak")
    values = [choose([["x"]], "oak", alpha=a)[0].value.E for a in (0.0, 0.5, 1.0)]
    np.testing.assert_allclose(values, [oak.E.min, math.sqrt(oak.E.min * oak.E.max), oak.E.max])
    soft, stiff = (
        choose([["pot"], ["leaves"]], f"ceramic pot, the leaves are {word}")[1]
        for word in ("flexible", "stiff")
    )
    assert soft.row is stiff.row is TABLE.exact("leaf")
    assert soft.row.E.min < soft.value.E < stiff.value.E < soft.row.E.max


def test_overrides_are_exact_and_unknown_parts_are_named():
    labels = [["Legs"], ["Seat"]]
    choices = choose(
        labels, "oak chair", overrides={"Seat": "a soft foam"}, materials={"legs": "6061-T6"}
    )
    assert [choice.row for choice in choices] == [TABLE.exact("6061"), TABLE.exact("soft foam")]
    assert all("override" in choice.why for choice in choices)
    with pytest.raises(UsageError, match=r"no part 'Seet': its parts are Legs, Seat; did you mean"):
        choose(labels, "", overrides={"Seet": "oak"})
    with pytest.raises(UsageError, match="did you mean"):
        choose(labels, "", materials={"Seat": "oka"})


def test_why_tells_what_decided():
    why = [
        choice.why
        for choice in choose(
            [["seat"], ["mat_3", "Metal_Chrome"], ["mystery"]], "a chair with an oak seat"
        )
    ]
    assert why[0] == "text: 'an oak seat'"
    assert why[1] == "name: 'Metal_Chrome'"


def test_words_outside_the_table_fall_to_the_nearest_row():
    """No table word: the kernel's weights are a share, the value a possible one."""
    for name in ("tyre", "rugs", "mattress", "mystery", "42"):
        (choice,) = choose([[name]], "")
        assert 0 < choice.weight <= 1
        assert not outside_band(choice.row.category, *choice.value)
    assert materials("doormats", "")[0] is TABLE.exact("carpet")


def test_a_grade_is_taken_where_it_is_named_and_never_by_nearness():
    """What is merely like a grade is its family: more would claim what nobody said."""
    kernel = LOOKUP.kernel
    for query in ("rustproof kitchen sink", "knife made of the good steel", "aircraft alloy"):
        assert not kernel.nearest(query).row.grade, query
    for phrase in ("316L", "1.4301", "a 2x4", "7075-T6", "PA6-GF30"):
        assert materials("frame", f"the frame is {phrase}")[0].grade, phrase
    assert materials("frame", "the frame is oak, 2x4 m, 316 mm high")[0] is TABLE.exact("oak")


def test_field_has_the_values_of_the_parts():
    """Every cell of a part gets its row's value and range; cells outside are not occupied."""
    grid = Grid(np.zeros(3), 0.1, (4, 3, 2))
    part = np.full(grid.shape, -1)
    part[:2], part[2] = 0, 1
    voxels = PartVoxels(grid, part, ("frame", "seat"))
    predictor = PREDICTORS["retrieval"]()
    assert isinstance(predictor, Predictor)
    prediction = predictor.predict(voxels, parse(RUBBER_FOAM, TABLE))
    assert prediction.parents == (0, 1)
    field = prediction.field
    np.testing.assert_array_equal(field.occupied, part >= 0)
    for i, word in enumerate(["rubber", "foam"]):
        row, cells = TABLE.exact(word), part == i
        np.testing.assert_allclose(field.E[cells], row.value().E, rtol=1e-6)
        np.testing.assert_allclose(field.rho[cells], row.value().rho, rtol=1e-6)
        assert field.ranges is not None
        np.testing.assert_allclose(field.ranges.E[cells], [row.E] * cells.sum())
        assert field.material is not None
        assert {field.material_names[m] for m in field.material[cells]} == {row.name}
    np.testing.assert_allclose(voxels.volumes, [12e-3, 6e-3])


def test_part_voxels_are_checked():
    grid = Grid(np.zeros(3), 0.1, (2, 2, 2))
    for part, names in [
        (np.zeros((2, 2, 3), int), ("a",)),
        (np.full((2, 2, 2), -1), ("a",)),
        (np.ones((2, 2, 2), int), ("a",)),
    ]:
        with pytest.raises(InputError):
            PartVoxels(grid, part, names)


def settled(parts, text):
    labels = [[name] for name in parts.split()]
    return LOOKUP.settle(labels, read_sentence(text, labels, TABLE))


def test_a_part_is_compared_with_a_part_or_with_a_matter():
    """ "as X as" is once; water is of no part, and what is compared with it is no water."""
    water = 999.0  # kg/m^3, fresh water at room temperature
    (rod, cap), _ = settled("rod cap", "the rod is oak, the cap is as stiff as the rod")
    assert cap.value.E == rod.value.E
    (rod, cap), _ = settled("rod cap", "the rod is oak, the cap is not as stiff as the rod")
    assert cap.value.E < rod.value.E
    for text, factor in (("as dense as water", 1.0), ("half as dense as water", 0.5)):
        (rod, _), told = settled("rod cap", f"the rod is {text}, the cap is steel")
        assert rod.value.rho == pytest.approx(factor * water)
        assert not any("no part is called so" in line for line in told)


def test_two_numbers_for_one_quantity_of_a_part_are_told_and_none_is_used():
    text = "E of the rod is 70 GPa; E of the rod is 200 GPa; the cap is steel"
    (rod, _), told = settled("rod cap", text)
    assert rod.value.E not in (7e10, 2e11)
    assert any("said twice" in line and "'rod'" in line for line in told)
    (rod, cap), _ = settled("rod cap", "E is 5 GPa for everything, the rod has E = 70 GPa")
    assert (rod.value.E, cap.value.E) == (7e10, 5e9)  # the more specific wins


def test_a_mass_that_no_grade_of_a_metal_has_is_used_and_told():
    """A litre of cast iron weighs 7.1 to 7.3 kg: of 4 kg it has holes, or another size."""
    labels = [["case"], ["lid"]]
    for mass, told in ((7.2, False), (4, True)):
        bound = read_sentence(f"case EN-GJL-250, {mass} kg; lid oak", labels, TABLE)
        found = LOOKUP.settle(labels, bound, volumes=[1e-3, 1e-3])
        assert found.choices[0].value.rho == pytest.approx(mass * 1e3)
        assert any("hollow" in line for line in map(str, found.warnings)) == told


def test_a_part_that_is_called_after_what_fills_it_is_that():
    (_, honey), _ = settled("jar honey", "a glass jar of honey")
    assert honey.row.name == "honey (contents)"


def test_what_is_said_of_the_object_needs_no_warning_but_for_parts_that_the_text_speaks_of():
    for text, warned in (("the chair is beech", False), ("a beech chair with a nice seat", True)):
        labels = [["leg"], ["seat"]]
        choices = choose(labels, text)
        assert all(choice.row is TABLE.exact("beech") for choice in choices), text
        assert [choice.elsewhere for choice in choices] == [False, warned], text


def test_a_sentence_wins_over_a_name_of_its_kind_and_another_kind_is_told():
    """ "Beech" is against an ash_leg; a glass_top of an oak table stays glass, told."""
    assert [row.name for row in materials("ash_leg body", "beech wood")] == [
        "beech (along grain)"
    ] * 2
    labels = [["glass_top"], ["frame"]]
    settled = LOOKUP.settle(labels, read_sentence("an oak table", labels, TABLE))
    assert settled.choices[0].row is TABLE.exact("glass")
    assert any("'glass_top': its name" in line for line in settled.choices[0].warnings)


def test_what_is_said_of_everything_wins_over_names_and_what_names_a_part_over_that():
    """ "Everything" leaves no part out, whatever it is called; one that is named has its own."""
    parts = "foam_1 cushion leg"
    steel, foam = TABLE.exact("steel"), TABLE.exact("foam")
    for text in (
        "everything is steel", "all parts are steel", "the whole thing is steel",
        "the whole chair is steel", "all of it is steel", "the entire chair is steel",
    ):  # fmt: skip
        assert materials(parts, text) == [steel] * 3, text
    for text in ("everything is steel, the cushion is foam", "foam cushion, everything is steel"):
        assert materials(parts, text) == [steel, foam, steel], text
    assert materials(parts, "everything is steel except the foam")[0] is foam
    assert materials(parts, "it is steel") == [foam, steel, steel]


def test_a_pot_of_clay_is_fired_and_the_clay_in_it_is_soil():
    for text, row in (("pot: clay", "earthenware"), ("pot: stiff clay", "stiff clay")):
        (choice,) = choose([["pot"]], text)
        assert choice.row is TABLE.exact(row), text
    (choice,) = choose([["soil"]], "the soil is clay")
    assert choice.row.category == "soil"
