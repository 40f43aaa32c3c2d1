"""Our reader of .vtu: what meshio and VTK write, every encoding, and bounds on what it unpacks."""

import base64
import zlib

import meshio
import numpy as np
import pytest
from autophyx_tet.converters.mesh.meshdata import read_mesh
from autophyx_tet.converters.mesh.vtk import load_vtu
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.mesh import box_mesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

BOX = box_mesh((1, 2, 3), (2, 1, 1))


def some_grid(seed=0):
    """Triangles before and after the tets, arrays of several types and widths on all of them."""
    rng = np.random.default_rng(seed)
    faces = BOX.boundary.faces
    grid = meshio.Mesh(
        BOX.points, [("triangle", faces[:5]), ("tetra", BOX.tets), ("triangle", faces[5:])]
    )
    grid.point_data["u"] = rng.normal(size=BOX.points.shape)
    grid.point_data["id"] = np.arange(len(BOX.points), dtype=np.int32)
    grid.cell_data["s"] = [rng.normal(size=len(block.data)) for block in grid.cells]
    grid.cell_data["g"] = [rng.random((len(b.data), 3)).astype("f4") for b in grid.cells]
    grid.field_data["notes"] = np.arange(5, dtype=np.uint8)
    return grid


def assert_same(found, expected):
    """Every array that a meshio mesh holds of its points and tets, to the last bit."""
    tets = [i for i, block in enumerate(expected.cells) if block.type == "tetra"]
    np.testing.assert_array_equal(found.points, expected.points)
    corners = np.concatenate([expected.cells[i].data for i in tets])
    np.testing.assert_array_equal(found.tets, corners)
    for name, values in (expected.point_data or {}).items():
        np.testing.assert_array_equal(found.point_data[name], values)
    for name, blocks in expected.cell_data.items():
        np.testing.assert_array_equal(
            found.cell_data[name], np.concatenate([blocks[i] for i in tets])
        )


def test_what_meshio_writes_reads_as_it_reads_it(tmp_path):
    """Text, plain, zlib and LZMA: the same mesh and arrays as by meshio's public reader."""
    ways = [
        {"binary": False},
        {"compression": None},
        *(
            {"compression": c, "header_type": h}
            for c in ("zlib", "lzma")
            for h in ("UInt32", "UInt64")
        ),
    ]
    for i, way in enumerate(ways):
        path = tmp_path / f"{i}.vtu"
        meshio.vtu.write(str(path), some_grid(), **way)
        found = load_vtu(path)
        assert_same(found, meshio.read(path))
        assert found.ignored == {"triangle": len(BOX.boundary.faces)}, way


def test_what_vtk_writes_is_read(tmp_path):
    """VTK's own writer: text, and its default, raw packed bytes behind the XML."""
    pyvista = pytest.importorskip("pyvista")
    grid = some_grid()
    ours = pyvista.from_meshio(grid)
    for binary in (True, False):
        path = tmp_path / f"{binary}.vtu"
        ours.save(path, binary=binary)
        found = load_vtu(path)
        np.testing.assert_array_equal(found.tets, BOX.tets)
        np.testing.assert_allclose(found.point_data["u"], grid.point_data["u"], rtol=1e-6)
        np.testing.assert_allclose(found.cell_data["s"], grid.cell_data["s"][1], rtol=1e-6)


ARRAYS = {
    "Points": ("Float64", 3, BOX.points),
    "connectivity": ("Int64", 1, BOX.tets.astype("i8")),
    "offsets": ("Int64", 1, np.arange(4, 4 * len(BOX.tets) + 1, 4)),
    "types": ("UInt8", 1, np.full(len(BOX.tets), 10, dtype="u1")),
}


def written(path, *, encoding, packed, order="<", pieces=1, zeros=0):
    """A .vtu written by hand: every array appended, raw or base64, of either byte order."""
    header, chunks, tags = np.dtype(f"{order}u4"), [], {}
    code = {"raw": bytes, "base64": base64.b64encode}[encoding]
    for name, (kind, width, values) in ARRAYS.items():
        data = values.astype(values.dtype.newbyteorder(order)).tobytes() + b"\0" * zeros
        words = np.array([len(data)], header).tobytes()
        body = code(words + data)
        if packed:
            block = zlib.compress(data)
            head = np.array([1, len(data), len(data), len(block)], header).tobytes()
            body = code(head) + code(block)
        tags[name] = (
            f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{width}" '
            f'format="appended" offset="{sum(map(len, chunks))}"/>'
        )
        chunks.append(body)
    cells = "".join(tags[name] for name in ("connectivity", "offsets", "types"))
    piece = (
        f'<Piece NumberOfPoints="{len(BOX.points)}" NumberOfCells="{len(BOX.tets)}">'
        f"<Points>{tags['Points']}</Points><Cells>{cells}</Cells></Piece>"
    )
    endian = {"<": "LittleEndian", ">": "BigEndian"}[order]
    compressor = ' compressor="vtkZLibDataCompressor"' if packed else ""
    path.write_bytes(
        f'<VTKFile type="UnstructuredGrid" byte_order="{endian}" header_type="UInt32"{compressor}>'
        f"<UnstructuredGrid>{piece * pieces}</UnstructuredGrid>"
        f'<AppendedData encoding="{encoding}">\n_'.encode()
        + b"".join(chunks)
        + b"\n</AppendedData></VTKFile>"
    )
    return path


