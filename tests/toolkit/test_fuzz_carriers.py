"""Hostile carriers and tet meshes: splats, clouds, density grids, volume meshes.

Cut short, overwritten, or claiming what is not there: data or one clear sentence, and no hoard.
"""

import struct
import tracemalloc
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from autophyx_tet.converters.grids import DensityGrid, write_density
from autophyx_tet.converters.mesh.meshdata import write_mesh
from autophyx_tet.converters.points.gaussians import standard_columns
from autophyx_tet.converters.points.table import PointTable, write_points
from autophyx_tet.fem.errors import AutophyxError, InputError
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.toolkit.asset.formats import References, read_content
from autophyx_tet.toolkit.asset.readers import CARRIER
from autophyx_tet.toolkit.meshing.convert import SUFFIXES, import_tets
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

PEAK = 400 * 2**20  # bytes that reading one of these small files may take at most
NUMBERS = (
    b"1e308", b"-1e308", b"nan", b"inf", b"-1", b"4294967295", b"99999999999",
    b"\xff\xff\xff\x7f", b"\xff" * 4, b"\xff" * 8, b"\0" * 8, struct.pack("<f", 1e38),
    struct.pack("<f", np.nan), struct.pack("<d", 1e308), struct.pack("<q", 10**10),
)  # fmt: skip
QUIET = [HealthCheck.function_scoped_fixture, HealthCheck.too_slow]


def _splats(n=40):
    x = np.random.default_rng(0).normal(size=(n, 3))
    turns = np.tile([1.0, 0, 0, 0], (n, 1))
    logs = np.full((n, 3), np.log(0.3))
    return PointTable(standard_columns(x, logs, turns, np.full(n, 0.8), np.zeros((n, 3))))


def _mesh_text():
    """A tet in the .mesh format, which others write."""
    points = "\n".join(["0 0 0 0", "1 0 0 0", "0 1 0 0", "0 0 1 0"])
    return f"MeshVersionFormatted 2\nDimension 3\nVertices\n4\n{points}\nTetrahedra\n1\n1 2 3 4 1\n"


def _write(path):
    """Something small and valid of the path's format, or nothing where no writer is there."""
    if path.suffix == ".mesh":
        path.write_text(_mesh_text())
    elif path.suffix in SUFFIXES:
        write_mesh(path, box_mesh((1, 2, 3), (1, 1, 1)))
    elif path.suffix in (".npz", ".nvdb"):
        values = np.zeros((6, 6, 6))
        values[2:4, 2:4, 2:4] = 20
        write_density(path, DensityGrid(np.zeros(3), np.ones(3), values))
    elif path.suffix == ".splat":
        path.write_bytes(np.random.default_rng(0).random(8 * 40).astype("<f4").tobytes())
    else:
        try:
            write_points(path, _splats())
        except AutophyxError:
            path.unlink(missing_ok=True)


@cache
def _valid(suffix):
    """Bytes of a small valid file; of formats that nobody here writes, some that look like one."""
    with TemporaryDirectory() as folder:
        path = Path(folder, f"thing{suffix}")
        _write(path)
        return path.read_bytes() if path.exists() else b"\x1f\x8b" + bytes(range(256))


def _read(path):
    """Read as `convert` does, short of the engine."""
    if path.suffix in SUFFIXES:
        return import_tets(path)
    return read_content(path, path.read_bytes(), References(path.parent))


def _guarded(path):
    """Read within the bound of memory; errors of ours are an answer."""
    tracemalloc.start()
    try:
        _read(path)
    except AutophyxError as error:
        said = str(error)
    else:
        said = "read"
    finally:
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert said.strip()
    assert peak < PEAK


@pytest.mark.slow
def test_most_formats_are_here_as_valid_files(tmp_path):
    """The fuzzing starts from files that are read."""
    for suffix in (".npz", ".nvdb", ".pcd", *SUFFIXES):
        path = tmp_path / f"whole{suffix}"
        path.write_bytes(_valid(suffix))
        _read(path)


