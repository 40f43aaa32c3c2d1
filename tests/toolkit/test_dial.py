"""`run --dial`: every sentence soft, in the middle and stiff."""

import json

import numpy as np
import pytest
import trimesh
from autophyx_tet.toolkit.asset.bonsai import write_bonsai
from autophyx_tet.toolkit.cli.main import main


def dialled(tmp_path, capsys, asset, *options):
    """The document of a run under the dial."""
    out = tmp_path / asset.stem
    given = ["--predictor", "unipixie", "--dial", *options, "--json", "-q"]
    assert main(["run", str(asset), "-o", str(out), *given]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.long
def test_a_stool_that_nothing_names_goes_from_soft_to_stiff(tmp_path, capsys):
    """A block of one part: E rises in every case, and with it falls what the weight strains.

    A uniform body under its weight moves by u ~ rho / E.
    """
    trimesh.creation.box((0.3, 0.3, 0.4)).export(tmp_path / "thing.obj")
    sized = ["--size", "0.4", "--up", "z", "--edge-length-rel", "0.4", "--cells", "12"]
    found = dialled(tmp_path, capsys, tmp_path / "thing.obj", *sized, "--samples", "4")
    assert [case["alpha"] for case in found["cases"]] == [0.0, 0.5, 1.0]
    (parts,) = zip(*(case["parts"] for case in found["cases"]), strict=True)
    E, rho = ([part[name] for part in parts] for name in ("E", "rho"))
    assert E[0] < E[1] < E[2]
    u = np.array([case["sag"]["max_displacement"] for case in found["cases"]])
    # nu moves with alpha too, and with it what the held base keeps from spreading: a tenth.
    np.testing.assert_allclose(u / u[0], np.divide(rho, rho[0]) / np.divide(E, E[0]), rtol=0.1)
    assert any("less and less" in verdict["sentence"] for verdict in found["verdicts"])
    page = (tmp_path / "thing" / "report.html").read_text()
    assert page.count('"dial": {"alpha"') == 3
    assert found["sag"]["intervals"]["likely"]["drawn"] == 4


@pytest.mark.long  # three conversions and nine solves
def test_the_demo_gives_way_less_and_less(tmp_path, capsys):
    """Its rows have one density and a range of E: the energy of the load can only fall."""
    asset = write_bonsai(tmp_path / "bonsai.glb")
    found = dialled(tmp_path, capsys, asset, "--edge-length-rel", "0.1")
    said = [v["sentence"] for v in found["verdicts"] if v["detail"] == "dial"]
    assert len(said) == 1
    assert said[0].endswith(": less and less.")
