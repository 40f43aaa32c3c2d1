"""Cases of tet files that failed once, each a kind: read right to 2 %, or refused for its reason.

The mesh is a bar of 2 x 1 x 1 m, made here in every file: Wood below x = 1, Steel above.
"""

import struct
import time

import numpy as np
import pytest
from autophyx_tet.converters import read_mesh
from autophyx_tet.converters.mesh.meshdata import read_data
from autophyx_tet.converters.mesh.vtk import write_vtk
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.mesh import TetMesh, box_mesh

BAR = box_mesh((2, 1, 1), (4, 2, 2))
STEEL = BAR.centroids[:, 0] > 1
TAGS = np.where(STEEL, 5, 17)
FACES = BAR.boundary.faces


def expect(path, volumes, *, told=()):
    """Regions with these volumes [m3], and just these words are told."""
    data = read_data(path)
    mesh = data.mesh
    found = dict(zip(mesh.region_names, mesh.region_volumes().tolist(), strict=True))
    assert found == {name: pytest.approx(v, rel=0.02) for name, v in volumes.items()}
    told = (told,) if isinstance(told, str) else told
    assert len(data.warnings) == len(told), data.warnings
    for word, pattern in zip(data.warnings, told, strict=True):
        assert pattern in word
    return data


def quadratic(mesh):
    """Points and tets of ten nodes: middles of the edges behind the corners."""
    edges = mesh.tets[:, [0, 1, 1, 2, 2, 0, 0, 3, 1, 3, 2, 3]].reshape(-1, 2)
    edges, number = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)
    points = np.concatenate([mesh.points, mesh.points[edges].mean(axis=1)])
    return points, np.column_stack([mesh.tets, number.reshape(-1, 6) + len(mesh.points)])


class Msh:
    """A Gmsh 4.1 file of two volumes, as text or bytes."""

    def __init__(self, binary):
        self.binary, self.parts = binary, [f"$MeshFormat\n4.1 {int(binary)} 8\n".encode()]
        if binary:
            self.parts.append(struct.pack("<i", 1) + b"\n")
        self.parts.append(b"$EndMeshFormat\n")

    def row(self, kinds, *values):
        if self.binary:
            code = "".join({"i": "i", "n": "Q", "d": "d"}[k] for k in kinds)
            return struct.pack(f"<{code}", *values)
        return (" ".join(f"{v:.17g}" for v in values) + "\n").encode()

    def section(self, name, rows):
        body = b"".join(rows)
        self.parts.append(f"${name}\n".encode() + body + (b"\n" if self.binary else b""))
        self.parts.append(f"$End{name}\n".encode())

    def write(self, path, *, groups, names, points=BAR.points, tets=BAR.tets, kind=4, surface=True):
        """``groups`` of the volumes 1 and 2; with the boundary's triangles, which have none."""
        listed = "".join(f'3 {tag} "{name}"\n' for tag, name in names.items())
        if names:
            text = f"$PhysicalNames\n{len(names)}\n{listed}$EndPhysicalNames\n"
            self.parts.append(text.encode())
        box, nothing = [0.0] * 6, ("n", 0)
        rows = [self.row("nnnn", 0, 0, 1, 2), self.row("i" + "d" * 6 + "nn", 9, *box, 0, 0)]
        for volume, own in enumerate(groups, 1):
            kinds = "i" + "d" * 6 + "n" + "i" * len(own) + nothing[0]
            rows.append(self.row(kinds, volume, *box, len(own), *own, 0))
        self.section("Entities", rows)
        count = len(points)
        rows = [self.row("nnnn", 1, count, 11, 10 + count), self.row("iiin", 3, 1, 0, count)]
        rows += [self.row("n", 11 + i) for i in range(count)]
        rows += [self.row("ddd", *p) for p in points]
        self.section("Nodes", rows)
        rows = []
        blocks = [(3, 1, kind, tets[~STEEL]), (3, 2, kind, tets[STEEL])]
        blocks = [(2, 9, 2, FACES), *blocks] if surface else blocks
        at = 1
        for dimension, entity, shape, cells in blocks:
            rows.append(self.row("iiin", dimension, entity, shape, len(cells)))
            for cell in cells.tolist():
                rows.append(self.row("n" * (1 + len(cell)), at, *(c + 11 for c in cell)))
                at += 1
        head = self.row("nnnn", len(blocks), at - 1, 1, at - 1)
        self.section("Elements", [head, *rows])
        path.write_bytes(b"".join(self.parts))
        return path


def test_other_versions_of_gmsh_are_named(tmp_path):
    (tmp_path / "a.msh").write_text("$MeshFormat\n4 0 8\n$EndMeshFormat\n$Entities\n")
    with pytest.raises(InputError, match=r"its format is 4; wanted .* 4\.1"):
        read_data(tmp_path / "a.msh")


