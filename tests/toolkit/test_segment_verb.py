"""The verb `segment`: its regions have the numbers that `assign` gives, and are parts for `run`."""

import autophyx_tet as apx
import numpy as np
import pytest
import trimesh
from autophyx_tet.converters.transfer import voxelize
from autophyx_tet.predictors.regions.division import region_numbers
from autophyx_tet.toolkit.segment import CELLS, cut_voxels
from scipy.spatial import KDTree


@pytest.fixture(scope="module")
def bonsai(tmp_path_factory):
    """A small asset, and what `segment` makes of it."""
    folder = tmp_path_factory.mktemp("bonsai")
    asset = apx.load_asset(apx.write_bonsai(folder / "bonsai.glb"))
    return asset, apx.segment(asset, output=folder / "parts.glb")


@pytest.mark.slow
def test_a_region_has_one_number_in_segment_and_in_assign(bonsai):
    """Of the outer cells that `assign` numbers k most are nearest to the part "region k"."""
    asset, made = bonsai
    body = apx.convert(asset).mesh
    voxels = voxelize(body, cells=CELLS)
    region = cut_voxels(asset, voxels, up=asset.up).region
    # the parts stand with y up, as glTF has it
    corners = [part.mesh.triangles_center for part in made.parts.parts]
    names = [int(part.name.split()[1]) for part in made.parts.parts]
    number = np.repeat(names, [*map(len, corners)])
    x, y, z = voxels.grid.to_world(np.argwhere(voxels.occupied)).T
    centres = np.stack([x, y, z] if asset.up == "y" else [x, z, -y], axis=1)
    distance, nearest = KDTree(np.concatenate(corners)).query(centres)
    outer = distance < voxels.grid.h  # what lies deep inside is nearest to several
    count = np.bincount(region[outer])
    large = np.flatnonzero(count > 0.02 * count.sum())
    assert len(large) >= 3
    for k in large:
        assert np.bincount(number[nearest[outer & (region == k)]]).argmax() == k + 1


def test_assign_gives_a_numbered_region_its_text(bonsai):
    """`--region` 2 is the "region 2" that `segment` wrote: as large, and of its matter."""
    asset, made = bonsai
    body = apx.assign(apx.convert(asset).mesh, "all of it is oak", asset=asset, region=("2=steel",))
    names = list(body.mesh.region_names)
    assert next(c for c in body.choices if c.part == "region 2").row.category == "metal"
    volumes = body.mesh.region_volumes()
    number = [part.name for part in made.parts.parts].index("region 2")
    assert volumes[names.index("region 2")] / volumes.sum() == pytest.approx(
        made.fractions[number], rel=0.35
    )  # cells of 1/64 on both sides, and solids that overlap


COLOURS = {
    "pot": (30, 80, 100), "soil": (60, 40, 35), "trunk": (110, 75, 50), "foliage": (70, 130, 60)
}  # fmt: skip


@pytest.fixture(scope="module")
def scan(tmp_path_factory):
    """A bonsai in one mesh without names or axis, with y up, and what `segment` makes of it."""
    folder = tmp_path_factory.mktemp("scan")
    pieces = []
    for name, surface in apx.bonsai().geometry.items():
        plain = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
        plain.visual.face_colors = (*COLOURS[name], 255)
        pieces.append(plain)
    trimesh.util.concatenate(pieces).export(folder / "scan.ply")
    known = {"up": "y", "units": "m"}
    made = apx.segment(folder / "scan.ply", output=folder / "parts.glb", **known)
    return apx.load_asset(folder / "scan.ply", **known), apx.load_asset(made.files[0])


@pytest.mark.slow
def test_a_sentence_makes_the_same_body_of_the_regions_as_of_the_thing(scan):
    """Volume of each matter: the file of regions is the thing, cut; cuts are no surfaces."""
    text, found = "ceramic pot, soil, oak trunk, soft leaves", []
    for asset in scan:
        solid = apx.convert(asset, mesher="stuffing", edge_length_rel=0.02, no_cache=True)
        assert not any("holes were closed" in warning for warning in solid.warnings)
        body = apx.assign(solid.mesh, text, asset=solid.asset)
        volumes, of = body.mesh.region_volumes(), {}
        for choice, volume in zip(body.choices, volumes, strict=True):
            said = choice.binding.clause
            of[said] = of.get(said, 0) + volume / volumes.sum()
        found.append(of)
    thing, regions = found
    assert thing.keys() == regions.keys()
    # cells of 1/64 on both sides: a fifteenth of the volume is within half a cell of a cut
    assert regions == pytest.approx(thing, abs=0.03)


@pytest.mark.slow
def test_a_region_of_the_file_is_told_by_number_and_by_words(scan):
    """`--region 1=steel` is "region 1 is steel"; the other clauses go to the other regions."""
    solid = apx.convert(scan[1], mesher="stuffing", edge_length_rel=0.03, no_cache=True)
    rest = "soil, oak trunk, soft leaves"
    said = apx.assign(solid.mesh, f"region 1 is steel, {rest}", asset=solid.asset)
    told = apx.assign(solid.mesh, rest, asset=solid.asset, region=("1=steel",))
    for body in (said, told):
        category = {choice.part: choice.row.category for choice in body.choices}
        assert [part for part, one in category.items() if one == "metal"] == ["region 1"]
        assert len({*category.values()}) >= 3
    number, grid = told.regions.number, told.field.grid
    for row in told.region_rows():  # what is printed of a region is a place for `--at`
        at = tuple(np.rint(grid.to_index(np.array(row["middle"]))).astype(int))
        assert number[at] == row["number"]


@pytest.mark.slow
def test_regions_that_are_cut_again_keep_their_numbers(scan):
    """Cutting is idempotent: names and triangles of the parts are those of the file."""
    again = apx.segment(scan[1])
    assert again.parts.part_names == tuple(
        sorted(scan[1].part_names, key=lambda name: int(name.split()[1]))
    )
    faces = {part.name: len(part.mesh.faces) for part in scan[1].parts}
    assert {part.name: len(part.mesh.faces) for part in again.parts.parts} == faces


@pytest.mark.parametrize(
    ("names", "numbers"),
    [
        (["region 2", "region 10"], [2, 10]),
        (["region 1"], [1]),
        (["region 1", "pot"], None),
        (["region 0"], None),
        (["region 1", "region 01"], None),
    ],
)
def test_parts_are_regions_where_all_are_called_so(names, numbers):
    assert region_numbers(names) == numbers
