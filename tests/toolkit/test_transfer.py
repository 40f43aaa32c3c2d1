"""Transfer and export as a user meets them: what is written and said, one line for an error."""

import json
import re
from pathlib import Path
from typing import get_args

import autophyx_tet as apx
import numpy as np
import pytest
from autophyx_tet.converters.grids import DensityGrid, read_density, write_density
from autophyx_tet.converters.mesh.meshdata import write_mesh
from autophyx_tet.converters.points.gaussians import standard_columns
from autophyx_tet.converters.points.table import PointTable, read_points, write_points
from autophyx_tet.converters.programs.export import export_mesh
from autophyx_tet.converters.programs.material_bins import NameStyle, vertex_masses
from autophyx_tet.converters.registry import PROGRAMS
from autophyx_tet.fem.errors import UsageError
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.toolkit.asset.document import Sidecar
from autophyx_tet.toolkit.asset.formats import References
from autophyx_tet.toolkit.cli.main import main
from autophyx_tet.toolkit.options import ExportOptions, Names, TransferOptions

OAK = (1.1e10, 0.35, 700.0)


def oak_box(cells=(3, 3, 3)):
    """A cube of 0.2 m around (0.1, 0.1, 0.1): 5.6 kg of oak."""
    mesh = box_mesh((0.2, 0.2, 0.2), cells)
    return mesh.with_material(ElementMaterial(*(np.full(len(mesh.tets), value) for value in OAK)))


def graded_box():
    """The same cube with E rising tenfold along z, a value a tet."""
    mesh = oak_box()
    E = OAK[0] * 10 ** (5 * mesh.centroids[:, 2])
    return mesh.with_material(ElementMaterial(E, mesh.material.nu, mesh.material.rho))


def splats(metres_per_unit=1.0, n=200):
    """Splats of 1 cm in the cube, in units of their own."""
    rng = np.random.default_rng(0)
    x = rng.uniform(0.02, 0.18, (n, 3)) / metres_per_unit
    logs = np.full((n, 3), np.log(0.01 / metres_per_unit))
    turns = np.tile([1.0, 0, 0, 0], (n, 1))
    return PointTable(standard_columns(x, logs, turns, np.full(n, 0.5), np.zeros((n, 3))))


@pytest.fixture
def folder(tmp_path):
    """A folder with oak.msh, graded.msh, bare.msh and splats.ply."""
    write_mesh(tmp_path / "oak.msh", oak_box())
    write_mesh(tmp_path / "graded.msh", graded_box())
    write_mesh(tmp_path / "bare.msh", oak_box().with_material(None))
    write_points(tmp_path / "splats.ply", splats())
    return tmp_path


@pytest.fixture
def cli(folder, monkeypatch, capfd):
    """Call the command line in that folder: exit code, stdout, stderr."""
    monkeypatch.chdir(folder)

    def call(*arguments):
        code = main([*map(str, arguments)])
        return code, *capfd.readouterr()

    return call


def test_options_name_all_that_the_writers_know(cli, capfd):
    assert get_args(Names) == get_args(NameStyle)
    with pytest.raises(SystemExit):
        cli("export", "--help")
    assert "{" + ",".join(PROGRAMS) + "}" in "".join(capfd.readouterr().out.split())


def test_splats_carry_the_values_of_the_mesh(cli, folder):
    """E, nu, rho of the tets on every splat; m = rho V with V = sum of o (2 pi)^1.5 s^3."""
    code, out, err = cli("transfer", "oak.msh", "splats.ply", "-o", "out.ply", "--json")
    assert (code, err) == (0, "")
    document = json.loads(out)
    columns = read_points(folder / "out.ply").columns
    for name, value in zip(("E", "nu", "rho"), OAK, strict=True):
        np.testing.assert_allclose(columns[name], value, rtol=1e-6)
    assert document["schema"] == 1
    assert document["files"] == ["out.ply"]
    assert document["values"] == 200
    assert document["volume"] == pytest.approx(200 * 0.5 * (2 * np.pi) ** 1.5 * 1e-6, rel=1e-5)
    assert document["mass"] == pytest.approx(OAK[2] * document["volume"], rel=1e-6)
    assert document["warnings"] == []


