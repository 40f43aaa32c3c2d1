"""Laws of tets <-> voxels: volumes, labels, exactness of the sampled material."""

import numpy as np
import pytest
from autophyx_tet.converters.mesh.meshdata import containing_tets
from autophyx_tet.converters.transfer import divided_by_voxels, sample_material, voxelize
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.predictors.field import MaterialField
from autophyx_tet.predictors.grid import Grid, PartVoxels
from hypothesis import given, settings
from hypothesis import strategies as st


def two_regions(cells=(4, 2, 2)) -> TetMesh:
    """A bar along x, its halves named left and right."""
    box = box_mesh((2, 1, 1), cells)
    region = (box.centroids[:, 0] > 1).astype(int)
    return TetMesh(box.points, box.tets, region, ("left", "right"))


def field_of(grid, logE, **labels):
    one = np.ones(grid.shape)
    return MaterialField(
        grid, np.ones(grid.shape, dtype=bool), 10.0**logE, 0.3 * one, 1000 * one, **labels
    )


@pytest.mark.parametrize("mode", ["centroid", "quadrature"])
def test_linear_field_reaches_the_centroids(mode):
    """log10 E = 6 + x is linear: one point or four give its value at the centroid of the tet."""
    mesh = two_regions()
    grid = Grid.around([[-0.5, -0.5, -0.5], [2.5, 1.5, 1.5]], cells=24)
    mesh, n_fallback, distance, unmatched = sample_material(
        mesh, field_of(grid, 6 + grid.centers()[..., 0]), mode=mode
    )
    assert mesh.material is not None
    np.testing.assert_allclose(np.log10(mesh.material.E), 6 + mesh.centroids[:, 0], rtol=1e-6)
    assert (n_fallback, distance, unmatched) == (0, 0.0, ())


def test_regions_meet_the_parts_of_their_name():
    """Soft left, stiff right, the parts in the other order than the regions: nothing mixes."""
    mesh = two_regions()
    grid = Grid.around(mesh.bounds, cells=7)  # the interface crosses a layer of voxels
    part = (grid.centers()[..., 0] < 1).astype(int)
    field = field_of(grid, np.where(part == 1, 4.0, 11.0), part=part, part_names=("right", "left"))
    done = sample_material(mesh, field).mesh.material
    assert done is not None
    np.testing.assert_allclose(done.E, np.where(mesh.region == 0, 1e4, 1e11), rtol=1e-12)


def test_a_region_without_a_part_is_told_and_takes_the_nearest():
    mesh = two_regions()
    grid = Grid.around(mesh.bounds, cells=8)
    part = (grid.centers()[..., 0] > 1).astype(int)
    field = field_of(grid, np.where(part == 1, 4.0, 11.0), part=part, part_names=("left", "top"))
    result = sample_material(mesh, field)
    assert result.unmatched == ("right",)
    assert result.mesh.material is not None
    assert set(np.round(np.log10(result.mesh.material.E))) == {4, 11}


@settings(max_examples=20, deadline=None)
@given(st.tuples(*[st.floats(0.2, 3)] * 3), st.integers(4, 20))
def test_a_box_fills_its_voxels(size, cells):
    """Every cell whose centre is in the box is inside, every other outside."""
    mesh = box_mesh(size, (2, 1, 3), lo=(1, -2, 0.5))
    voxels = voxelize(mesh, cells=cells)
    c = voxels.grid.centers()
    low, high = mesh.bounds
    np.testing.assert_array_equal(voxels.occupied, ((c > low) & (c < high)).all(axis=-1))


def test_voxel_volume_converges_to_the_volume():
    """Cells x h^3 -> V at first order or better, for a rotated bar: 3 % at 48 cells."""
    box = two_regions()
    angle = 0.4
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0],
                     [0, 0, 1]])  # fmt: skip
    mesh = TetMesh(box.points @ turn.T, box.tets, box.region, box.region_names)
    voxels = voxelize(mesh, cells=48)
    count = np.bincount(voxels.part[voxels.occupied])
    np.testing.assert_allclose(count * voxels.grid.h**3, mesh.region_volumes(), rtol=0.03)


def test_containing_tet_agrees_with_its_region_and_volume():
    """The owner of a cell contains its centre: barycentric coordinates in [0, 1] sum to 1."""
    mesh = two_regions((3, 2, 2))
    grid = Grid.around(mesh.bounds, cells=16)
    owner = containing_tets(mesh, grid.centers())
    inside = owner >= 0
    corners = mesh.points[mesh.tets[owner[inside]]]
    system = np.concatenate([corners.transpose(0, 2, 1), np.ones((len(corners), 1, 4))], axis=1)
    point = np.concatenate([grid.centers()[inside], np.ones((len(corners), 1))], axis=1)
    bary = np.linalg.solve(system, point[..., None])
    assert bary.min() > -1e-6
    assert bary.max() < 1 + 1e-6


def test_every_region_gets_a_voxel():
    """Slivers thinner than a voxel, several in one place: each region is seen all the same."""
    box = box_mesh((1, 1, 1), (1, 1, 1))
    thin = [box_mesh((1e-3, 1e-3, 1e-3), (1, 1, 1), lo=(0.5, 0.5, 0.5 + z)) for z in (0, 2e-3)]
    meshes = [box, *thin]
    offset = np.cumsum([0, *(len(m.points) for m in meshes)])
    mesh = TetMesh(
        np.concatenate([m.points for m in meshes]),
        np.concatenate([m.tets + o for m, o in zip(meshes, offset, strict=False)]),
        np.repeat([0, 1, 2], 6),
        ("box", "screw", "nail"),
    )
    voxels = voxelize(mesh, cells=8)
    assert (np.bincount(voxels.part[voxels.occupied]) == [8**3 - 2, 1, 1]).all()
    assert voxels.part_names == mesh.region_names


def test_a_piece_that_is_nearest_to_no_tet_has_one_all_the_same():
    """One cell of a corner beside six tets of a box: every region that is named holds a tet."""
    box = box_mesh((1, 1, 1), (1, 1, 1))
    voxels = voxelize(box, cells=12)
    part = voxels.part.copy()
    part[tuple(np.argwhere(part == 0)[0])] = 1
    pieces = PartVoxels(voxels.grid, part, ("box", "corner"))
    divided = divided_by_voxels(box, pieces, [0, 0])
    assert np.bincount(divided.region).tolist() == [len(box.tets) - 1, 1]