@pytest.mark.parametrize("binary", [False, True])
def test_gmsh_41(tmp_path, binary):
    """Groups, whole and half; none; an element in two; order 2; the boundary without a group."""
    path = tmp_path / "a.msh"
    both = {5: "Steel", 17: "Wood"}
    for surface in (True, False):
        Msh(binary).write(path, groups=[(17,), (5,)], names=both, surface=surface)
        expect(path, {"Wood": 1, "Steel": 1})
    Msh(binary).write(path, groups=[(), (5,)], names={5: "Steel"})
    expect(path, {"Steel": 1, "volume 1": 1})
    Msh(binary).write(path, groups=[(), ()], names={})
    expect(path, {"volume 1": 1, "volume 2": 1}, told="the 2 volumes of the geometry")
    Msh(binary).write(path, groups=[(1, 17), (1, 5)], names={1: "all", **both})
    data = expect(path, {"Wood": 1, "Steel": 1}, told=("all, Wood", "all, Steel"))
    assert len(data.mesh.tets) == len(BAR.tets)
    points, tets = quadratic(BAR)
    Msh(binary).write(path, groups=[(17,), (5,)], names=both, points=points, tets=tets, kind=11)
    data = expect(path, {"Wood": 1, "Steel": 1})
    assert len(data.mesh.points) == len(BAR.points)
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(InputError, match=r"no end|cut short"):
        read_data(path)


def msh22(path, lines, names, count=None):
    """A Gmsh 2.2 text of element lines."""
    nodes = "\n".join("{} {} {} {}".format(i, *p) for i, p in enumerate(BAR.points, 1))
    listed = "\n".join(f'3 {tag} "{name}"' for tag, name in names.items())
    path.write_text(
        f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n{len(names)}\n{listed}\n"
        f"$EndPhysicalNames\n$Nodes\n{len(BAR.points)}\n{nodes}\n$EndNodes\n$Elements\n"
        f"{count or len(lines)}\n" + "\n".join(lines) + "\n$EndElements\n"
    )
    return path


def test_gmsh_22_writes_a_line_for_every_group(tmp_path):
    """A tet in two groups has two lines, and one mass."""
    tets = (BAR.tets + 1).tolist()
    groups = [(tag, tet) for tag, tet in zip(TAGS.tolist(), tets, strict=True)]
    groups += [(1, tet) for tet in tets]
    lines = [
        "{} 4 2 {} 1 {} {} {} {}".format(i, tag, *tet) for i, (tag, tet) in enumerate(groups, 1)
    ]
    path = msh22(tmp_path / "a.msh", lines, {1: "everything", 5: "Steel", 17: "Wood"})
    expect(path, {"Steel": 1, "Wood": 1}, told="several groups (everything)")


def vtk51(path, *, binary, kind=10, points=BAR.points, cells=BAR.tets, name="gmsh:physical"):
    """Legacy VTK 5.1, as PyVista and VTK 9 write it: 64-bit offsets, and remarks of arrays."""
    offsets = np.arange(len(cells) + 1) * cells.shape[1]

    def numbers(values, code):
        values = np.ravel(values)
        if binary:
            return values.astype(f">{code}").tobytes() + b"\n"
        return (" ".join(f"{v:.17g}" for v in values.tolist()) + "\n").encode()

    remarks = b"METADATA\nINFORMATION 1\nNAME L2_NORM_RANGE LOCATION vtkDataArray\nDATA 2 0 1\n\n"
    path.write_bytes(
        b"# vtk DataFile Version 5.1\nvtk output\n" + (b"BINARY" if binary else b"ASCII")
        + b"\nDATASET UNSTRUCTURED_GRID\n" + f"POINTS {len(points)} double\n".encode()
        + numbers(points, "f8") + remarks
        + f"CELLS {len(offsets)} {cells.size}\nOFFSETS vtktypeint64\n".encode()
        + numbers(offsets, "i8") + b"CONNECTIVITY vtktypeint64\n" + numbers(cells, "i8")
        + f"CELL_TYPES {len(cells)}\n".encode() + numbers(np.full(len(cells), kind), "i4")
        + f"\nCELL_DATA {len(cells)}\nFIELD FieldData 1\n{name} 1 {len(cells)} long\n".encode()
        + numbers(TAGS, "i8") + remarks
    )  # fmt: skip
    return path