@pytest.mark.slow
@pytest.mark.parametrize("given", [True, False])
def test_a_carrier_in_units_of_its_own_is_met_in_metres(given, cli, folder):
    """Splats in mm: told by --scale, or known since they are the asset of the mesh."""
    write_points(folder / "mm.ply", splats(metres_per_unit=1e-3))
    options = ["--scale", "1e-3"]
    if not given:
        digest = References(folder).digest((folder / "mm.ply").read_bytes())
        source = {"sha256": digest, "metres_per_unit": 1e-3}
        Sidecar(up="z", source=source).write(folder / "graded.msh")
        options = []
    cli("transfer", "graded.msh", "splats.ply", "-o", "m.ply")
    code, out, _ = cli("transfer", "graded.msh", "mm.ply", "-o", "out.ply", "--json", *options)
    assert code == 0
    document = json.loads(out)
    assert document["metres_per_unit"] == 1e-3
    assert document["volume"] == pytest.approx(200 * 0.5 * (2 * np.pi) ** 1.5 * 1e-6, rel=1e-4)
    in_metres, in_mm = (read_points(folder / name).columns["E"] for name in ("m.ply", "out.ply"))
    np.testing.assert_allclose(in_mm, in_metres, rtol=1e-3)  # positions are float32


def test_a_carrier_elsewhere_is_warned_about(cli, folder):
    write_points(folder / "mm.ply", splats(metres_per_unit=1e-3))
    code, out, err = cli("transfer", "oak.msh", "mm.ply", "-o", "out.ply")
    assert code == 0
    assert "200 places" in out
    assert "--scale" in err


def test_a_carrier_is_not_written_over(folder):
    """The original stays: another name is asked for."""
    before = (folder / "splats.ply").read_bytes()
    with pytest.raises(UsageError, match="another name"):
        apx.transfer(folder / "oak.msh", folder / "splats.ply", output=folder / "splats.ply")
    assert (folder / "splats.ply").read_bytes() == before


def test_a_field_a_density_grid_and_labelled_points_are_carried_too(cli, folder):
    """mesh -> cloud with E -> density grid: the same oak all the way, 0 where there is nothing."""
    lo, hi = np.zeros(3), np.full(3, 0.2)
    solid = np.zeros((8, 8, 8))
    solid[2:6, 2:6, 2:6] = 3.0
    write_density(folder / "nerf.npz", DensityGrid(lo, hi, solid))
    assert cli("transfer", "oak.msh", "splats.ply", "-o", "labelled.ply")[0] == 0
    assert cli("transfer", "labelled.ply", "nerf.npz", "-o", "out.npz")[0] == 0
    grid = read_density(folder / "out.npz")
    np.testing.assert_allclose(grid.fields["E"], np.where(solid > 0, OAK[0], 0), rtol=1e-6)


@pytest.mark.parametrize("target", PROGRAMS)
def test_every_program_gets_its_files(target, cli):
    """The document lists what is there; one material is exact with any number of bins."""
    code, out, err = cli("export", "oak.msh", "--for", target, "-o", "model", "--json")
    assert code == 0
    said = "written for MuJoCo" if target == "mujoco" else ""  # how it moves the body, always
    assert said in err
    assert len(err.splitlines()) == bool(said)
    document = json.loads(out)
    assert document["mass"] == pytest.approx(OAK[2] * 0.2**3, rel=1e-6)
    assert document["files"][0] == "model" + PROGRAMS[target].suffixes[0]
    binned = PROGRAMS[target].binned
    assert document["bins"] == (1 if binned else None)
    assert (document["quantisation"] is None) != binned
    assert all(Path(file).stat().st_size for file in document["files"])
    assert not list(Path().glob(".tmp-*"))


def test_binning_says_what_it_changed(cli):
    """Two bins of E over a decade, halved: the largest change is near 10^(1/4), and told."""
    words = ("export", "graded.msh", "--for", "calculix", "-o", "out.inp", "--bins", "2")
    code, out, _ = cli(*words, "--json")
    assert code == 0
    document = json.loads(out)
    assert document["bins"] == 2
    assert 0.2 < document["quantisation"]["largest"]["E"] < 10**0.5 - 1
    assert document["quantisation"]["largest"]["rho"] == pytest.approx(0, abs=1e-12)
    assert "--bins" in document["warnings"][0]
    _, out, err = cli(*words)
    assert "2 materials for calculix" in out
    assert "grouped into 2" in " ".join(err.split())


