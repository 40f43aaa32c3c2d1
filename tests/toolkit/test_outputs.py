"""Outputs are refused before the work: what is not ours is never overwritten."""

import json

import pytest
import trimesh
from autophyx_tet.converters.mesh.mesh_file import write_mesh
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.scene.box import box_mesh
from autophyx_tet.toolkit import pipeline
from autophyx_tet.toolkit.estimate import plan
from autophyx_tet.toolkit.io.sidecar import Sidecar
from autophyx_tet.toolkit.options import ConvertOptions

FOREIGN = '{"schema": 7, "name": "a chair of someone else"}'


@pytest.fixture
def box(tmp_path):
    """A mesh file with its sidecar, which needs no meshing."""
    path = tmp_path / "box.msh"
    write_mesh(path, box_mesh((0.1, 0.1, 0.1), (1, 1, 1)))
    return path


def calls(box, folder):
    """Every verb that writes a document beside a mesh: its name, the document, the call."""
    mesh, out = folder / "chair.msh", folder / "out"
    convert = ConvertOptions()
    return (
        ("convert", "chair.json", lambda: pipeline.convert(box, output=mesh)),
        ("assign", "chair.json", lambda: pipeline.assign(box, "oak", output=mesh)),
        ("run", "out/mesh.json", lambda: pipeline.run(box, ["oak"], output=out)),
        ("run", "out/run.json", lambda: pipeline.run(box, ["oak"], output=out)),
        ("convert --dry-run", "chair.json", lambda: plan(box, convert, output=mesh)),
        ("run --dry-run", "out/run.json", lambda: plan(box, convert, output=out, texts=["oak"])),
    )


def test_a_document_that_is_not_ours_is_refused_before_the_work(box, tmp_path, monkeypatch):
    """What, where, what to do, in one line; nothing is read, computed or written."""

    def no_work(*_, **__):
        raise AssertionError("the work has begun")

    monkeypatch.setattr("autophyx_tet.toolkit.meshing.import_tets.read_mesh", no_work)
    monkeypatch.setattr("autophyx_tet.converters.mesh.mesh_file.read_mesh", no_work)
    for verb, name, call in calls(box, tmp_path):
        for words in (FOREIGN, "not even JSON", "[1, 2]", ""):
            document = tmp_path / name
            document.parent.mkdir(exist_ok=True)
            document.write_text(words)
            before = sorted(tmp_path.rglob("*"))
            with pytest.raises(InputError, match="-o") as refused:
                call()
            assert str(document) in str(refused.value), verb
            assert "\n" not in str(refused.value), verb
            assert document.read_text() == words, verb
            assert sorted(tmp_path.rglob("*")) == before, verb
            document.unlink()


def test_a_sidecar_of_ours_is_written_anew(box, tmp_path):
    """The same output again, and the input itself as output, are what a user means."""
    mesh = tmp_path / "chair.msh"
    for _ in range(2):
        pipeline.convert(box, output=mesh)
    made = pipeline.assign(mesh, "oak", output=mesh)
    assert Sidecar.path(mesh) in made.files
    record = json.loads(Sidecar.path(mesh).read_text())["record"]
    assert record["assign"]["text"] == "oak"


def test_a_surface_is_refused_as_early(tmp_path):
    """The check comes before the asset is loaded: one that is missing is not even looked for."""
    (tmp_path / "chair.json").write_text(FOREIGN)
    with pytest.raises(InputError, match=r"chair\.json"):
        pipeline.convert(tmp_path / "nowhere.obj", output=tmp_path / "chair.msh")
    trimesh.creation.box().export(tmp_path / "box.obj")
    with pytest.raises(InputError, match=r"chair\.json"):
        pipeline.convert(tmp_path / "box.obj", output=tmp_path / "chair.vtu")
