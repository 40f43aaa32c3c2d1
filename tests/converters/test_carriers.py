"""Transfer and the way back: values on every carrier, order and unknown properties kept."""

import numpy as np
import pytest
from autophyx_tet.converters import npz
from autophyx_tet.converters.grids import DensityGrid, read_density, write_density
from autophyx_tet.converters.points.gaussians import standard_columns
from autophyx_tet.converters.points.table import PointTable, read_points, write_points
from autophyx_tet.converters.transfer import (
    append_material,
    field_from_points,
    field_from_tets,
    read_field_points,
    sample_material,
)
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.predictors.field import MaterialField
from autophyx_tet.predictors.grid import Grid

from . import encoders

STEEL, FOAM = (2e11, 0.3, 7850.0), (1e5, 0.1, 50.0)


def two_parts() -> MaterialField:
    """Foam at x < 0, steel at x > 0, in a cube of 4 m around the origin."""
    grid = Grid(np.full(3, -2.0), 0.25, (16, 16, 16))
    part = (grid.centers()[..., 0] > 0).astype(int)
    E, nu, rho = (np.where(part == 1, s, f) for s, f in zip(STEEL, FOAM, strict=True))
    return MaterialField(
        grid, np.ones(grid.shape, dtype=bool), E, nu, rho, part=part, part_names=("foam", "steel")
    )


def assert_two_parts(columns, x, rtol=1e-6):
    steel = np.asarray(x) > 0
    for i, name in enumerate(("E", "nu", "rho")):
        np.testing.assert_allclose(columns[name], np.where(steel, STEEL[i], FOAM[i]), rtol=rtol)
    np.testing.assert_array_equal(columns["part"], steel)


def test_splat_ply_gets_three_values_and_keeps_the_rest(tmp_path):
    columns = {**standard_columns(**encoders.standard(200, 15)), "id": np.arange(200, dtype="u2")}
    write_points(tmp_path / "in.ply", PointTable(columns))
    result = append_material(two_parts(), tmp_path / "in.ply", tmp_path / "out.ply")
    back = read_points(tmp_path / "out.ply")
    assert list(back.columns) == [*columns, "E", "nu", "rho", "part"]
    for name, values in columns.items():
        np.testing.assert_array_equal(back.columns[name], values)
    assert_two_parts(back.columns, back.columns["x"])
    assert '"E": "Pa"' in back.comments[-1]
    assert '"part": ["foam", "steel"]' in back.comments[-1]
    assert result.points == 200
    assert result.mass is not None
    assert result.volume is not None
    assert FOAM[2] < result.mass / result.volume < STEEL[2]


@pytest.mark.parametrize("suffix", [".splat", ".spz", ".ksplat"])
def test_carriers_without_room_get_a_sidecar_in_the_same_order(suffix, tmp_path):
    encode = {".splat": encoders.splat, ".spz": lambda v: encoders.spz(v, 2),
              ".ksplat": lambda v: encoders.ksplat(v, 1)}[suffix]  # fmt: skip
    source = tmp_path / f"in{suffix}"
    source.write_bytes(encode(encoders.standard(300)))
    result = append_material(two_parts(), source, tmp_path / f"out{suffix}")
    assert [f.name for f in result.files] == [f"out{suffix}", "out.npz"]
    assert (tmp_path / f"out{suffix}").read_bytes() == source.read_bytes()
    sidecar = npz.load_npz(tmp_path / "out.npz")
    assert_two_parts(sidecar, read_points(source).columns["x"])
    append_material(two_parts(), source, tmp_path / "as.ply")
    assert_two_parts(read_points(tmp_path / "as.ply").columns, read_points(source).columns["x"])


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".npz"])
def test_clouds_keep_invalid_points_as_nan(suffix, tmp_path):
    """A depth camera's missing point stays in its place, without a value."""
    x = np.array([-1.0, np.nan, 1.0])
    write_points(tmp_path / f"in{suffix}", PointTable({"x": x, "y": x, "z": x}))
    result = append_material(two_parts(), tmp_path / f"in{suffix}", tmp_path / f"out{suffix}")
    columns = read_points(tmp_path / f"out{suffix}").columns
    np.testing.assert_allclose(columns["E"], [FOAM[0], np.nan, STEEL[0]], rtol=1e-12)
    np.testing.assert_array_equal(columns["part"], [0, -1, 1])
    assert (result.points, result.n_invalid) == (3, 1)


def test_density_grid_gets_values_where_it_is_dense(tmp_path):
    """E, nu, rho in cells above the threshold, 0 elsewhere; density itself is not touched."""
    sigma = np.zeros((8, 8, 8), dtype="f4")
    sigma[2:6] = 10.0
    grid = DensityGrid(np.full(3, -1.0), np.full(3, 1.0), sigma, threshold=1.0)
    write_density(tmp_path / "in.npz", grid)
    append_material(two_parts(), tmp_path / "in.npz", tmp_path / "out.npz")
    back = read_density(tmp_path / "out.npz")
    np.testing.assert_array_equal(back.density, sigma)
    full = sigma > 1
    x = back.centers().reshape(8, 8, 8, 3)[full][:, 0]
    assert_two_parts({name: a[full] for name, a in back.fields.items()}, x)
    assert (back.fields["E"][~full] == 0).all()


