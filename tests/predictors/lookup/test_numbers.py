"""Numbers win over the table; what stands in their place follows published relations."""

import pytest
from autophyx_tet.fem.table import load_strengths, load_table, outside_band
from autophyx_tet.predictors.resolve.numbers import (
    FIBRES,
    POWDERS,
    may_have,
    modulus_of_shore_a,
    modulus_of_shore_d,
    of_infill,
    rubber_of,
    with_fibres,
    with_numbers,
    with_powder,
)
from autophyx_tet.predictors.resolve.resolve import lookup_of
from autophyx_tet.predictors.text.clauses import bind
from autophyx_tet.predictors.text.numerals import Blend, Quantity
from autophyx_tet.predictors.text.reader import parse

TABLE = load_table()
OAK, NYLON, RUBBER, STEEL = map(TABLE.exact, ("oak", "nylon", "rubber", "steel"))


def test_hardness_gives_the_modulus_of_its_paper():
    """Gent (1958): 30, 50, 70 Shore A are 1.1, 2.5, 5.5 MPa; Qi (2003): 55 Shore D is 67 MPa."""
    for hardness, megapascal in ((30, 1.14), (50, 2.46), (70, 5.55)):
        assert modulus_of_shore_a(hardness).value / 1e6 == pytest.approx(megapascal, rel=0.01)
    assert modulus_of_shore_d(55).value / 1e6 == pytest.approx(67.2, rel=0.01)
    for relation, outside in ((modulus_of_shore_a, 95), (modulus_of_shore_d, 20)):
        assert "outside" in relation(outside).how
        assert "outside" not in relation(50).how


def test_a_hardness_of_shore_is_not_of_what_has_none():
    """Steel stays steel, beside "60 Shore A" of a buffer, and that is told; rubber follows it."""
    hard = [Quantity("shore_a", 60.0, "60 Shore A")]
    for row in (STEEL, OAK, TABLE.exact("window glass"), TABLE.exact("granite")):
        said = with_numbers("spring", row, row.value(), hard)
        assert said.value == row.value(), row.name
        assert [note.kind for note in said.warnings] == ["numbers.part_hardness"]
    said = with_numbers("buffer", RUBBER, RUBBER.value(), hard)
    assert said.value.E == modulus_of_shore_a(60.0).value
    assert not said.warnings


def test_infill_is_open_cells():
    """Gibson and Ashby: a share s keeps s^2 of E and s of rho; a full print is the solid."""
    solid = NYLON.value()
    value, how = of_infill(solid, 0.2)
    assert value.E == pytest.approx(0.04 * solid.E)
    assert value.rho == pytest.approx(0.2 * solid.rho)
    assert "20%" in how
    assert of_infill(solid, 1.0)[0] == solid


def test_fibres_lie_between_the_bounds_of_mixtures():
    """Reuss <= E <= Voigt for every share, none is the matrix, and densities add by volume."""
    matrix = NYLON.value()
    for name, fibre in FIBRES.items():
        for share in (0.1, 0.3, 0.6):
            value, _ = with_fibres(matrix, name, share)
            volume = share / fibre.rho / (share / fibre.rho + (1 - share) / matrix.rho)
            voigt = volume * fibre.E + (1 - volume) * matrix.E
            reuss = 1 / (volume / fibre.E + (1 - volume) / matrix.E)
            assert reuss < value.E < voigt
            # A mass share s of the fibre: 1 / rho is the mean of 1 / rho by mass.
            assert 1 / value.rho == pytest.approx(share / fibre.rho + (1 - share) / matrix.rho)
        assert with_fibres(matrix, name, 0.0)[0].E == pytest.approx(matrix.E)


def test_stated_numbers_come_out_exactly():
    said = [
        Quantity("E", 2e9, "E = 2 GPa"),
        Quantity("nu", 0.35, "nu = 0.35"),
        Quantity("rho", 1100.0, "1100 kg/m3"),
    ]
    found = with_numbers("bar", OAK, OAK.value(), said)
    assert found.value == (2e9, 0.35, 1100.0)
    assert not found.warnings
    assert found.derivation == ("E = 2 GPa, nu = 0.35, 1100 kg/m3 as said",)


