"""Laminates by fibre, lay-up and resin, in any order of these."""

import pytest
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.text.materials import laminates

TABLE = load_table()


@pytest.mark.parametrize(
    ("said", "row"),
    [
        ("UD carbon/epoxy", "carbon ud"),
        ("carbon fibre, unidirectional", "carbon ud"),
        ("pultruded carbon tube", "carbon ud"),
        ("carbon/epoxy wound, hoop", "carbon ud"),
        ("2x2 twill carbon prepreg", "woven carbon fibre"),
        ("carbon 0/90 200 g cloth in epoxy", "woven carbon fibre"),
        ("CFRP, quasi-isotropic", "quasi-isotropic cfrp"),
        ("carbon [0/45/90/-45]s", "quasi-isotropic cfrp"),
        ("carbon UD/±45 mix", "quasi-isotropic cfrp"),
        ("±45 carbon", "carbon biax"),
        ("IM7/8552 PW +/-45", "carbon biax"),
        ("IM7/8552 UD [0]24", "im7/8552"),
        ("CF/BMI", "carbon/bmi"),
        ("e-glass UD", "ud glass"),
        ("E-glass 800 biax/vinylester", "biax glass"),
        ("tri-ax glass", "triax glass"),
        ("glass/phenolic prepreg", "glass phenolic prepreg"),
        ("GRP, hand lay-up", "hand layup grp"),
        ("pultruded GRP profile", "grp"),
        ("flax/epoxy twill", "flax composite"),
        ("carbon/aramid hybrid weave", "carbon-aramid hybrid fabric laminate"),
        ("fibra de vidrio poliéster", "hand layup grp"),
    ],
)
def test_a_laminate_has_the_row_of_its_fibre_and_lay_up(said, row):
    (found,) = laminates(said)
    wanted = TABLE.phrases.get(row) or TABLE.exact(row)
    own = TABLE.exact(found.row)
    assert own.E.min <= wanted.E.max, said
    assert own.E.max >= wanted.E.min, said
    assert own.category == "composite", said


@pytest.mark.parametrize(
    "said",
    [
        "carbon steel",
        "innegra/epoxy",
        "glass",
        "plain glass",
        "fabric",
        "a carbon seal, glass lid",
        "epoxy",
        "M40 bolt",
    ],
)
def test_what_is_no_laminate(said):
    assert not laminates(said)


def test_every_row_of_the_list_is_in_the_table():
    from autophyx_tet.predictors.text.materials import _of_laminates

    rows = [
        name
        for by_lay in _of_laminates()[1].values()
        for one in by_lay.values()
        for name in ([one] if isinstance(one, str) else one.values())
    ]
    assert {TABLE.exact(name).name for name in rows} == {*rows}


@pytest.mark.parametrize(
    "said",
    [
        "lid glass, fabric seat",
        "lid: glass\nmat: rubber",
        "window glass, polyester curtain",
        "top is glass 4x4 m",
        "lid: 12 mm glass, braided hose rubber",
    ],
)
def test_a_comma_or_a_line_ends_a_laminate(said):
    assert not laminates(said)
