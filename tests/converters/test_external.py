"""The real programs read what we write: each is run, and one of its own numbers is checked."""

import re
import shutil
import subprocess

import numpy as np
import pytest
from autophyx_tet.converters.mesh.meshdata import read_mesh, write_mesh
from autophyx_tet.converters.points.gaussians import standard_columns
from autophyx_tet.converters.points.table import PointTable, read_points, write_points
from autophyx_tet.converters.programs.export import export_mesh
from autophyx_tet.converters.programs.material_bins import bin_materials
from autophyx_tet.fem.grain import axes_about
from autophyx_tet.fem.material import ElementMaterial, lame_parameters
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.statics import solve_static
from autophyx_tet.fem.table import load_grains

from . import encoders

pytestmark = pytest.mark.external


def beam(cells=(20, 4, 4), *, varying=False) -> TetMesh:
    """The bench beam: 1 x 0.2 x 0.2 m, lower half 1e6 Pa, upper half 1e7 Pa, or E(x, z)."""
    box = box_mesh((1, 0.2, 0.2), cells)
    x, _, z = box.centroids.T
    top = z > 0.1
    E, nu, rho = np.where(top, 1e7, 1e6), np.where(top, 0.4, 0.3), np.where(top, 1200.0, 1000.0)
    if varying:
        E, nu, rho = 10 ** (6 + 5 * z + 0.3 * np.sin(9 * x)), 0.3 + 0.1 * x, 1000 * (1 + z)
    return TetMesh(
        box.points, box.tets, top.astype(int), ("lower", "upper"), ElementMaterial(E, nu, rho)
    )


def program(name: str) -> str:
    found = shutil.which(name)
    if found is None:
        pytest.skip(f"{name} is not installed")
    return found


def run(*command, cwd):
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return done.stdout + done.stderr


def test_gmsh_reads_tets_groups_and_three_views(tmp_path):
    """Gmsh counts the tets of each physical group and finds three views with our extremes."""
    mesh = beam(varying=True)
    assert mesh.material is not None
    export_mesh(mesh, "gmsh", tmp_path / "m")
    views = "".join(
        f'Printf("view {i} %.17g %.17g", View[{i}].Min, View[{i}].Max);\n' for i in range(3)
    )
    (tmp_path / "q.geo").write_text(
        'Merge "m.msh";\nPrintf("views %g", PostProcessing.NbViews);\n'
        + views
        + 'Mesh.MshFileVersion = 4.1; Save "again.msh";\nMesh.Binary = 1; Save "binary.msh";\n'
    )
    out = run(program("gmsh"), "q.geo", "-", "-v", "5", cwd=tmp_path)
    assert f"{len(mesh.tets)} elements" in out
    assert "views 3" in out
    for i, name in enumerate(("E", "nu", "rho")):
        found = re.search(rf"view {i} (\S+) (\S+)", out)
        assert found is not None
        values = getattr(mesh.material, name)
        np.testing.assert_allclose([float(v) for v in found.groups()], [values.min(), values.max()])
    for file in ("again.msh", "binary.msh"):  # Gmsh's own 4.1, text and binary
        back = read_mesh(tmp_path / file)
        assert back.region_names == ("lower", "upper")
        np.testing.assert_allclose(back.region_volumes(), mesh.region_volumes(), rtol=1e-12)


def calculix_displacements(folder) -> np.ndarray:
    """What ``ccx`` finds at the points of the deck in ``folder`` [m], (points, 3)."""
    run(program("ccx"), "deck", cwd=folder)
    rows = [line.split() for line in (folder / "deck.dat").read_text().splitlines()]
    return np.array([row[1:] for row in rows if len(row) == 4 and row[0].isdigit()], dtype=float)


# CalculiX prints seven digits; 64 bins of E(x, z) differ by 1 %.
@pytest.mark.parametrize(
    ("order", "varying", "tolerance"), [(None, False, 1e-6), (1, False, 1e-6), (None, True, 0.01)]
)
def test_calculix_sags_as_we_do(order, varying, tolerance, tmp_path):
    """Clamped beam under gravity, quadratic tets if nothing is said: every point as ours."""
    mesh = beam(varying=varying)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)
    done = export_mesh(mesh, "calculix", tmp_path / "deck", supports=held, order=order)
    assert done.bins == (64 if varying else 2)
    theirs = calculix_displacements(tmp_path)
    ours = solve_static(mesh, held, gravity_vector=(0, 0, -9.81), order=order)
    assert ours.order == (order or 2)
    largest = np.abs(ours.displacement).max()
    np.testing.assert_allclose(theirs, ours.displacement, atol=tolerance * largest)


