"""A mesh format of somebody else's: one object, registered, and every door opens to it."""

import importlib.util
import json
import logging

import numpy as np
import pytest
from autophyx_tet.converters.files import reading, writing
from autophyx_tet.converters.mesh.meshdata import MeshData, read_mesh, write_mesh
from autophyx_tet.converters.registry import MESH_FORMATS, Format, Keeps
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.toolkit.asset.document import check_file, mesh_suffixes
from autophyx_tet.toolkit.cli.main import main


def read_toy(path):
    with reading(path, "a toy") as source:
        held = json.loads(source.read_text())
        arrays = (np.array(held[name]) for name in ("points", "tets", "region"))
        return MeshData(TetMesh(*arrays, tuple(held["names"])))


def write_toy(path, mesh, *, point_data=None, cell_data=None):
    arrays = {name: getattr(mesh, name).tolist() for name in ("points", "tets", "region")}
    with writing(path) as target:
        target.write_text(json.dumps(arrays | {"names": mesh.region_names}))


@pytest.fixture
def toy():
    """The format for one test: what is registered can be taken out again."""
    MESH_FORMATS.register(".toy", Format("toy", (".toy",), read_toy, write_toy, {Keeps.REGIONS}))
    yield
    MESH_FORMATS.unregister(".toy")


def body():
    """Two named halves of oak."""
    box = box_mesh((1, 1, 1), (2, 1, 1))
    oak = ElementMaterial.uniform(len(box.tets), E=1e10, nu=0.3, rho=700)
    return TetMesh(box.points, box.tets, (box.centroids[:, 0] > 0.5).astype(int), ("a", "b"), oak)


@pytest.mark.usefixtures("toy")
def test_it_is_read_and_written_and_says_what_it_loses(tmp_path, caplog):
    """Regions come back; E, nu, rho have no place in it, which the log names."""
    path, mesh = tmp_path / "m.toy", body()
    with caplog.at_level(logging.WARNING):
        lost = write_mesh(path, mesh, cell_data={"s": mesh.volumes})
    assert lost == (Keeps.E, Keeps.NU, Keeps.RHO, Keeps.CELL_DATA)
    assert "toy does not keep E of every tet, nu of every tet" in caplog.text
    back = read_mesh(path)
    np.testing.assert_array_equal(back.points, mesh.points)
    assert back.region_names == ("a", "b")
    assert back.material is None


@pytest.mark.usefixtures("toy")
def test_the_command_line_takes_it(tmp_path, capfd):
    """As an output, and as the mesh of a command."""
    check_file(tmp_path / "out.toy", mesh_suffixes())
    write_mesh(tmp_path / "m.toy", body())
    assert main(["info", str(tmp_path / "m.toy"), "--json"]) == 0
    names = [row["name"] for row in json.loads(capfd.readouterr().out)["regions"]]
    assert names == ["a", "b"]


def tables(root):
    """What the pages take from the program."""
    home = importlib.util.spec_from_file_location("hooks", root / "docs" / "hooks.py")
    assert home is not None
    assert home.loader is not None
    module = importlib.util.module_from_spec(home)
    home.loader.exec_module(module)
    return module.FILLERS["formats"]


@pytest.mark.usefixtures("toy")
def test_the_page_of_formats_lists_it(root):
    (row,) = [line for line in tables(root)("meshes").splitlines() if "toy" in line]
    assert row == "| `.toy` | toy | yes | yes | regions and their names |"


def test_the_page_of_formats_is_the_registries(root):
    """Every suffix and program stands in a table, with every item that it keeps."""
    from autophyx_tet.converters.registry import GRID_FORMATS, POINT_FORMATS, PROGRAMS
    from autophyx_tet.toolkit.asset.formats import ASSET_FORMATS

    page, make = (root / "docs" / "formats.md").read_text(), tables(root)
    families = {
        "surfaces": ASSET_FORMATS, "meshes": MESH_FORMATS, "points": POINT_FORMATS,
        "grids": GRID_FORMATS, "exports": PROGRAMS,
    }  # fmt: skip
    for kind, family in families.items():
        assert f"{{{{ formats {kind} }}}}" in page
        rows = make(kind).splitlines()
        for name in family:
            forms = family[name].formats if family is PROGRAMS else (family[name],)
            for form in forms:
                (row,) = [r for r in rows if f"`{name}`" in r and form.title in r]
                assert all(item in row for item in form.keeps | form.binned), row


def test_without_it_the_suffix_is_unknown(tmp_path):
    with pytest.raises(InputError, match=r"unknown mesh suffix '.toy'"):
        write_mesh(tmp_path / "m.toy", body())
    with pytest.raises(InputError, match="unknown suffix"):
        check_file(tmp_path / "out.toy", mesh_suffixes())
