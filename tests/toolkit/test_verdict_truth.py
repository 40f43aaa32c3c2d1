"""A check that was not made, or that rests on what is doubted, is no pass: by the verb itself."""

import autophyx_tet as apx
import numpy as np
import pytest
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.toolkit.cli.terminal import show, simulation
from autophyx_tet.toolkit.verdict.check import RESTS_ON

BAR = {"fix": ["plane:x<0"], "gravity": 0}


def bar(E=1e8, nu=0.3, rho=500.0, size=(0.3, 0.1, 0.1), cells=(6, 2, 2)):
    mesh = box_mesh(size, cells)
    material = ElementMaterial.uniform(len(mesh.tets), E=E, nu=nu, rho=rho)
    return mesh.with_material(material)


def found(result):
    return {check.name: check for check in result.verdicts()}


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        {},
        {"order": 1},
        {"move": {"plane:x>0.3": (-1e-4, 0, 0)}, **BAR},
        {"load": {"plane:x>0.3": (-1, 0, 0)}, **BAR},
        {"law": "neohookean"},
    ],
)
@pytest.mark.truth("a check that was not made")
def test_every_rest_has_a_line_on_buckling(options):
    """Passed, failed, doubtful or not made, and then why."""
    check = found(apx.simulate(bar(), **options))["buckling"]
    assert check.outcome in ("passed", "failed", "doubtful", "not made")
    assert check.outcome != "not made" or check.why
    assert check.value >= 1 or check.outcome != "passed"


@pytest.mark.truth("no green beside a doubted number")
def test_nothing_is_green_beside_a_coarse_mesh_and_one_line_says_so():
    """Linear elements of a cell across are off by much: what rests on them is in doubt."""
    checks = apx.simulate(bar(), order=1).verdicts()
    named = {check.name: check for check in checks}
    assert named["discretisation"].outcome == "failed"
    for check in checks:
        rests = {"discretisation", "buckling"} & {*RESTS_ON.get(check.name, ())}
        assert not (check.mark == "good" and rests), check
    (line,) = [check for check in checks if check.name == "doubts"]
    assert "its mesh" in line.sentence
    assert "its shape" in line.sentence


@pytest.mark.slow
@pytest.mark.truth("no green beside a guess")
def test_nothing_is_green_beside_a_guess():
    """Nobody says what it is of: neither usual values nor what follows from them are a pass."""
    mesh = box_mesh((0.3, 0.1, 0.1), (6, 2, 2))
    body = apx.assign(TetMesh(mesh.points, mesh.tets, mesh.region, ("thing",)), "")
    assert [v.outcome for v in body.verdicts() if v.name == "inside band"] == ["doubtful"]
    checks = apx.simulate(body.mesh, record=body.record).verdicts()
    assert {"materials", "doubts"} <= {check.name for check in checks}
    for check in checks:
        assert not (check.mark == "good" and "materials" in RESTS_ON.get(check.name, ())), check
    sure = apx.assign(body.mesh, "the thing is oak")
    assert sure.record.guesses == ()
    assert [v.outcome for v in sure.verdicts() if v.name == "inside band"] == ["passed"]


@pytest.mark.truth("a load on what is fixed")
def test_a_load_that_reaches_only_fixed_points_is_told():
    """All of it, most of it, or none lands where the body is fixed."""
    for places, outcome in (("plane:x<0", "failed"), ("plane:x<0.2", "passed")):
        load = {"plane:x<0" if outcome == "failed" else "plane:x>0.3": (0, 0, -100)}
        checks = found(apx.simulate(bar(), fix=[places], load=load))
        assert checks["loads"].outcome == outcome
        assert outcome == "passed" or checks["holds shape"].outcome == "doubtful"


def test_a_strength_that_nobody_knows_is_told():
    check = found(apx.simulate(bar()))["strength"]
    assert check.outcome == "not made"
    assert "came without their names" in check.why


def test_forces_stand_by_place(capsys):
    """A guided bar: 100 N on all of it and its weight are carried by two places, exactly."""
    mesh = bar()
    load = {"plane:x>0.3": (0, 0, -100)}
    result = apx.simulate(mesh, fix=["plane:x<0", "plane:z>0.1:y"], load=load)
    document = result.document()
    carried = np.sum([one["force"] for one in document["sag"]["reactions"]], axis=0)
    assert carried == pytest.approx([0, 0, 100 + mesh.mass * 9.81], abs=1e-6)
    (one,) = document["sag"]["loads"]
    assert one["force"] == pytest.approx([0, 0, -100], abs=1e-9)
    assert one["area"] == pytest.approx(0.01, rel=1e-12)
    show(document, simulation)
    out = capsys.readouterr().out
    assert "plane:x>0.3" in out
    assert "100 N along -z" in out.replace("\u00a0", " ")


@pytest.mark.slow
@pytest.mark.parametrize("law", ["linear", "neohookean", "corotated"])
def test_the_law_that_was_taken_is_told(law):
    """At rest a law that is asked for is followed, and stands in the document."""
    rest = apx.simulate(bar(), law=law).document()["sag"]
    assert rest["law"] == law
    assert "Law and elements" in rest["solution"]


def test_a_check_has_its_numbers_in_json():
    """Outcome, value beside its limit with a unit, place and option."""
    row = next(
        v for v in apx.simulate(bar()).document()["sag"]["verdicts"] if v["detail"] == "size"
    )
    assert row["outcome"] == "passed"
    assert (row["value"], row["unit"], row["parameter"]) == (pytest.approx(0.3), "m", "size")


@pytest.mark.slow
@pytest.mark.parametrize("cells", [10, 20])
@pytest.mark.truth("stress at an inner corner")
def test_a_strength_beside_an_inner_corner_is_in_doubt(cells):
    """An L of steel passes by 1.17 and 1.02, and yields as its mesh is refined: it never passes."""
    box = box_mesh((1.0, 0.1, 1.0), (cells, 1, cells))
    kept = ~((box.centroids[:, 0] > 0.2) & (box.centroids[:, 2] > 0.2))
    ids, tets = np.unique(box.tets[kept], return_inverse=True)
    mesh = TetMesh.oriented(box.points[ids], tets.reshape(-1, 4))
    mesh = mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=2.1e11, nu=0.3, rho=7850.0))
    known = {"gravity": 0, "materials": {"body": "S235 structural steel"}}
    pulled = apx.simulate(mesh, fix=("plane:z>1",), load={"plane:x>1": (0, 0, -1.2e5)}, **known)
    (strong,) = (check for check in pulled.checks() if check.name == "strength")
    assert strong.value > 1
    assert strong.outcome == "doubtful"
    assert "inner corner" in strong.why


def test_what_holds_nothing_is_one_check_and_leaves_the_rest_in_doubt():
    """A cube that floats above another was held where it is: no answer of both is good."""
    one = box_mesh((0.1, 0.1, 0.1), (1, 1, 1))
    points = np.vstack([one.points, one.points + np.array([0, 0, 0.15])])
    mesh = TetMesh.oriented(points, np.vstack([one.tets, one.tets + 8]))
    mesh = mesh.with_material(ElementMaterial.uniform(12, E=1e7, nu=0.3, rho=1000.0))
    told = found(apx.simulate(mesh))
    assert (told["attached"].outcome, told["attached"].value) == ("failed", pytest.approx(0.5))
    for name in ("holds shape", "buckling", "first frequency"):
        assert told[name].outcome == "doubtful"
