"""Numbers win over the table; what stands in their place follows published relations."""

import pytest
from autophyx_tet.fem.scene.materials import load_table
from autophyx_tet.predictors.language.clauses import Blend, Quantity
from autophyx_tet.predictors.lookup.derivation import (
    FIBRES,
    modulus_of_shore_a,
    modulus_of_shore_d,
    of_infill,
    with_fibres,
)
from autophyx_tet.predictors.lookup.numbers import with_numbers

TABLE = load_table()
OAK, NYLON, RUBBER = (TABLE.exact(name) for name in ("oak", "nylon", "rubber"))


def test_hardness_gives_the_modulus_of_its_paper():
    """Gent (1958): 30, 50, 70 Shore A are 1.1, 2.5, 5.5 MPa; Qi (2003): 55 Shore D is 67 MPa."""
    for hardness, megapascal in ((30, 1.14), (50, 2.46), (70, 5.55)):
        assert modulus_of_shore_a(hardness).value / 1e6 == pytest.approx(megapascal, rel=0.01)
    assert modulus_of_shore_d(55).value / 1e6 == pytest.approx(67.2, rel=0.01)
    for relation, outside in ((modulus_of_shore_a, 95), (modulus_of_shore_d, 20)):
        assert "outside" in relation(outside).how
        assert "outside" not in relation(50).how


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
