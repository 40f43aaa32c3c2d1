"""Outputs are refused before the work: what is not ours is never overwritten."""

import json
from threading import Event

import pytest
import trimesh
from autophyx_tet.converters.files import alone, writing_folder
from autophyx_tet.converters.mesh.meshdata import write_mesh
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.toolkit import pipeline
from autophyx_tet.toolkit.asset.document import Sidecar
from autophyx_tet.toolkit.listing import plan
from autophyx_tet.toolkit.options import ConvertOptions
from autophyx_tet.toolkit.report import pages as folder

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
        ("convert", "chair.msh.json", lambda: pipeline.convert(box, output=mesh)),
        ("assign", "chair.msh.json", lambda: pipeline.assign(box, "oak", output=mesh)),
        ("run", "out/mesh.msh.json", lambda: pipeline.run(box, ["oak"], output=out)),
        ("run", "out/run.json", lambda: pipeline.run(box, ["oak"], output=out)),
        ("convert --dry-run", "chair.msh.json", lambda: plan(box, convert, output=mesh)),
        ("run --dry-run", "out/run.json", lambda: plan(box, convert, output=out, texts=["oak"])),
    )


def test_a_document_that_is_not_ours_is_refused_before_the_work(box, tmp_path, monkeypatch):
    """What, where, what to do, in one line; nothing is read, computed or written."""

    def no_work(*_, **__):
        raise AssertionError("the work has begun")

    monkeypatch.setattr("autophyx_tet.toolkit.meshing.convert.read_data", no_work)
    monkeypatch.setattr("autophyx_tet.converters.mesh.meshdata.read_data", no_work)
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
    for mesh in ("chair.msh", "chair.vtu"):
        (tmp_path / f"{mesh}.json").write_text(FOREIGN)
    with pytest.raises(InputError, match=r"chair\.msh\.json"):
        pipeline.convert(tmp_path / "nowhere.obj", output=tmp_path / "chair.msh")
    trimesh.creation.box().export(tmp_path / "box.obj")
    with pytest.raises(InputError, match=r"chair\.vtu\.json"):
        pipeline.convert(tmp_path / "box.obj", output=tmp_path / "chair.vtu")


def test_meshes_of_one_name_and_a_foreign_document_live_side_by_side(box, tmp_path):
    """Each mesh has its own sidecar, and chair.json is nobody's: it may be anyone's."""
    (tmp_path / "chair.json").write_text(FOREIGN)
    for name in ("chair.msh", "chair.vtu"):
        pipeline.assign(box, "oak", output=tmp_path / name)
        assert json.loads((tmp_path / f"{name}.json").read_text())["record"]["assign"]
    assert (tmp_path / "chair.json").read_text() == FOREIGN


def test_two_runs_do_not_share_a_folder(box, tmp_path):
    """The second one is told so before it works; a run that fails leaves no folder behind."""
    out = tmp_path / "new" / "out"
    with alone(out), pytest.raises(InputError, match=r"another run is at work in .*out: .*-o"):
        pipeline.run(box, ["oak"], output=out)
    assert not out.parent.exists()
    with pytest.raises(InputError, match="nowhere"):
        pipeline.run(tmp_path / "nowhere.obj", ["oak"], output=out)
    assert not out.parent.exists()


def test_a_folder_is_written_whole_or_not_at_all(tmp_path):
    """A failure on the way leaves what was there; success moves all files in, nested ones too."""
    (tmp_path / "a.txt").write_text("old")

    def interrupted():
        with writing_folder(tmp_path) as home:
            (home / "a.txt").write_text("new")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]
    assert (tmp_path / "a.txt").read_text() == "old"
    with writing_folder(tmp_path / "b") as home:
        (home / "c").mkdir()
        (home / "c" / "d.txt").write_text("new")
    assert [path.name for path in (tmp_path / "b").rglob("*")] == ["c", "d.txt"]


@pytest.mark.slow
def test_the_picture_is_drawn_beside_the_report(box, tmp_path, monkeypatch):
    """Each waits for the other to begin; a picture that fails leaves no folder."""
    began, page, draw = (Event(), Event()), folder.run_page, folder.render_png

    def meet(mine, yours):
        mine.set()
        assert yours.wait(30.0), "the other one has not begun"

    def slow_page(*given, **known):
        meet(*began)
        return page(*given, **known)

    def slow_picture(*given, **known):
        meet(*began[::-1])
        return draw(*given, **known)

    monkeypatch.setattr(folder, "run_page", slow_page)
    monkeypatch.setattr(folder, "render_png", slow_picture)
    made = pipeline.run(box, ["oak"], output=tmp_path / "out")
    assert [path.name for path in made.files][-3:] == ["picture.png", "report.html", "run.json"]
    assert all(path.is_file() for path in made.files)
    monkeypatch.setattr(folder, "render_png", lambda *_, **__: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        pipeline.run(box, ["oak"], output=tmp_path / "none")
    assert not (tmp_path / "none").exists()
