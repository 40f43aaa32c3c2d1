"""Looks of real slots: measured when they are voxelised, kept in files, learned from."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from autophyx_tet.fem.errors import InputError
from autophyx_tet.predictors.asset import Asset, Part
from autophyx_tet.predictors.matter import FEATURES, CategoriesByAppearance, lab
from autophyx_tet.predictors.text.parts import KINDS
from autophyx_tet.research.datasets.real import load_real, save_real, voxelise
from autophyx_tet.research.learning import train

RED, PANE = [200, 20, 30, 255], [230, 240, 240, 64]


def stand(up="z"):
    """A red wooden foot and a clear pane above it, upright along ``up``."""
    parts = []
    for name, colour, low, high in (
        ("wood", RED, (0, 0, 0), (1, 1, 0.2)),
        ("glass", PANE, (0.4, 0, 0.3), (0.6, 1, 1)),
    ):
        box = trimesh.creation.box(bounds=[low, high])
        box.visual.face_colors = np.tile(colour, (len(box.faces), 1))
        if up == "y":
            box.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, [1, 0, 0]))
        parts.append(Part(name, box))
    return Asset("stand", tuple(parts), up=up)


@pytest.mark.slow
@pytest.mark.parametrize("up", ["y", "z"])
def test_voxels_see_what_is_nearest(up):
    found = voxelise(stand(up), "stand", "test")
    looks = {
        slot: dict(zip(FEATURES, row, strict=True))
        for slot, row in zip(found.slots, found.looks, strict=True)
    }
    red = lab(np.array([RED[:3]]) / 255)[0]
    assert [looks["wood"][k] for k in "Lab"] == pytest.approx(red, abs=0.5)  # eight bits
    assert looks["glass"]["opacity"] == pytest.approx(64 / 255, abs=0.002)  # eight bits
    assert looks["glass"]["lowest"] == pytest.approx(0.3, abs=1 / 60)  # one cell
    assert len(found.seen) == (found.label != 255).sum()


@pytest.mark.slow
def test_files_keep_looks(tmp_path):
    with_looks = voxelise(stand(), "stand", "test")
    without = replace(with_looks, looks=None)
    save_real(tmp_path / "real.safetensors", [without, with_looks])
    first, second = load_real(tmp_path / "real.safetensors")
    assert first.looks is None
    assert second.looks == pytest.approx(with_looks.looks, rel=1e-6)  # float32


@pytest.mark.slow
def test_training_learns_the_slots_that_it_is_given(tmp_path):
    item = voxelise(stand(), "stand", "test")
    rng = np.random.default_rng(0)
    # 1e-2: as far as two real slots of one kind are alike, so that no feature is constant
    objects = [
        replace(item, looks=item.looks + 0.01 * rng.standard_normal(item.looks.shape))
        for _ in range(20)
    ]
    save_real(tmp_path / "real.safetensors", objects)
    done = train("kinds", data=tmp_path, output=tmp_path / "run")
    assert done["slots"] == 40
    ratio = CategoriesByAppearance.load(done["files"][0]).log_ratio(item.looks)
    wood, glass = KINDS.index("wood"), KINDS.index("glass")
    best = [wood, glass] if item.slots[0] == "wood" else [glass, wood]
    assert ratio.argmax(axis=1).tolist() == best


@pytest.mark.slow
def test_data_without_looks_is_refused(tmp_path):
    item = replace(voxelise(stand(), "stand", "test"), looks=None)
    save_real(tmp_path / "real.safetensors", [item])
    with pytest.raises(InputError, match="dataset build"):
        train("kinds", data=tmp_path, output=tmp_path / "run")