def test_a_mass_is_a_density_where_matter_has_it():
    """1.4 kg over 2 l of oak are 700 kg/m3; 100 kg over the same are no wood: not used, told."""
    light = with_numbers("seat", OAK, OAK.value(), [Quantity("mass", 1.4, "1.4 kg")], volume=2e-3)
    assert light.value.rho == pytest.approx(700)
    for mass, volume in ((100.0, 2e-3), (1.0, 0.0)):
        said = [Quantity("mass", mass, f"{mass} kg")]
        found = with_numbers("seat", OAK, OAK.value(), said, volume=volume)
        assert found.value == OAK.value()
        assert "'seat'" in found.warnings[0]


def test_a_number_that_no_such_matter_has_is_told_and_not_used():
    """355 MPa beside steel is a strength; 2.2 kg in a litre of it is a hollow part."""
    steel = TABLE.exact("steel")
    for said, volume in (
        (Quantity("E", 355e6, "355 MPa", called=False), 0.0),
        (Quantity("mass", 2.2, "2.2 kg"), 1e-3),
    ):
        found = with_numbers("head", steel, steel.value(), [said], volume=volume, named=True)
        assert found.value == steel.value()
        assert repr(said.text) in found.warnings[0]
    called = with_numbers("head", steel, steel.value(), [Quantity("E", 355e6, "E 355 MPa")])
    assert called.value.E == 355e6


def test_what_cannot_be_used_is_told():
    """Thickness, an unknown second matter, a Poisson's ratio of no solid."""
    value = RUBBER.value()
    thick = with_numbers("lid", RUBBER, value, [Quantity("thickness", 2e-3, "2 mm thick")])
    assert thick.value == value
    assert "2 mm thick" in thick.warnings[0]
    dust = with_numbers("lid", RUBBER, value, [], blend=Blend("moon dust", 0.1))
    assert dust.value == value
    assert "moon dust" in dust.warnings[0]
    whole = with_numbers("lid", RUBBER, value, [Quantity("nu", 0.5, "nu 0.5")])
    assert whole.value.nu < 0.5
    assert "nu = 0.5" in whole.warnings[0]


def test_what_only_numbers_speak_of_is_matter_that_can_have_them():
    """Where E alone is said, rho is that of a row with such an E; a hardness is a rubber's."""
    for numbers, fits, does_not in (
        ([Quantity("E", 3.5e9, "3500 N/mm2")], "plastic", "steel"),
        ([Quantity("E", 2.1e11, "210 GPa")], "steel", "concrete"),
        ([Quantity("rho", 30.0, "30 kg/m3")], "soft foam", "oak"),
    ):
        assert may_have(TABLE.exact(fits), numbers), fits
        assert not may_have(TABLE.exact(does_not), numbers), does_not
    assert may_have(OAK, [])
    for hardness in (40, 60, 80):
        found = rubber_of(TABLE.rows, [Quantity("shore_a", hardness, f"{hardness} Shore A")])
        assert found is TABLE.exact(f"rubber Shore A{hardness}")
    assert rubber_of(TABLE.rows, [Quantity("shore_d", 80.0, "80 Shore D")]) is None


@pytest.mark.parametrize(
    ("text", "E", "rho"),
    [("10 million psi", (6.89e10, 6.90e10), (2000, 5000)),
     ("200 thousand MPa", (2e11, 2e11), (7000, 9000)),
     ("hardness 60 Shore A", (3e6, 4.5e6), (1000, 1300)),
     ("E = 69 GPa, poisson's ratio one third, density 2.7 kg/l", (69e9, 69e9), (2700, 2700))],
)  # fmt: skip
def test_numbers_alone_settle_a_plausible_matter(text, E, rho):
    """What is not said is that of matter which can have what is; what is said comes out."""
    lookup = lookup_of(TABLE)
    (choice,) = lookup.settle([["part"]], bind(parse(text, TABLE, ["part"]), [["part"]])).choices
    assert E[0] * (1 - 1e-9) <= choice.value.E <= E[1] * (1 + 1e-9)
    assert rho[0] <= choice.value.rho <= rho[1]
    assert choice.guessed or {"E", "rho"} <= {q.measure for q in choice.clause.numbers}


