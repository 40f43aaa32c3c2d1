"""Point clouds: round trips over the table of formats, foreign encodings, hostile headers."""

import struct

import numpy as np
import pytest
from autophyx_tet.converters.points.ply import Ply, columns_table, read_ply, write_ply
from autophyx_tet.converters.points.table import PointTable, read_points, write_points
from autophyx_tet.converters.registry import POINT_FORMATS, written
from autophyx_tet.fem.errors import InputError
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

ROOMY = [s for s in written(POINT_FORMATS) if s not in (".las", ".laz")]
NAMES = st.lists(
    st.text("abcdefghijklmnopqrstuvwxyz_0123456789", min_size=1, max_size=12).filter(
        lambda name: name not in ("x", "y", "z", "points", "comments")
    ),
    max_size=4,
    unique=True,
)
TYPES = ["f4", "f8", "i1", "u1", "i2", "u2", "i4", "u4"]
in_one_folder = settings(
    max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def some_columns(seed, n, names):
    rng = np.random.default_rng(seed)
    real = rng.choice(["f4", "f8"])
    columns = {axis: rng.normal(size=n).astype(real) for axis in "xyz"}
    for name in names:
        columns[name] = rng.integers(0, 100, n).astype(rng.choice(TYPES))
        if columns[name].dtype.kind == "f":
            columns[name] = (rng.normal(size=n) * 10.0 ** rng.integers(-20, 20)).astype(
                columns[name].dtype
            )
    return columns


@pytest.mark.parametrize("suffix", ROOMY)
@in_one_folder
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 30), names=NAMES)
def test_round_trip_is_bit_exact(suffix, seed, n, names, tmp_path):
    """Every column, its type, its order and the remarks come back as they were."""
    path = tmp_path / f"cloud{suffix}"
    columns = some_columns(seed, n, names)
    write_points(path, PointTable(columns, ("made by a test", "second remark")))
    back = read_points(path)
    assert list(back.columns) == list(columns)
    assert back.comments == ("made by a test", "second remark")
    for name, values in columns.items():
        assert back.columns[name].dtype == values.dtype
        np.testing.assert_array_equal(back.columns[name], values)


@pytest.mark.parametrize("suffix", ROOMY)
@settings(in_one_folder, max_examples=20)
@given(cut=st.floats(0, 0.98))
def test_cut_files_are_refused(suffix, cut, tmp_path):
    path = tmp_path / f"cloud{suffix}"
    write_points(path, PointTable(some_columns(0, 20, ["label"])))
    content = path.read_bytes()
    path.write_bytes(content[: int(cut * len(content))])
    with pytest.raises(InputError):
        read_points(path)


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_faces_and_other_elements_of_a_ply_survive(encoding, tmp_path):
    """Adding a column leaves encoding, faces and a scalar element before the vertices alone."""
    vertex = columns_table(some_columns(1, 4, ["quality"]))
    camera = columns_table({"focal": np.array([35.0])})
    faces = b"3 0 1 2\n3 0 2 3\n" if encoding == "ascii" else b"\x03\x01\x02\x03\x00\xff"
    rest = (("element face 2", "property list uchar int vertex_indices"), faces)
    path = tmp_path / "mesh.ply"
    write_ply(path, Ply({"camera": camera, "vertex": vertex}, ("hello",), encoding, rest))
    table = read_points(path)
    write_points(path, table.with_columns({"E": np.full(4, 1e6)}))
    back = read_ply(path)
    assert (back.encoding, back.comments, back.rest) == (encoding, ("hello",), rest)
    np.testing.assert_array_equal(back.elements["camera"], camera)
    assert back.vertex.dtype.names == (*(vertex.dtype.names or ()), "E")
    for name in vertex.dtype.names or ():
        np.testing.assert_array_equal(back.vertex[name], vertex[name])


