"""What a format says it keeps comes back; what it does not keep is refused or told as lost."""

import logging
import subprocess
import sys
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from autophyx_tet.converters.grids import DensityGrid, density_losses, read_density, write_density
from autophyx_tet.converters.mesh.meshdata import WHOLE, read_data, write_mesh
from autophyx_tet.converters.points.ply import Ply, columns_table, write_ply
from autophyx_tet.converters.points.table import PointTable, point_losses, read_points, write_points
from autophyx_tet.converters.registry import (
    GRID_FORMATS,
    MESH_FORMATS,
    POINT_FORMATS,
    Keeps,
    written,
)
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.fem.table import load_grains

from . import encoders

BOX = box_mesh((1, 1, 1), (2, 1, 1))
RNG = np.random.default_rng(0)
N = len(BOX.tets)
MATERIAL = ElementMaterial(
    10 ** RNG.uniform(4, 9, N), RNG.uniform(0.1, 0.45, N), 10 ** RNG.uniform(2, 4, N)
)
NAMED = TetMesh(BOX.points, BOX.tets, (BOX.centroids[:, 0] > 0.5).astype(int), ("leg", "seat"))


OAK = load_grains()["white oak (along grain)"].constants(1.2e10)
TURN = np.linalg.qr(RNG.normal(size=(3, 3)))[0]
WOODEN = MATERIAL.with_grain(np.arange(N) > 2, OAK, TURN)


def mesh_with(item):
    """A mesh and further arrays that hold one item to keep, and nothing else of them."""
    if item is Keeps.GRAIN:
        return BOX.with_material(WOODEN), {}
    if item is Keeps.POINT_DATA:
        return BOX, {"point_data": {"u": BOX.points * 2}}
    if item is Keeps.CELL_DATA:
        return BOX, {"cell_data": {"s": BOX.volumes}}
    return (NAMED if item is Keeps.REGIONS else BOX.with_material(MATERIAL)), {}


def mesh_back(item, data):
    """Whether that item of ``mesh_with`` is in what was read."""
    if item is Keeps.REGIONS:
        same = np.array_equal(data.mesh.region, NAMED.region)
        return same and data.mesh.region_names == NAMED.region_names
    if item is Keeps.POINT_DATA:
        return np.array_equal(data.point_data["u"], BOX.points * 2)
    if item is Keeps.CELL_DATA:
        return np.array_equal(data.cell_data["s"], BOX.volumes)
    if item is Keeps.GRAIN:  # the tensors are made anew of nine constants: to round-off
        scale, found = np.abs(WOODEN.tensor).max(), data.mesh.material
        same = np.allclose(found.tensor, WOODEN.tensor, rtol=0, atol=1e-12 * scale)
        return same and np.array_equal(found.axes, WOODEN.axes) and not data.cell_data
    name = {Keeps.E: "E", Keeps.NU: "nu", Keeps.RHO: "rho"}[item]
    return np.array_equal(getattr(data.mesh.material, name), getattr(MATERIAL, name))


def test_meshes_keep_what_they_say(tmp_path):
    """Regions, E, nu, rho and further arrays, one at a time, through every mesh format."""
    for suffix, item in product(written(MESH_FORMATS), sorted(WHOLE)):
        path, case = tmp_path / f"m{suffix}", f"{suffix}: {item}"
        mesh, arrays = mesh_with(item)
        if item in MESH_FORMATS[suffix].keeps:
            assert write_mesh(path, mesh, **arrays) == (), case
            assert mesh_back(item, read_data(path)), case
        else:
            with pytest.raises(InputError):
                write_mesh(path, mesh, **arrays)


def columns(extra=()):
    table = {axis: RNG.normal(size=4).astype("f4") for axis in "xyz"}
    return table | {name: RNG.normal(size=4).astype("f4") for name in extra}


def las_table(folder):
    """A cloud read from LAS with a record of its own: only such a cloud is written as LAS."""
    laspy = pytest.importorskip("laspy")
    header = laspy.LasHeader(point_format=0, version="1.2")
    header.vlrs.append(laspy.VLR("somebody", 7, "where it stands", b"here"))
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = RNG.normal(size=(3, 4))
    cloud.write(str(folder / "own.las"))
    return read_points(folder / "own.las")


def own_table(suffix, folder):
    """A table of a format's own file that holds more than columns and remarks."""
    if suffix == ".ply":
        rest = (("element face 1", "property list uchar int vertex_indices"), b"\x03\0\0\0\0" * 2)
        ply = Ply({"vertex": columns_table(columns())}, rest=rest)
        write_ply(folder / "own.ply", ply)
        return read_points(folder / "own.ply")
    if suffix == ".pcd":
        write_points(folder / "own.pcd", PointTable(columns()))
        content = (folder / "own.pcd").read_bytes()
        content = content.replace(b"WIDTH 4\nHEIGHT 1", b"WIDTH 2\nHEIGHT 2")
        (folder / "own.pcd").write_bytes(content)
        return read_points(folder / "own.pcd")
    return las_table(folder)