def _chosen(name, text="", **options):
    bound = bind(parse(text, TABLE, [name]), [[name]])
    return lookup_of(TABLE).settle([[name]], bound, **options).choices[0]


def test_what_is_only_numbers_is_no_row_of_the_table():
    """All three said or set: as stated, known exactly, of no strength; a slip of units is told."""
    said = _chosen("widget", "E = 70 GPa, nu = 0.33, density 2700 kg/m3")
    numbers = {"E": 7e10, "nu": 0.33, "rho": 2700.0}
    given = _chosen("widget", values={"widget": numbers})
    for choice in (said, given):
        assert choice.value == (7e10, 0.33, 2700.0)
        assert choice.material == "as stated"
        assert (choice.row.E, choice.row.rho) == ((7e10, 7e10), (2700, 2700))
        assert choice.settled
        assert not choice.guessed
        assert choice.material not in load_strengths()
        assert not outside_band(choice.row.category, *choice.value)
        assert outside_band(choice.row.category, 7e13, 0.33, 2700)
    assert _chosen("leg", "steel, E = 70 GPa, nu = 0.33, density 2700 kg/m3").row is STEEL
    assert _chosen("widget", values={"widget": {"E": 7e10}}).guessed


def test_what_holds_something_is_not_made_of_it():
    """Of a name's words the last is what a thing is: a can of soup is a can, and soup is soup."""
    for name in ("soup_can", "jam_jar", "water_bottle", "butter_dish", "Sand Bucket", "egg_cup"):
        choice = _chosen(name)
        assert choice.guessed, name
        assert choice.row.category not in ("liquid", "soft food", "soil"), name
    assert _chosen("soup").material == "soup (contents)"
    assert _chosen("butter").material == "butter"
    assert _chosen("oak_barrel").row.category == "wood"


def test_powder_is_between_the_bounds_of_mixtures():
    """Above Reuss's and below Voigt's, as any law of two phases; the density is that of volumes."""
    epoxy = TABLE.exact("epoxy").value()
    for powder, grain in POWDERS.items():
        share = 0.4
        value, _ = with_powder(epoxy, powder, share)
        volume = share / grain["rho"] / (share / grain["rho"] + (1 - share) / epoxy.rho)
        reuss = 1 / (volume / grain["E"] + (1 - volume) / epoxy.E)
        voigt = volume * grain["E"] + (1 - volume) * epoxy.E
        assert reuss <= value.E <= voigt, powder
        assert value.rho == pytest.approx(volume * grain["rho"] + (1 - volume) * epoxy.rho)


def test_powder_of_a_data_sheet():
    """Glass beads in nylon 12: EOS PA 3200 GF has 3.2 GPa, HP's PA 12 GB of 40 % 2.8 GPa."""
    sintered = TABLE.exact("sintered nylon 12").value()
    value, _ = with_powder(sintered, "glass beads", 0.4)
    assert 2.2e9 < value.E < 3.3e9  # of a row whose middle is 1.6 GPa


def test_numbers_of_another_state_are_taken():
    """A modulus and a density that are both far from the row's: cells, a compound."""
    titanium, foam = TABLE.exact("titanium"), TABLE.exact("PU foam")
    said = [Quantity("E", 3e9, "3 GPa", called=False), Quantity("rho", 1800.0, "1.8 g/cm3")]
    found = with_numbers("cup", titanium, titanium.value(), said, named=True)
    assert (found.value.E, found.value.rho) == (3e9, 1800.0)
    mass = with_numbers(
        "seat", foam, foam.value(), [Quantity("mass", 35.0, "35 kg")], volume=1e-3, named=True
    )
    assert mass.value.rho == 35.0
