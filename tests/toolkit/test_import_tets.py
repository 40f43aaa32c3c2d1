"""Tet meshes from files: nothing changes but the unit and a boundary that was not manifold."""

import numpy as np
import pytest
from autophyx_tet.converters.mesh.meshdata import write_mesh
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.toolkit.meshing.convert import import_tets


@pytest.mark.parametrize("suffix", [".msh", ".vtu", ".vtk"])
def test_tets_and_regions_stay(tmp_path, suffix):
    """Two regions of a box in millimetres: same tets, volumes times 1e-9, closed parts."""
    box = box_mesh((10, 20, 30), (2, 2, 2))
    region = (box.centroids[:, 0] > 5).astype(np.int32)
    mesh = TetMesh(box.points, box.tets, region, region_names=("left", "right"))
    path = tmp_path / f"box{suffix}"
    write_mesh(path, mesh)
    asset, imported, report = import_tets(path, units="mm")
    assert imported.volume == pytest.approx(6000e-9)
    assert imported.region_names == mesh.region_names == asset.part_names
    assert imported.region_volumes() == pytest.approx(mesh.region_volumes() * 1e-9)
    assert all(part.mesh.is_watertight for part in asset.parts)
    assert report.ok
    assert report.doubled_points == 0


def test_boxes_that_touch_in_an_edge_are_separated(tmp_path):
    a, b = box_mesh((1, 1, 1), (1, 1, 1)), box_mesh((1, 1, 1), (1, 1, 1), lo=(1, 1, 0))
    points, node = np.unique(np.concatenate([a.points, b.points]), axis=0, return_inverse=True)
    tets = node.reshape(-1)[np.concatenate([a.tets, b.tets + 8])]
    path = tmp_path / "touching.msh"
    write_mesh(path, TetMesh.oriented(points, tets))
    _, mesh, report = import_tets(path)
    assert report.doubled_points == 2
    assert report.quality.boundary.bad_edges == 0
    assert mesh.volume == pytest.approx(2)


def test_garbage_is_an_input_error(tmp_path):
    path = tmp_path / "a.msh"
    path.write_text("$MeshFormat\n2.2 0 8\n")
    with pytest.raises(InputError):
        import_tets(path)