def wooden_beam(cells=(10, 3, 3)) -> TetMesh:
    """Oak below, its grain across the beam's axis, steel above."""
    mesh = beam(cells)
    assert mesh.material is not None
    oak = load_grains()["white oak (along grain)"].constants(1e6)
    axes = axes_about(np.array([1.0, 0.5, 0.3]))
    return mesh.with_material(mesh.material.with_grain(mesh.region == 0, oak, axes))


def test_calculix_bends_wood_as_we_do(tmp_path):
    """Clamped beam, oak below with the grain across the beam's axis, steel above: as ours."""
    mesh = wooden_beam()
    assert mesh.material is not None
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)
    done = export_mesh(mesh, "calculix", tmp_path / "deck", supports=held)
    assert done.lost == ()
    theirs = calculix_displacements(tmp_path)
    ours = solve_static(mesh, held, gravity_vector=(0, 0, -9.81)).displacement
    largest = np.abs(ours).max()
    np.testing.assert_allclose(theirs, ours, atol=1e-6 * largest)
    plain = mesh.with_material(mesh.material.without_grain())
    other = solve_static(plain, held, gravity_vector=(0, 0, -9.81)).displacement
    assert np.abs(other - ours).max() > 0.1 * largest


def test_calculix_stands_on_our_springs(tmp_path):
    """Springs of two stiffnesses under a block, rollers beside it: every point as ours."""
    mesh = beam((6, 2, 2))
    below, end = mesh.points[:, 2] == 0, mesh.points[:, 0] == 0
    held = Supports.none(len(mesh.points)).with_springs(below, (0.0, 0.0, 4e3))
    held = held.with_springs(end & below, (0.0, 7e2, 1e3)).with_fixed(end, 0)
    export_mesh(mesh, "calculix", tmp_path / "deck", supports=held)
    ours = solve_static(mesh, held, gravity_vector=(0, 0, -9.81)).displacement
    theirs = calculix_displacements(tmp_path)
    np.testing.assert_allclose(theirs, ours, atol=1e-6 * np.abs(ours).max())


def test_usd_finds_a_valid_tet_mesh_with_bound_materials(tmp_path):
    """No inverted element, the surface as we have it, subsets a partition, E of each exact."""
    pytest.importorskip("pxr")
    from pxr import Usd, UsdGeom, UsdShade

    mesh = beam()
    export_mesh(mesh, "usd", tmp_path / "m", up="y")
    stage = Usd.Stage.Open(str(tmp_path / "m.usda"))
    body = UsdGeom.TetMesh(stage.GetPrimAtPath("/World/Body"))
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    assert len(body.GetTetVertexIndicesAttr().Get()) == len(mesh.tets)
    assert len(UsdGeom.TetMesh.FindInvertedElements(body)) == 0
    assert len(UsdGeom.TetMesh.ComputeSurfaceFaces(body)) == len(mesh.boundary.faces)
    image = UsdGeom.Imageable(body.GetPrim())
    assert UsdGeom.Subset.ValidateFamily(image, "tetrahedron", "materialBind")[0]
    bins = bin_materials(mesh)
    subsets = UsdGeom.Subset.GetGeomSubsets(image, "tetrahedron", "materialBind")
    for i, subset in enumerate(subsets):
        bound, _ = UsdShade.MaterialBindingAPI(subset.GetPrim()).ComputeBoundMaterial()
        value = bound.GetPrim().GetAttribute("physics:youngsModulus").Get()
        assert value == pytest.approx(bins.E[i], rel=1e-6)
        np.testing.assert_array_equal(
            subset.GetIndicesAttr().Get(), np.flatnonzero(bins.label == i)
        )
    whole, _ = UsdShade.MaterialBindingAPI(body.GetPrim()).ComputeBoundMaterial("physics")
    density = whole.GetPrim().GetAttribute("physics:density").Get()
    assert density == pytest.approx(mesh.mass / mesh.volume, rel=1e-6)
    assert "PhysicsDeformableBodyAPI" in body.GetPrim().GetPrimTypeInfo().GetAppliedAPISchemas()
    exact = UsdGeom.PrimvarsAPI(body.GetPrim()).GetPrimvar("E").Get()
    assert mesh.material is not None
    np.testing.assert_array_equal(exact, mesh.material.E)