def test_unknown_targets_are_told(tmp_path):
    with pytest.raises(InputError, match=r"cannot transfer onto '.doc'; known are"):
        append_material(two_parts(), tmp_path / "a.doc", tmp_path / "b.doc")
    (tmp_path / "a.xyz").write_text("0 0 0\n1 1 1\n")
    with pytest.raises(InputError, match=r".xyz is not converted to .splat"):
        append_material(two_parts(), tmp_path / "a.xyz", tmp_path / "b.splat")


def test_mesh_to_field_and_back_is_exact_per_region():
    """Tets -> grid -> the same tets: uniform regions come back to 1e-12, never mixed."""
    box = box_mesh((2, 1, 1), (6, 3, 3))
    region = (box.centroids[:, 0] > 1).astype(int)
    values = [np.where(region == 1, s, f) for s, f in zip(STEEL, FOAM, strict=True)]
    mesh = TetMesh(box.points, box.tets, region, ("foam", "steel"), ElementMaterial(*values))
    field = field_from_tets(mesh, cells=16)
    assert field.part_names == ("foam", "steel")
    back = sample_material(mesh, field).mesh.material
    assert back is not None
    np.testing.assert_allclose(back.E, values[0], rtol=1e-12)
    np.testing.assert_allclose(back.rho, values[2], rtol=1e-12)
    filled = field.occupied.sum() * field.grid.h**3
    np.testing.assert_allclose(filled, mesh.volume, rtol=1e-9)


def test_a_mesh_transfers_like_its_field(tmp_path):
    box = box_mesh((1, 1, 1), (3, 3, 3))
    mesh = box.with_material(ElementMaterial.uniform(len(box.tets), E=3e6, nu=0.4, rho=1100))
    points = np.random.default_rng(0).uniform(0, 1, (50, 3))
    write_points(tmp_path / "in.npz", PointTable(dict(zip("xyz", points.T, strict=True))))
    append_material(mesh, tmp_path / "in.npz", tmp_path / "out.npz", cells=8)
    np.testing.assert_allclose(read_points(tmp_path / "out.npz").columns["E"], 3e6, rtol=1e-12)


def voxel_points(shape=(5, 4, 3), h=0.1):
    grid = Grid(np.zeros(3), h, shape)
    points = grid.centers().reshape(-1, 3)
    rng = np.random.default_rng(0)
    n = len(points)
    return points, 10 ** rng.uniform(4, 9, n), rng.uniform(0.1, 0.45, n), rng.uniform(500, 2000, n)


def test_vomp_voxels_come_back_voxel_for_voxel(tmp_path):
    """points, youngs_modulus, poisson_ratio, density in an .npz, one row a voxel."""
    points, E, nu, rho = voxel_points()
    npz.save_npz(tmp_path / "v.npz", points=points, youngs_modulus=E, poisson_ratio=nu, density=rho)
    field = read_field_points(tmp_path / "v.npz", spacing=0.1)
    np.testing.assert_array_equal(field.occupied.sum(), len(points))
    np.testing.assert_allclose(field.E[field.occupied], E, rtol=1e-12)
    np.testing.assert_allclose(field.rho[field.occupied], rho, rtol=1e-12)
    np.testing.assert_allclose(field.grid.centers()[field.occupied], points, atol=1e-12)


def test_pixie_ply_brings_labels(tmp_path):
    """x y z, part_label, density, E, nu: the labels become parts, values stay apart."""
    points, E, _, _ = voxel_points()
    label = (points[:, 0] > 0.2).astype("i4") * 7
    E = np.where(label == 7, 1e9, 1e5).astype("f4")
    columns = dict(zip("xyz", points.astype("f4").T, strict=True))
    columns |= {"part_label": label, "density": np.full_like(E, 900), "E": E,
                "nu": np.full_like(E, 0.5)}  # fmt: skip
    write_points(tmp_path / "p.ply", PointTable(columns))
    field = read_field_points(tmp_path / "p.ply", spacing=0.1)
    assert field.part_names == ("part 0", "part 7")
    assert field.part is not None
    expected = np.where(field.part[field.occupied] == 1, 1e9, 1e5)
    np.testing.assert_allclose(field.E[field.occupied], expected)
    assert field.nu[field.occupied].max() == 0.495


def test_a_shell_of_points_is_filled():
    """Points on a sphere enclose a ball of the nearest values: 4/3 pi r^3 within 8 %."""
    rng = np.random.default_rng(0)
    points = rng.normal(size=(200_000, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    columns = dict(zip("xyz", points.T, strict=True))
    one = np.ones(len(points))
    table = PointTable({**columns, "E": 1e6 * one, "nu": 0.3 * one, "rho": 1000 * one})
    field = field_from_points(table, cells=64)
    volume = field.occupied.sum() * field.grid.h**3
    np.testing.assert_allclose(volume, 4 / 3 * np.pi, rtol=0.08)
    shell = field_from_points(table, cells=64, fill=False)
    assert shell.occupied.sum() < 0.3 * field.occupied.sum()


def test_points_without_values_are_told():
    with pytest.raises(InputError, match="points have no E"):
        field_from_points(PointTable(dict.fromkeys("xyz", np.zeros(3))))