@pytest.mark.slow
def test_what_the_files_do_not_hold_is_a_warning(cli, folder):
    """Regions that a program does not know, and faces of a PLY that another format has not."""
    mesh = oak_box()
    halves = TetMesh(
        mesh.points, mesh.tets, (mesh.centroids[:, 0] > 0.1).astype(int), ("a", "b"), mesh.material
    )
    write_mesh(folder / "halves.msh", halves)
    words = "not kept in the files for mujoco: regions and their names"
    for target, said in (("mujoco", [words]), ("calculix", [])):
        code, out, _ = cli("export", "halves.msh", "--for", target, "-o", "out", "--json")
        assert code == 0
        warnings = json.loads(out)["warnings"]
        assert [w for w in warnings if not w.startswith("written for MuJoCo")] == said, target
    (folder / "face.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0\n0.2 0 0\n0 0.2 0\n3 0 1 2\n"
    )
    for name, said in (("out.npz", ["not kept in out.npz: element face"]), ("out.ply", [])):
        code, out, _ = cli("transfer", "halves.msh", "face.ply", "-o", name, "--json")
        assert code == 0
        found = json.loads(out)["warnings"]
        assert [warning[: len(s)] for warning, s in zip(found, said, strict=True)] == said, name


@pytest.mark.blockers
def test_mujoco_gets_rho_in_its_masses_and_its_step_is_told(cli, folder):
    """No warning of one rho, nor of rho that bins change; how MuJoCo moves it stands there."""
    mesh = oak_box()
    n = len(mesh.tets)
    right = mesh.centroids[:, 0] > 0.1
    rho = np.where(right, 7800.0, 400.0) + np.arange(n)
    for E, words in ((1e6, "with a step of 0.2 ms"), (2e11, "one rigid body")):
        material = ElementMaterial(np.full(n, E), np.full(n, 0.3), rho)
        write_mesh(folder / "two.msh", mesh.with_material(material))
        code, out, _ = cli(
            "export", "two.msh", "--for", "mujoco", "-o", "two", "--bins", "2", "--json"
        )
        assert code == 0
        document = json.loads(out)
        (said,) = document["warnings"]
        assert words in said
        assert document["quantisation"]["largest"]["rho"] == 0
        found = re.findall(r'<inertial [^>]*mass="([^"]+)"', (folder / "two.xml").read_text())
        masses = np.array(found, dtype=float)
        assert masses.sum() == pytest.approx(mesh.with_material(material).mass, rel=1e-12)
        if E == 1e6:
            np.testing.assert_allclose(masses, vertex_masses(mesh.with_material(material)))


@pytest.mark.blockers
def test_tets_too_thin_for_mujocos_solver_make_a_rigid_body_and_are_named(folder):
    """A layer a 10,000th of its neighbours' thickness: rounding would stop the solver."""
    mesh = oak_box((3, 3, 3))
    points = mesh.points.copy()
    points[np.isclose(points[:, 0], 0.2 / 3), 0] *= 1e-4
    soft = ElementMaterial.uniform(len(mesh.tets), E=1e6, nu=0.3, rho=1000.0)
    thin = TetMesh(points, mesh.tets, mesh.region, mesh.region_names, soft)
    done = export_mesh(thin, "mujoco", folder / "thin")
    assert "a mesh of better tets would stay soft" in done.notes[0]
    assert "<freejoint/>" in (folder / "thin.xml").read_text()


def test_gravity_and_up_reach_the_scene(cli, folder):
    Sidecar(up="y").write(folder / "oak.msh")
    assert cli("export", "oak.msh", "--for", "calculix", "-o", "a", "--gravity", "1.62")[0] == 0
    assert "EALL, GRAV, 1.62, 0., -1., 0." in (folder / "a.inp").read_text()
    assert cli("export", "oak.msh", "--for", "calculix", "-o", "b", "--up", "x")[0] == 0
    assert "EALL, GRAV, 9.81, -1., 0., 0." in (folder / "b.inp").read_text()