@pytest.mark.parametrize("binary", [False, True])
def test_legacy_vtk_of_version_5(tmp_path, binary):
    """Tets, quadratic ones, and a region array of another name, which is told."""
    path = tmp_path / "a.vtk"
    expect(vtk51(path, binary=binary), {"region 5": 1, "region 17": 1})
    points, tets = quadratic(BAR)
    vtk51(path, binary=binary, kind=24, points=points, cells=tets, name="CellEntityIds")
    expect(path, {"region 5": 1, "region 17": 1}, told="'CellEntityIds' is taken for the regions")


def vtu(path, tets, *, points=BAR.points, cell_data="", kinds=None):
    """A VTU text of cells of any kinds."""
    kinds = [10] * len(tets) if kinds is None else kinds
    ends = np.cumsum([len(cell) for cell in tets])

    def array(name, kind, values, more=""):
        text = " ".join(map(repr, np.ravel(values).tolist()))
        return f'<DataArray type="{kind}" Name="{name}" {more} format="ascii">{text}</DataArray>'

    flat = np.concatenate([np.ravel(cell) for cell in tets])
    path.write_text(
        '<VTKFile type="UnstructuredGrid" version="0.1"><UnstructuredGrid>'
        f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{len(tets)}"><Points>'
        + array("Points", "Float64", points, 'NumberOfComponents="3"')
        + "</Points><Cells>" + array("connectivity", "Int64", flat)
        + array("offsets", "Int64", ends) + array("types", "UInt8", kinds)
        + f"</Cells><CellData>{cell_data}</CellData></Piece></UnstructuredGrid></VTKFile>"
    )  # fmt: skip
    return path


def test_hexahedra_beside_tets_are_told(tmp_path):
    box = np.array([[3.0 + x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))])
    cells = [*BAR.tets.tolist(), list(range(len(BAR.points), len(BAR.points) + 8))]
    points = np.concatenate([BAR.points, box])
    path = vtu(tmp_path / "a.vtu", cells, points=points, kinds=[10] * len(BAR.tets) + [12])
    expect(path, {"body": 2}, told="1 hexahedron are no tets")
    with pytest.raises(InputError, match="holds no tets, got 1 hexahedron"):
        read_mesh(vtu(path, cells[-1:], points=points, kinds=[12]))


def test_repeated_tets_are_dropped_or_the_file_is_refused(tmp_path):
    path = tmp_path / "a.vtu"
    expect(vtu(path, [*BAR.tets, BAR.tets[0][::-1]]), {"body": 2}, told="1 tets that repeat")
    with pytest.raises(InputError, match="1 of 2 tets repeat another"):
        read_mesh(vtu(path, [BAR.tets[0], BAR.tets[0]]))


def test_flat_tets_are_refused(tmp_path):
    tets = BAR.tets.tolist()
    for flat in ([0, 0, 1, 2], [0, 1, 2, 1]):
        with pytest.raises(InputError, match="has volume 0"):
            read_mesh(vtu(tmp_path / "a.vtu", [*tets, flat]))


@pytest.mark.slow
def test_overlapping_tets_are_told_in_linear_time(tmp_path):
    """Two grids in one place, shifted: eight times as many take at most 16 times as long."""
    seconds = []
    for count in (10, 20):
        one = box_mesh((1, 1, 1), (count,) * 3)
        tets = np.concatenate([one.tets, one.tets + len(one.points)])
        points = np.concatenate([one.points, one.points + 0.5])
        path = tmp_path / "a.vtu"
        write_vtk(path, TetMesh.oriented(points, tets))
        start = time.process_time()
        data = read_data(path)
        seconds.append(time.process_time() - start)
        (told,) = data.warnings
        assert "lie in others" in told
    assert seconds[1] < 16 * seconds[0] + 1  # the second is noise of a loaded machine


@pytest.mark.parametrize("name", ["MaterialIds", "region_id", "SubDomain", "part"])
def test_region_arrays_of_other_names(tmp_path, name):
    values = " ".join(map(str, TAGS.tolist()))
    data = f'<DataArray type="Int32" Name="{name}" format="ascii">{values}</DataArray>'
    path = vtu(tmp_path / "a.vtu", BAR.tets, cell_data=data)
    expect(path, {"region 5": 1, "region 17": 1}, told=f"'{name}' is taken for the regions")


def test_a_modulus_that_is_no_pascal_is_told(tmp_path):
    arrays = "".join(
        f'<DataArray type="Float64" Name="{name}" format="ascii">'
        f"{' '.join([repr(value)] * len(BAR.tets))}</DataArray>"
        for name, value in (("E", 210.0), ("nu", 0.3), ("rho", 7850.0))
    )
    path = vtu(tmp_path / "a.vtu", BAR.tets, cell_data=arrays)
    expect(path, {"body": 2}, told="was it MPa or GPa?")
