"""The verb `segment`: its regions have the numbers that `assign` gives, and are parts for `run`."""

import autophyx_tet as apx
import numpy as np
import pytest
from autophyx_tet.converters.transfer import voxelize
from autophyx_tet.toolkit.segment import CELLS, cut_voxels
from scipy.spatial import KDTree


@pytest.fixture(scope="module")
def bonsai(tmp_path_factory):
    """A small asset, and what `segment` makes of it."""
    folder = tmp_path_factory.mktemp("bonsai")
    asset = apx.load_asset(apx.write_bonsai(folder / "bonsai.glb"))
    return asset, apx.segment(asset, output=folder / "parts.glb")


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
