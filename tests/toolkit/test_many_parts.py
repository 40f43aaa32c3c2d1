"""Assemblies: what words cost grows with the parts and not with their pairs."""

import time

import autophyx_tet as apx
import numpy as np
import pytest
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.toolkit.options import AssignOptions

KINDS = "bolt nut washer plate bracket rod cap seal spring gear shaft cover lever pin hinge".split()
TEXT = "the bolts are steel, the seals are rubber, the covers are stiffer than the seals"


def assembly(count: int) -> TetMesh:
    """Boxes in a block, each a part with a name of its own."""
    side = int(np.ceil(count ** (1 / 3)))
    box = box_mesh((0.08,) * 3, (1,) * 3)
    at = 0.1 * np.stack(np.unravel_index(np.arange(count), (side,) * 3), axis=1)
    return TetMesh(
        (box.points + at[:, None]).reshape(-1, 3),
        (box.tets + len(box.points) * np.arange(count)[:, None, None]).reshape(-1, 4),
        region=np.repeat(np.arange(count), len(box.tets)),
        region_names=tuple(f"{KINDS[i % len(KINDS)]}_{i:04d}" for i in range(count)),
    )


def seconds(count: int) -> float:
    """CPU seconds of ``assign`` on so many parts."""
    mesh, began = assembly(count), time.process_time()
    found = apx.assign(mesh, TEXT, options=AssignOptions(predictor="retrieval"))
    assert len(found.choices) == count
    return time.process_time() - began


@pytest.mark.slow
def test_four_times_the_parts_take_four_times_as_long():
    """Four times the parts take at most six times as long."""
    seconds(10)  # what is loaded once
    few, many = seconds(250), seconds(1000)
    assert many < 6 * few