def test_scikit_fem_solves_on_our_vtk(tmp_path):
    """Its P1 elasticity on our .vtk, with E and nu of each tet, sags as ours does."""
    skfem = pytest.importorskip("skfem")
    import meshio
    from skfem.helpers import ddot, eye, sym_grad, trace

    mesh = beam((10, 2, 2), varying=True)
    write_mesh(tmp_path / "m.vtk", mesh)
    grid = meshio.read(tmp_path / "m.vtk")
    theirs = skfem.MeshTet(grid.points.T, grid.cells_dict["tetra"].T)
    basis = skfem.Basis(theirs, skfem.ElementVector(skfem.ElementTetP1()), intorder=1)
    E, nu, rho = (grid.cell_data[name][0][:, None] for name in ("E", "nu", "rho"))
    lam, mu = lame_parameters(E, nu)

    @skfem.BilinearForm
    def stiffness(u, v, _):
        e = sym_grad(u)
        return ddot(lam * eye(trace(e), 3) + 2 * mu * e, sym_grad(v))

    @skfem.LinearForm
    def weight(v, _):
        return -9.81 * rho * v[2]

    held = basis.get_dofs(lambda x: np.isclose(x[0], 0))
    u = skfem.solve(*skfem.condense(stiffness.assemble(basis), weight.assemble(basis), D=held))
    clamp = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)
    ours = solve_static(mesh, clamp, gravity_vector=(0, 0, -9.81), order=1).displacement
    np.testing.assert_allclose(u[basis.nodal_dofs].T, ours, atol=1e-6 * np.abs(ours).max())


def test_sfepy_reads_groups_and_arrays(tmp_path):
    """SfePy finds the tets, and the two values of mat_id as its cell groups."""
    pytest.importorskip("sfepy")
    from sfepy.discrete.fem import Mesh

    mesh = beam()
    write_mesh(tmp_path / "m.vtk", mesh)
    read = Mesh.from_file(str(tmp_path / "m.vtk"))
    assert read.n_el == len(mesh.tets)
    np.testing.assert_array_equal(read.cmesh.cell_groups, mesh.region + 1)


@pytest.mark.parametrize("suffix", [".vtu", ".vtk"])
def test_paraviews_reader_sees_every_array(suffix, tmp_path):
    """VTK's own readers, through PyVista: tets, E to the bit, volume, displacement."""
    pyvista = pytest.importorskip("pyvista")
    mesh = beam(varying=True)
    assert mesh.material is not None
    u = np.random.default_rng(0).normal(size=mesh.points.shape)
    write_mesh(tmp_path / f"m{suffix}", mesh, point_data={"displacement": u})
    grid = pyvista.read(tmp_path / f"m{suffix}")
    assert grid.n_cells == len(mesh.tets)
    np.testing.assert_array_equal(grid.cell_data["E"], mesh.material.E)
    np.testing.assert_array_equal(grid.point_data["displacement"], u)
    assert grid.volume == pytest.approx(mesh.volume, rel=1e-9)


def splat_transform(tmp_path):
    """The npm package of that name, installed for this test alone."""
    npm = program("npm")
    package = "@playcanvas/splat-transform@3.7.0"
    done = subprocess.run(
        [npm, "install", "--no-audit", "--no-fund", "--prefix", str(tmp_path), package],
        capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    if done.returncode:
        pytest.skip(f"npm cannot install it: {done.stderr[-300:]}")
    return str(tmp_path / "node_modules" / ".bin" / "splat-transform")


def test_splats_agree_with_splat_transform(tmp_path):
    """What it packs or unpacks, .compressed.ply, .spz, .ksplat, .splat, we read to the same bits.

    And it reads our splats with E, nu, rho appended.
    """
    tool = splat_transform(tmp_path)
    plain = PointTable(standard_columns(**encoders.standard(700, 15)))
    write_points(tmp_path / "s.ply", plain)
    (tmp_path / "s.ksplat").write_bytes(encoders.ksplat(encoders.standard(700, 8), 1))
    (tmp_path / "s.splat").write_bytes(encoders.splat(encoders.standard(700)))
    for packed in ("s.compressed.ply", "s.spz"):
        run(tool, "-q", "s.ply", packed, cwd=tmp_path)
    for packed in ("s.compressed.ply", "s.spz", "s.ksplat", "s.splat"):
        run(tool, "-q", "-w", packed, "theirs.ply", cwd=tmp_path)
        ours, theirs = read_points(tmp_path / packed), read_points(tmp_path / "theirs.ply")
        assert set(ours.columns) == set(theirs.columns)
        for name, values in theirs.columns.items():
            # rotations of .splat: bytes are counted from 128 by its author, from 127.5 there
            atol = 0.02 if packed == "s.splat" and name.startswith("rot") else 1e-6
            np.testing.assert_allclose(ours.columns[name], values, atol=atol)
    extra = {name: np.full(700, 5.0, dtype="f4") for name in ("E", "nu", "rho")}
    write_points(tmp_path / "more.ply", plain.with_columns(extra))
    run(tool, "-q", "-w", "more.ply", "back.ply", cwd=tmp_path)
    assert len(read_points(tmp_path / "back.ply")) == 700