DAMAGE = st.tuples(
    st.sampled_from((*CARRIER.suffixes, *SUFFIXES)),
    st.floats(0, 1),
    st.lists(st.tuples(st.floats(0, 1), st.sampled_from(NUMBERS)), max_size=4),
)


def _damaged(suffix, keep, strikes):
    """The valid bytes, cut to at least a fifth and overwritten in places."""
    data = bytearray(_valid(suffix)[: int((0.2 + 0.8 * keep) * len(_valid(suffix)))])
    for place, number in strikes:
        at = int(place * len(data))
        data[at : at + len(number)] = number
    return bytes(data)


@pytest.mark.slow
@given(DAMAGE)
@settings(max_examples=60, deadline=None, suppress_health_check=QUIET)
def test_damaged_carriers_and_meshes(tmp_path, damage):
    path = tmp_path / f"fuzz{damage[0]}"
    path.write_bytes(_damaged(*damage))
    _guarded(path)


@pytest.mark.long
@given(DAMAGE)
@settings(max_examples=600, deadline=None, suppress_health_check=QUIET)
def test_damaged_carriers_and_meshes_at_length(tmp_path, damage):
    path = tmp_path / f"fuzz{damage[0]}"
    path.write_bytes(_damaged(*damage))
    _guarded(path)


PCD = (
    b"VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH %d\nHEIGHT 1\n"
    b"POINTS %d\n"
)
VTU = (
    b'<VTKFile type="UnstructuredGrid" version="0.1"><UnstructuredGrid>'
    b'<Piece NumberOfPoints="10000000000" NumberOfCells="1"><Points><DataArray type="Float64" '
    b'NumberOfComponents="3" format="ascii">0 0 0</DataArray></Points></Piece></UnstructuredGrid>'
    b"</VTKFile>"
)
CLAIMS = {
    "points.pcd": PCD % (10**10, 10**10) + b"DATA binary\n" + bytes(100),
    "ascii.pcd": PCD % (10**10, 10**10) + b"DATA ascii\n0 0 0\n",
    "packed.pcd": PCD % (10**10, 10**10) + b"DATA binary_compressed\n" + b"\xff" * 16,
    "points.vtk": b"# vtk DataFile Version 3.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\n"
    b"POINTS 10000000000 double\n0 0 0\n",
    "binary.vtk": b"# vtk DataFile Version 3.0\nx\nBINARY\nDATASET UNSTRUCTURED_GRID\n"
    b"POINTS 10000000000 double\n" + bytes(100),
    "points.vtu": VTU,
    "nodes.msh": b"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 10000000000 1 10000000000\n"
    b"3 1 0 10000000000\n1\n",
    "old.msh": b"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n10000000000\n1 0 0 0\n$EndNodes\n",
    "vertices.mesh": b"MeshVersionFormatted 2\nDimension 3\nVertices\n10000000000\n0 0 0 0\n",
    "index.mesh": _mesh_text().replace("1 2 3 4 1", "1 2 3 -4 1").encode(),
    "far.mesh": _mesh_text().replace("0 1 0 0", "0 1e308 nan 0").encode(),
    "count.spz": struct.pack("<IIIBBBB", 0x5053474E, 2, 2**32 - 1, 0, 12, 0, 0) + bytes(100),
    "count.ksplat": b"\0\1" + b"\xff" * 4094,
    "points.las": b"LASF" + b"\xff" * 400,
}


@pytest.mark.parametrize("name", CLAIMS)
def test_a_claim_of_a_carrier_costs_nothing(tmp_path, name):
    """A thousand bytes that announce ten billion of something are refused, for a thousand bytes."""
    path = tmp_path / name
    path.write_bytes(CLAIMS[name])
    tracemalloc.start()
    try:
        with pytest.raises(InputError):
            _read(path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < PEAK