def table_with(item, suffix, folder):
    """A table that holds an item to keep; for LAS one that was read from it."""
    if item is Keeps.OTHERS:
        return own_table(suffix if suffix in (".pcd", ".las", ".laz") else ".ply", folder)
    base = PointTable(columns())
    if suffix in (".las", ".laz"):
        base = las_table(folder)
    if item is Keeps.REMARKS:
        return base.with_columns({}, comment="made by a test")
    name = "f_rest_0" if item is Keeps.HARMONICS else "E"
    return base.with_columns({name: np.arange(len(base), dtype="f4")})


def table_back(item, given, found):
    if item is Keeps.REMARKS:
        return found.comments == given.comments
    if item is Keeps.OTHERS:
        return found.others.names == given.others.names != ()
    return all(np.array_equal(values, found.columns[n]) for n, values in given.columns.items())


def test_points_keep_what_they_say(tmp_path, caplog):
    """Columns, harmonics, remarks and what else a file held, through every point format."""
    items = (Keeps.COLUMNS, Keeps.HARMONICS, Keeps.REMARKS, Keeps.OTHERS)
    for suffix, item in product(written(POINT_FORMATS), items):
        path, case = tmp_path / f"c{suffix}", f"{suffix}: {item}"
        given = table_with(item, suffix, tmp_path)
        caplog.clear()
        write_points(path, given)
        if item in POINT_FORMATS[suffix].keeps:
            assert table_back(item, given, read_points(path)), case
            assert not caplog.records, case
        else:
            assert item in point_losses(path, given), case
            assert item in caplog.text, case


def test_what_only_its_own_format_gives_back_is_lost_elsewhere(tmp_path):
    """Faces of a PLY, rows of a PCD, records of a LAS: another format says what it leaves out."""
    for own, other in product((".ply", ".pcd", ".las"), (".ply", ".pcd", ".npz")):
        lost = point_losses(f"x{other}", own_table(own, tmp_path))
        assert (Keeps.OTHERS in lost) == (own != other), f"{own} to {other}"


def test_read_only_points_keep_what_they_say(tmp_path):
    """Packed splats give their harmonics where the format has them; none takes a column more."""
    encode = {
        ".splat": encoders.splat,
        ".spz": lambda v: encoders.spz(v, 3),
        ".ksplat": lambda v: encoders.ksplat(v, 1),
        ".xyz": lambda v: "\n".join("{} {} {} 7".format(*row) for row in v["means"]).encode(),
    }
    for suffix in set(POINT_FORMATS) - set(written(POINT_FORMATS)):
        path = tmp_path / f"p{suffix}"
        path.write_bytes(encode[suffix](encoders.standard(20, 3)))
        table, keeps = read_points(path), POINT_FORMATS[suffix].keeps
        assert ("f_rest_0" in table.columns) == (Keeps.HARMONICS in keeps), suffix
        assert not {Keeps.COLUMNS, Keeps.REMARKS, Keeps.OTHERS} & keeps
        with pytest.raises(InputError, match="no room for further columns"):
            write_points(path, table)


def test_grids_keep_what_they_say(tmp_path, caplog):
    """Further arrays and the density of the surface, through every format of density grids."""
    plain = DensityGrid(np.zeros(3), np.ones(3), np.ones((8, 8, 8), "f4"))
    given = {
        Keeps.ARRAYS: replace(plain, fields={"E": 2 * plain.density}),
        Keeps.THRESHOLD: replace(plain, threshold=0.5),
    }
    for suffix, (item, grid) in product(written(GRID_FORMATS), given.items()):
        path, case = tmp_path / f"g{suffix}", f"{suffix}: {item}"
        caplog.clear()
        with caplog.at_level(logging.WARNING):
            files = write_density(path, grid)
        found = [read_density(file) for file in files]
        if item not in GRID_FORMATS[suffix].keeps:
            assert density_losses(path, grid) == (item,), case
            assert item in caplog.text, case
        elif item is Keeps.THRESHOLD:
            assert found[0].threshold == 0.5, case
        else:  # in the same file, or in one of its own
            held = [*found[0].fields.values(), *(other.density for other in found[1:])]
            np.testing.assert_array_equal(held[0], grid.fields["E"], err_msg=case)
            assert not caplog.records, case


def test_suffixes_are_listed_without_a_heavy_package():
    """Names, titles, writers and what is kept: no reader's library is loaded for them."""
    code = (
        "import sys\n"
        "from autophyx_tet.converters import registry as r\n"
        "from autophyx_tet.toolkit.asset.formats import ASSET_FORMATS\n"
        "families = (r.MESH_FORMATS, r.POINT_FORMATS, r.GRID_FORMATS, r.PROGRAMS, ASSET_FORMATS)\n"
        "before = {m for m in sys.modules if m.startswith('autophyx_tet.converters.')}\n"
        "names = [name for family in families for name in family]\n"
        "assert before == {m for m in sys.modules if m.startswith('autophyx_tet.converters.')}\n"
        "[family[name] for family in families for name in family]\n"
        "print(*({m.split('.')[0] for m in sys.modules}\n"
        "        & {'meshio', 'trimesh', 'torch', 'warp', 'scipy', 'igl', 'laspy', 'msgpack'}))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