def test_an_existing_column_keeps_its_place(tmp_path):
    table = PointTable(some_columns(2, 5, ["E", "label"]))
    again = table.with_columns({"E": np.ones(5), "nu": np.zeros(5)})
    assert list(again.columns) == ["x", "y", "z", "E", "label", "nu"]


@pytest.mark.parametrize("ascii_", [False, True])
@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.slow
def test_pcd_of_another_writer(ascii_, compressed, tmp_path):
    """PCD by Open3D, text, binary or LZF-packed, reads as it does there."""
    o3d = _open3d()
    rng = np.random.default_rng(0)
    n = 2000
    cloud = o3d.t.geometry.PointCloud(np.round(rng.normal(size=(n, 3)), 1).astype("f4"))
    cloud.point["label"] = np.repeat(np.arange(n // 100), 100).astype("i4")[:, None]
    path = tmp_path / "other.pcd"
    o3d.t.io.write_point_cloud(str(path), cloud, write_ascii=ascii_, compressed=compressed)
    back = read_points(path)
    np.testing.assert_allclose(back.positions, cloud.point.positions.numpy(), atol=1e-6)
    np.testing.assert_array_equal(back.columns["label"], cloud.point["label"].numpy()[:, 0])


def _open3d():
    """Open3D, its libusb provided by the wheel of that name."""
    import ctypes

    import libusb_package

    ctypes.CDLL(str(libusb_package.get_library_path()), mode=ctypes.RTLD_GLOBAL)
    import open3d

    return open3d


def test_las_keeps_its_dimensions_and_takes_new_ones(tmp_path):
    """Scaled coordinates, intensity and an extra dimension are untouched; E comes as one more."""
    laspy = pytest.importorskip("laspy")
    rng = np.random.default_rng(0)
    header = laspy.LasHeader(point_format=3, version="1.2")
    header.scales = np.full(3, 0.001)
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = rng.uniform(0, 10, (3, 50))
    cloud.intensity = rng.integers(0, 1000, 50)
    cloud.add_extra_dim(laspy.ExtraBytesParams("wetness", "f4"))
    cloud["wetness"] = rng.normal(size=50)
    cloud.write(str(tmp_path / "a.las"))
    E = 10 ** rng.uniform(3, 12, 50)
    table = read_points(tmp_path / "a.las")
    write_points(tmp_path / "b.las", table.with_columns({"E": E}))
    back = read_points(tmp_path / "b.las")
    assert list(back.columns) == [*table.columns, "E"]
    np.testing.assert_array_equal(back.columns["E"], E)
    for name in table.columns:
        np.testing.assert_array_equal(back.columns[name], table.columns[name])


def test_hostile_headers_allocate_nothing(tmp_path):
    """Billions of announced points in a few bytes: a clear error at once."""
    head = "ply\nformat binary_little_endian 1.0\nelement vertex 999999999999\n"
    (tmp_path / "a.ply").write_text(head + "property float x\nend_header\n")
    with pytest.raises(InputError, match="999999999999 rows of 4 bytes were announced"):
        read_points(tmp_path / "a.ply")
    head = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 99999999999\nDATA binary_compressed\n"
    (tmp_path / "a.pcd").write_bytes(head.encode() + struct.pack("<II", 4, 2**32 - 1) + b"abcd")
    with pytest.raises(InputError, match="packed and 4294967295 plain bytes announced"):
        read_points(tmp_path / "a.pcd")


def test_unknown_and_roomless_suffixes_are_told():
    table = PointTable(some_columns(0, 3, []))
    with pytest.raises(InputError, match=r"unknown point suffix '.doc'; known are .ply"):
        read_points("a.doc")
    with pytest.raises(InputError, match="32-byte splats has no room for further columns"):
        write_points("a.splat", table)


def test_columns_of_different_length_are_refused():
    with pytest.raises(InputError, match="columns must be of one length"):
        PointTable({"x": np.zeros(3), "y": np.zeros(3), "z": np.zeros(2)})
    with pytest.raises(InputError, match="points need columns x, y, z"):
        PointTable({"x": np.zeros(3)})