BAD = (
    ("transfer bare.msh splats.ply -o out.ply", 3, "assign"),
    ("transfer nowhere.msh splats.ply -o out.ply", 3, "nowhere.msh"),
    ("transfer oak.msh nowhere.ply -o out.ply", 3, "nowhere.ply"),
    ("transfer oak.msh text.ply -o out.ply", 3, "text.ply"),
    ("transfer text.npz splats.ply -o out.ply", 3, "text.npz"),
    ("transfer oak.msh oak.msh -o out.ply", 3, ".msh"),
    ("transfer oak.docx splats.ply -o out.ply", 3, ".docx"),
    ("transfer oak.msh splats.ply -o out.docx", 3, ".docx"),
    ("transfer oak.msh splats.ply -o no/folder/out.ply", 3, "folder"),
    ("transfer oak.msh splats.ply -o out.ply --scale 0", 2, "--scale"),
    ("transfer splats.ply splats.ply -o out.ply", 3, "no E"),
    ("export bare.msh --for calculix -o out.inp", 3, "assign"),
    ("export bare.msh --for fenics -o out", 3, "assign"),
    ("export nowhere.msh --for usd -o out", 3, "nowhere.msh"),
    ("export oak.msh --for usd -o out.obj", 3, ".usda"),
    ("export oak.msh --for usd -o no/folder/out", 3, "folder"),
    ("export oak.msh --for calculix -o out --bins 0", 2, "--bins"),
    ("export oak.msh --for usd -o out --names vomp", 2, "--names"),
    ("export oak.msh --for gmsh -o oak", 3, "overwritten"),
)


@pytest.mark.slow
def test_bad_input_ends_in_one_line_and_leaves_nothing(cli, folder):
    for name in ("text.ply", "text.npz"):
        (folder / name).write_text("hello")
    before = {file: file.read_bytes() for file in folder.rglob("*")}
    for line, code, words in BAD:
        done, out, err = cli(*line.split())
        assert done == code, f"{line}: {err}"
        assert out == "", line
        assert len(err.strip().splitlines()) == 1, f"{line}: {err}"
        assert words in err, line
        assert {file: file.read_bytes() for file in folder.rglob("*")} == before, line


def test_an_unknown_program_is_exit_2(cli):
    with pytest.raises(SystemExit) as done:
        cli("export", "oak.msh", "--for", "blender", "-o", "out")
    assert done.value.code == 2


def test_a_write_that_fails_midway_leaves_nothing(folder, monkeypatch):
    """FEniCSx gets three files: none of them is there when the last one fails."""
    from autophyx_tet.converters.programs import fenics

    def fail(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(fenics, "_LOADER", type("Broken", (), {"format": fail})())
    before = sorted(folder.rglob("*"))
    with pytest.raises(KeyboardInterrupt):
        apx.export(oak_box(), "fenics", output=folder / "out")
    assert sorted(folder.rglob("*")) == before


def test_python_is_the_command_line(folder):
    """apx.transfer and apx.export take meshes and paths, and say the same."""
    done = apx.transfer(oak_box(), folder / "splats.ply", output=folder / "out.ply")
    assert done.document()["values"] == 200
    names = ExportOptions(names="vomp")
    written = apx.export(oak_box(), "gmsh", output=folder / "gmsh.msh", options=names)
    assert "youngs_modulus" in written.files[0].read_text()
    with pytest.raises(UsageError, match="blender"):
        apx.export(oak_box(), "blender", output=folder / "x")
    with pytest.raises(UsageError, match="scale"):
        apx.transfer(
            oak_box(), folder / "splats.ply", output=folder / "o.ply",
            options=TransferOptions(scale=float("nan")),
        )  # fmt: skip


def test_a_mean_is_never_called_exact(folder):
    """SOFA knows one nu: .1 and .48 become their mean, and that is said with both."""
    box = box_mesh((1, 1, 1), (2, 2, 2))
    low = box.centroids[:, 2] < 0.5
    E, rho = np.full(len(low), 1e6), np.full(len(low), 1e3)
    mesh = box.with_material(ElementMaterial(E, np.where(low, 0.1, 0.48), rho))
    said = apx.export(mesh, "sofa", output=folder / "one.scn").warnings
    assert "not kept in the files for sofa: nu of every tet" in said
    assert "nu runs from 0.1 to 0.48: one value is written" in said
    assert apx.export(mesh, "calculix", output=folder / "one.inp").warnings == ()