def test_appended_arrays_of_every_encoding(tmp_path):
    """Raw or base64, plain or packed, of either byte order: the same points and tets."""
    for encoding in ("raw", "base64"):
        for packed in (False, True):
            for order in "<>":
                path = tmp_path / f"{encoding}{packed}{ord(order)}.vtu"
                found = load_vtu(written(path, encoding=encoding, packed=packed, order=order))
                np.testing.assert_array_equal(found.points, BOX.points, err_msg=path.name)
                np.testing.assert_array_equal(found.tets, BOX.tets, err_msg=path.name)


def test_pieces_follow_each_other(tmp_path):
    """Two pieces of a file are two bodies: the second one's tets name its own points."""
    found = load_vtu(written(tmp_path / "two.vtu", encoding="raw", packed=False, pieces=2))
    n = len(BOX.points)
    np.testing.assert_array_equal(found.points, np.concatenate([BOX.points, BOX.points]))
    np.testing.assert_array_equal(found.tets, np.concatenate([BOX.tets, BOX.tets + n]))


@pytest.mark.parametrize("compression", ["zlib", "lzma"])
def test_a_bomb_is_refused_while_it_unpacks(compression, tmp_path):
    """4 MB of zeros in a few kB: refused at 1 MB, whatever its headers say; read when allowed."""
    corners = np.vstack([np.eye(4, 3), np.zeros((175_000, 3))])
    grid = meshio.Mesh(corners, [("tetra", [[0, 1, 2, 3]])])
    path = tmp_path / "bomb.vtu"
    meshio.vtu.write(str(path), grid, compression=compression)
    assert path.stat().st_size < 30_000
    with pytest.raises(InputError, match="unpack to more than 1,048,576 bytes"):
        load_vtu(path, max_bytes=1 << 20)
    np.testing.assert_array_equal(load_vtu(path).points, grid.points)


def test_a_raw_bomb_is_refused_too(tmp_path):
    """Arrays behind the XML are bounded as those inside it."""
    path = written(tmp_path / "raw.vtu", encoding="raw", packed=True, zeros=1 << 22)
    assert path.stat().st_size < 30_000
    with pytest.raises(InputError, match="unpack to more than 1,048,576 bytes"):
        load_vtu(path, max_bytes=1 << 20)


@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(cut=st.floats(0.01, 0.97), encoding=st.sampled_from(["raw", "base64"]), packed=st.booleans())
def test_a_file_cut_short_is_an_error(cut, encoding, packed, tmp_path):
    content = written(tmp_path / "whole.vtu", encoding=encoding, packed=packed).read_bytes()
    path = tmp_path / "part.vtu"
    path.write_bytes(content[: int(cut * len(content))])
    with pytest.raises(InputError):
        read_mesh(path)


def test_what_is_wrong_with_a_file_is_said(tmp_path):
    piece = '<Piece NumberOfPoints="1" NumberOfCells="0"><Points>{}</Points></Piece>'
    point = '<DataArray type="{}" Name="p" NumberOfComponents="3" format="{}">0 0 0</DataArray>'
    grid = '<VTKFile type="UnstructuredGrid"><UnstructuredGrid>{}</UnstructuredGrid></VTKFile>'
    rows = {
        '<VTKFile type="PolyData"/>': "VTKFile of PolyData",
        grid.format(""): "no piece",
        grid.format(piece.format(point.format("String", "ascii"))): "'String' are not known",
        grid.format(piece.format(point.format("Float32", "runes"))): "'runes' are not known",
        grid.format(piece.format(point.format("Float32", "ascii") * 2).replace('s="1"', 's="2"')): (
            "1 rows, wanted 2"
        ),
    }
    for text, words in rows.items():
        path = tmp_path / "bad.vtu"
        path.write_text(text)
        with pytest.raises(InputError, match=words):
            read_mesh(path)
