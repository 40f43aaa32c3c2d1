"""What a reader of a report asks first is answered in words, on its first screen."""

import html

import autophyx_tet as apx
import numpy as np
import pytest
import trimesh
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.predictors.prediction import Binding
from autophyx_tet.toolkit.asset.document import Sidecar
from autophyx_tet.toolkit.report.html import report_page
from autophyx_tet.toolkit.report.pages import found, loaded_mesh, run_page, simulation_page, unheard

SIDE, HEIGHT = 0.1, 0.4


def post(text):
    """A post that stands on its lower half and carries its upper one, of a sentence."""
    mesh = box_mesh((SIDE, SIDE, HEIGHT), (1, 1, 4))
    region = (mesh.centroids[:, 2] < HEIGHT / 2).astype(np.int32)
    return apx.assign(TetMesh(mesh.points, mesh.tets, region, ("head", "foot")), text)


def answers(body, **options):
    parts = body.part_rows()
    materials = {part["name"]: part["material"] for part in parts}
    return dict(found(apx.simulate(body.mesh, materials=materials, **options), parts))


@pytest.mark.slow
def test_what_moves_most_is_told_with_its_part_and_place():
    """A post under a load on its head moves most at the head's top."""
    said = answers(post("oak"), load=("part:head=0,0,-1000",))
    assert said["Moves most"].startswith("head by ")
    assert said["Moves most"].endswith(f"{HEIGHT:g}) m")


@pytest.mark.slow
def test_whether_it_gives_way_is_told():
    """Its own weight is nothing to oak; 1e6 N on 0.01 m^2 are 100 MPa, which no oak bears."""
    body = post("oak")
    held, crushed = answers(body), answers(body, load=("part:head=0,0,-1e6",))
    assert held["Gives way"].startswith("no: the least safety factor is more than 1000")
    assert crushed["Gives way"].startswith("yes: the least safety factor is 0.")
    assert "against its compressive strength" in crushed["Gives way"]
    assert "came without their names" in dict(found(apx.simulate(body.mesh), []))["Gives way"]


def test_a_material_without_a_strength_is_named():
    assert (
        "not known of 'head'" in answers(post("the head is leaves, the foot is oak"))["Gives way"]
    )


@pytest.mark.slow
def test_what_is_guessed_or_not_understood_is_told():
    said = post("the head is oak, the foot is blarg")
    assert "1 of 2 from words or names, a guess for 'foot'" in answers(said)["Materials"]
    assert "blarg" in unheard(said.doubts)[1]
    assert unheard(())[1] == "nothing of the words: each was used"
    assert answers(post("oak"))["Materials"].startswith("2 of 2 from words or names; E is known")


def test_a_part_that_no_clause_speaks_of_is_a_guess():
    """Whether its binding comes from this process or from a file."""
    row = {"name": "seat", "guessed": False, "understood": True, "weight": 1.0}
    row |= {"ranges": {"E": {"min": 1e9, "max": 2e9}}}
    simulated = apx.simulate(post("oak").mesh)
    for clause, count in ((None, 0), ("the seat is oak", 1)):
        binding = Binding(clause, 0.9, 100, 0.1)
        for told in (binding, binding._asdict()):
            said = dict(found(simulated, [{**row, "binding": told}]))["Materials"]
            assert said.startswith(f"{count} of 1 from words or names")
            assert "factor of 2 or" in said


@pytest.mark.slow
def test_the_report_of_a_simulation_repeats_what_was_warned_of_before():
    """`simulate` reads what `assign` did not understand from the mesh's sidecar."""
    body = post("the head is oak, the foot is blarg")
    page = simulation_page("post", apx.simulate(body.mesh), body.described())
    assert set(body.warnings) <= set(page.warnings)
    assert "blarg" in dict(page.cases[0].answers)["Not understood, or guessed"]


def test_the_mesh_of_a_simulation_is_told_with_what_it_was_made_of():
    mesh = post("oak").mesh
    sidecar = Sidecar(up="z", source={"path": "things/post.glb"})
    said = dict(loaded_mesh("post", mesh, sidecar))["Loaded"].replace("\u00a0", " ")
    size = "100 mm × 100 mm × 400 mm"
    assert said == f"post: a mesh of {len(mesh.tets)} tets, 2 parts, {size}, z up, of post.glb"


@pytest.mark.slow
def test_what_was_loaded_and_meshed_is_told(tmp_path):
    """A file of 12 triangles, 100 units of a millimetre a side."""
    trimesh.creation.box((100, 100, 100)).export(tmp_path / "cube.obj")
    options = apx.ConvertOptions(units="mm", mesher="stuffing", edge_length_rel=0.2)
    result = apx.run(
        tmp_path / "cube.obj", ["oak"], output=tmp_path / "out", convert_options=options
    )
    said = dict(run_page(result).loaded)
    assert said["Loaded"].startswith("cube.obj: a surface, 1 part, 12 triangles, 100\u00a0mm × 100")
    assert "1 unit taken as 1.00\u00a0mm" in said["Loaded"]
    assert said["Mesh"].startswith(f"{len(result.cases[0].simulation.mesh.tets):,} tets of about")
    assert result.cpu_seconds.keys() == result.seconds.keys() >= {"convert", "simulate", "write"}
    page = html.unescape(report_page(run_page(result)))
    assert all(words in page for words in said.values())
