"""Laws of the material table as users see it."""

import json

from autophyx_tet.toolkit.cli.main import main


def test_a_misspelt_material_is_refused_with_the_nearest_names(capsys):
    assert main(["materials", "plywod"]) == 2
    assert "did you mean 'plywood'" in capsys.readouterr().err


def test_json_has_all_that_is_known_of_a_material(capsys):
    """Strength, grain, colour and source; what is not known is null; contents when asked."""
    assert main(["materials", "red oak", "--json"]) == 0
    oak, across = json.loads(capsys.readouterr().out)["materials"][:2]
    assert oak["strength"]["kind"] == "ultimate"
    assert oak["strength"]["tension"]["min"] == 99e6
    assert 0.05 < oak["grain"]["ET"] < 0.2
    assert "judgement" in oak["colour"]["source"]
    assert across["grain"] is None
    assert not oak["grade"]
    assert main(["materials", "coffee", "--contents", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["materials"]
    assert rows[0]["name"] == "ground coffee (contents)"
    assert rows[0]["strength"] is None
