"""Round trips over the table of mesh formats, and what hostile files and paths end in."""

from itertools import product
from pathlib import Path

import numpy as np
import pytest
from autophyx_tet.converters.mesh.meshdata import read_data, read_mesh, write_mesh
from autophyx_tet.converters.mesh.vtk import read_pvd, write_pvd
from autophyx_tet.converters.registry import MESH_FORMATS
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

BOTH = [s for s in MESH_FORMATS if MESH_FORMATS[s].read and MESH_FORMATS[s].write]
RICH = [suffix for suffix in BOTH if suffix != ".npz"]  # those with room for further arrays
in_one_folder = settings(
    max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


SEEDS = st.integers(0, 2**32 - 1)
SIZES = st.tuples(*[st.floats(1e-3, 1e3)] * 3)
NAMES = st.lists(st.text(max_size=12), min_size=1, max_size=4, unique=True)


def some_mesh(seed, size, names) -> TetMesh:
    """A jittered box of tets in shuffled order, with random regions and, every other, material."""
    rng = np.random.default_rng(seed)
    box = box_mesh(size, (1, 2, 1))
    points = box.points * (1 + rng.uniform(-0.05, 0.05, box.points.shape))
    tets = box.tets[rng.permutation(len(box.tets))]
    region = rng.integers(0, len(names), len(tets))
    material = None
    if seed % 2:
        E, rho = 10 ** rng.uniform(3, 12, len(tets)), 10 ** rng.uniform(0.7, 4.4, len(tets))
        material = ElementMaterial(E, rng.uniform(0, 0.495, len(tets)), rho)
    return TetMesh(points, tets, region, tuple(names), material)


def assert_equal(a: TetMesh, b: TetMesh):
    for name in ("points", "tets", "region"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    assert a.region_names == b.region_names
    assert (a.material is None) == (b.material is None)
    if a.material is not None and b.material is not None:
        for name in ("E", "nu", "rho"):
            np.testing.assert_array_equal(getattr(a.material, name), getattr(b.material, name))


@pytest.mark.slow
@pytest.mark.parametrize("suffix", BOTH)
@in_one_folder
@given(seed=SEEDS, size=SIZES, names=NAMES)
def test_round_trip_is_bit_exact(suffix, seed, size, names, tmp_path):
    """write, read: points, tets, order, regions, names and E, nu, rho, to the last bit."""
    path, mesh = tmp_path / f"mesh{suffix}", some_mesh(seed, size, names)
    write_mesh(path, mesh)
    assert_equal(read_mesh(path), mesh)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("suffix", RICH)
def test_further_arrays_survive(suffix, tmp_path):
    """Displacement at points, a scalar and a vector at tets come back as they were."""
    mesh = box_mesh((1, 1, 1), (2, 1, 1))
    rng = np.random.default_rng(0)
    u = rng.normal(size=mesh.points.shape)
    cells = {
        "von_mises": rng.normal(size=len(mesh.tets)),
        "g": rng.normal(size=(len(mesh.tets), 3)),
    }
    path = tmp_path / f"mesh{suffix}"
    write_mesh(path, mesh, point_data={"displacement": u}, cell_data=cells)
    data = read_data(path)
    assert set(data.point_data) == {"displacement"}
    np.testing.assert_array_equal(data.point_data["displacement"], u)
    assert set(data.cell_data) == set(cells)
    for name, values in cells.items():
        np.testing.assert_array_equal(data.cell_data[name], values)


def test_wrong_array_length_is_told_and_nothing_is_written(tmp_path):
    mesh = box_mesh((1, 1, 1), (1, 1, 1))
    for suffix in RICH:
        with pytest.raises(InputError, match="has 3 rows, wanted one a tet: 6"):
            write_mesh(tmp_path / f"m{suffix}", mesh, cell_data={"bad": np.zeros(3)})
    assert not list(tmp_path.iterdir())


def test_hostile_files_end_in_a_clear_error(tmp_path):
    """Nothing, zeros and beginnings under every suffix: one error that names the file."""
    contents = (b"", b"\x00" * 400, b"solid nothing\n", b"$MeshFormat\n2.2 0 8")
    for suffix, content in product(MESH_FORMATS, contents):
        path = tmp_path / f"bad{suffix}"
        path.write_bytes(content)
        with pytest.raises(InputError, match=rf"bad\{suffix}"):
            read_mesh(path)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", BOTH)
@settings(in_one_folder, max_examples=25)
@given(cut=st.floats(0.01, 0.97))
def test_a_file_cut_short_never_gives_another_mesh(suffix, cut, tmp_path):
    """A truncated file is an InputError, also when the cut falls between two sections."""
    mesh = box_mesh((1, 1, 1), (1, 1, 1))
    mesh = mesh.with_material(ElementMaterial.uniform(6, E=1e6, nu=0.3, rho=1e3))
    whole = tmp_path / f"whole{suffix}"
    write_mesh(whole, mesh)
    content = whole.read_bytes()
    part = tmp_path / f"part{suffix}"
    part.write_bytes(content[: int(cut * len(content))])
    with pytest.raises(InputError):
        read_mesh(part)


@pytest.mark.parametrize("section", ["$NodeData", "$ElementData"])
def test_a_msh_cut_between_two_sections_is_told(section, tmp_path):
    """Every section that is there is whole, but one that the head announces is missing."""
    mesh = box_mesh((1, 1, 1), (1, 1, 1))
    whole = tmp_path / "whole.msh"
    cells = {"s": np.ones(len(mesh.tets))}
    write_mesh(whole, mesh, point_data={"u": mesh.points}, cell_data=cells)
    content = whole.read_bytes()
    part = tmp_path / "part.msh"
    part.write_bytes(content[: content.index(section.encode())])
    with pytest.raises(InputError, match="where 2 were announced"):
        read_mesh(part)


def test_unknown_suffix_lists_the_known_ones(tmp_path):
    (tmp_path / "mesh.xyz").write_text("0 0 0")
    with pytest.raises(InputError, match=r"unknown mesh suffix '.xyz'; known are .msh"):
        read_mesh(tmp_path / "mesh.xyz")
    with pytest.raises(InputError, match=r"\.mesh cannot be written; \.msh"):
        write_mesh("mesh.mesh", box_mesh((1, 1, 1), (1, 1, 1)))


def test_missing_file_and_folder():
    with pytest.raises(InputError, match="no such file"):
        read_mesh("nowhere/mesh.msh")
    with pytest.raises(InputError, match="choose a folder that exists"):
        write_mesh("nowhere/mesh.msh", box_mesh((1, 1, 1), (1, 1, 1)))
    with pytest.raises(InputError, match="cannot write"):
        write_mesh(f"{__file__}/mesh.msh", box_mesh((1, 1, 1), (1, 1, 1)))


def test_failed_write_keeps_the_old_file(tmp_path):
    path = tmp_path / "mesh.msh"
    path.write_text("precious")
    mesh = box_mesh((1, 1, 1), (1, 1, 1))
    with pytest.raises(InputError, match="2 components"):
        write_mesh(path, mesh, cell_data={"pair": np.zeros((6, 2))})
    assert path.read_text() == "precious"
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("binary", [False, True])
def test_triangles_and_unused_points_are_counted(binary, tmp_path):
    """A file by meshio with triangles: tets and physical groups stay, the rest is counted."""
    import meshio

    mesh = box_mesh((1, 1, 1), (1, 1, 1))
    points = np.vstack([mesh.points, [[9.0, 9, 9]]])
    faces = mesh.boundary.faces
    tags = [np.full(len(faces), 7), np.array([3, 3, 3, 5, 5, 5])]
    grid = meshio.Mesh(points, [("triangle", faces), ("tetra", mesh.tets)])
    grid.cell_data.update({"gmsh:physical": tags, "gmsh:geometrical": tags})
    grid.field_data.update({"leg": np.array([3, 3]), "skin": np.array([7, 2])})
    path = tmp_path / "m.msh"
    meshio.write(path, grid, file_format="gmsh22", binary=binary)
    data = read_data(path)
    assert data.mesh.region_names == ("leg", "region 5")
    np.testing.assert_array_equal(data.mesh.region, [0, 0, 0, 1, 1, 1])
    np.testing.assert_array_equal(data.mesh.points, mesh.points)
    assert sorted(data.ignored.values()) == [1, 12]


def test_surface_only_is_refused_with_the_count(tmp_path):
    import meshio

    mesh = box_mesh((1, 1, 1), (1, 1, 1))
    path = tmp_path / "skin.vtu"
    meshio.write(path, meshio.Mesh(mesh.points, [("triangle", mesh.boundary.faces)]))
    with pytest.raises(InputError, match="holds no tets, got 12 triangle"):
        read_mesh(path)


def test_mirrored_tets_are_turned(tmp_path):
    """A foreign file of left-handed tets reads as the same body with positive volumes."""
    import meshio

    mesh = box_mesh((1, 2, 3), (1, 1, 1))
    path = tmp_path / "left.vtk"
    meshio.write(path, meshio.Mesh(mesh.points, [("tetra", mesh.tets[:, [1, 0, 2, 3]])]))
    assert read_mesh(path).volume == pytest.approx(6)


def test_medit_is_read(tmp_path):
    import meshio

    mesh = box_mesh((1, 2, 3), (1, 1, 1))
    grid = meshio.Mesh(mesh.points, [("tetra", mesh.tets)])
    grid.cell_data["medit:ref"] = [np.array([1, 1, 1, 4, 4, 4])]
    path = tmp_path / "m.mesh"
    meshio.write(path, grid)
    assert read_mesh(path).region_names == ("region 1", "region 4")
    text = path.read_text()
    path.write_text(text.replace("Vertices\n", "Vertices ").replace("Tetrahedra\n", "Tetrahedra "))
    assert path.read_text() != text
    assert read_mesh(path).volume == pytest.approx(6)


def test_series_round_trip(tmp_path):
    """Frames of a .pvd come back with their times and displacements; the files stand beside it."""
    mesh = box_mesh((1, 1, 1), (1, 1, 1))
    frames = [(0.1 * i, {"displacement": i * mesh.points}) for i in range(3)]
    files = write_pvd(tmp_path / "motion & more.pvd", mesh, iter(frames))
    assert set(files) == set(tmp_path.iterdir())
    back = list(read_pvd(files[0]))
    assert [time for time, _ in back] == [time for time, _ in frames]
    for (_, data), (_, point_data) in zip(back, frames, strict=True):
        np.testing.assert_array_equal(data.point_data["displacement"], point_data["displacement"])


def test_series_may_not_leave_its_folder(tmp_path):
    path = tmp_path / "sub" / "m.pvd"
    path.parent.mkdir()
    path.write_text('<VTKFile><DataSet timestep="0" file="../secret.vtu"/></VTKFile>')
    with pytest.raises(InputError, match="outside its folder"):
        read_pvd(path)


def test_committed_names_have_no_trace_of_temporaries(tmp_path):
    write_mesh(tmp_path / "a.vtk", box_mesh((1, 1, 1), (1, 1, 1)))
    assert [Path(p).name for p in tmp_path.iterdir()] == ["a.vtk"]
