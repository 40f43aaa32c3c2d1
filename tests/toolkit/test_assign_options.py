"""Numbers, own materials and strictness, as options of ``assign``."""

import json
from dataclasses import replace

import autophyx_tet as apx
import pytest
from autophyx_tet.converters.mesh.meshdata import write_mesh
from autophyx_tet.fem.errors import InputError, UsageError
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.resolve.numbers import numbers_of_parts
from autophyx_tet.toolkit.cli.main import main
from autophyx_tet.toolkit.options import AssignOptions
from autophyx_tet.toolkit.pipeline import with_own_rows

OWN = """
[[material]]
name = "house blend"
category = "plastic"
source = "measured by us"
E = [2.0e9, 2.4e9]
nu = 0.38
rho = 1070
aliases = ["oak"]
"""


def bar(name: str = "bar") -> TetMesh:
    box = box_mesh((1, 0.2, 0.2), (2, 1, 1))
    return TetMesh(box.points, box.tets, box.region, (name,))


def assigned(text="", **options):
    return apx.assign(bar(), text, options=AssignOptions(predictor="retrieval", cells=8, **options))


def test_set_gives_exact_numbers_and_leaves_the_others():
    found = assigned("oak", set=("bar:E=2e9,rho=1100",))
    oak = load_table().exact("oak").value()
    assert found.choices[0].value == (2e9, oak.nu, 1100.0)
    assert "as set" in found.choices[0].derivation[0]


def test_values_of_a_network_far_from_what_they_are_like_are_no_good_verdict():
    """E eight times that of the nearest row: told, and not called usual for its kind."""
    found = assigned("silver")
    (choice,) = found.choices
    assert [v.mark for v in found.verdicts() if v.name == "inside band"] == ["good"]
    value = choice.value._replace(E=8 * choice.row.E.max)
    guess = replace(found, choices=(replace(choice, network="some", value=value),))
    (verdict,) = (v for v in guess.verdicts() if v.name == "inside band")
    assert verdict.mark == "note"
    assert "is not that of silver" in verdict.sentence


def test_what_is_only_numbers_gets_no_strength_and_no_tick():
    found = assigned(set=("bar:E=7e10,nu=.33,rho=2700",))
    (verdict,) = (v for v in found.verdicts() if v.name in ("inside band", "as stated"))
    assert verdict.outcome == "not made"
    assert "no strength is known" in verdict.sentence


def test_wrong_numbers_are_one_line():
    for wrong in ("bar", "bar:", "bar:E", "bar:E=stiff", "bar:G=2e9", "bar:nu=.5", "bar:E=-1"):
        with pytest.raises(UsageError, match=r"PART:E=|numbers in SI|must lie"):
            numbers_of_parts([wrong])
    with pytest.raises(UsageError, match="no part 'bra': its parts are bar; did you mean 'bar'"):
        assigned("oak", set=("bra:E=2e9",))


@pytest.mark.slow
def test_own_rows_win(tmp_path):
    """The same in TOML and CSV: own names and aliases come first, the table's others stay."""
    toml, table = tmp_path / "own.toml", tmp_path / "own.csv"
    toml.write_text(OWN)
    table.write_text(
        "name,category,E_min_Pa,E_max_Pa,nu_min,nu_max,rho_min,rho_max,source,aliases\n"
        "house blend,plastic,2.0e9,2.4e9,.38,.38,1070,1070,measured by us,oak\n"
    )
    for path in (toml, table):
        row = with_own_rows(path).exact("oak")
        assert (row.name, row.E.max, row.nu.min) == ("house blend", 2.4e9, 0.38)
        assert with_own_rows(path).exact("steel").E == load_table().exact("steel").E
        for text in ("the bar is house blend", "oak"):
            assert assigned(text, table=path).choices[0].material == "house blend"


def test_own_rows_are_checked(tmp_path):
    path = tmp_path / "own.toml"
    for wrong, why in (
        (OWN.replace("2.0e9", "2.0e15"), "min"),
        (OWN.replace("1070", '"heavy"'), "wanted a number"),
        (OWN.replace("plastic", "plastik"), "plastik"),
        (OWN.replace('source = "measured by us"', ""), "no source"),
        ("[[material]", "no TOML"),
        ("material = 3", "wanted tables"),
        ("", "no material"),
    ):
        path.write_text(wrong)
        with pytest.raises((InputError, UsageError), match=why):
            with_own_rows(path)
    with pytest.raises(InputError, match="cannot read"):
        with_own_rows(tmp_path / "nowhere.csv")


def test_what_is_not_understood_is_told_everywhere(tmp_path, capsys):
    """On stderr, in the JSON, and as an error of exit code 2 under --strict."""
    write_mesh(tmp_path / "pot.msh", bar("pot"))
    command = ["assign", str(tmp_path / "pot.msh"), "-o", str(tmp_path / "out.msh")]
    command += ["--text", "the pot is blarg", "--predictor", "retrieval", "--cells", "8"]
    assert main(command) == 0
    assert "'blarg'" in capsys.readouterr().err
    assert main([*command, "--json"]) == 0
    printed = capsys.readouterr()
    document = json.loads(printed.out)
    assert any("'blarg'" in warning for warning in document["warnings"])
    assert document["parts"][0]["understood"] is False
    assert "'blarg'" in printed.err
    (tmp_path / "out.msh").unlink()
    assert main([*command, "--strict"]) == 2
    assert "'blarg'" in capsys.readouterr().err
    assert not (tmp_path / "out.msh").exists()
    command[command.index("the pot is blarg")] = "the pot is oak"
    assert main([*command, "--strict"]) == 0


def test_a_text_and_a_material_of_one_part_are_refused():
    with pytest.raises(UsageError, match="'bar' has both a text and a material"):
        assigned(part=("bar=steel",), material=("Bar=oak",))
