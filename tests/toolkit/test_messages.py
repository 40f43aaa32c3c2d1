"""What a conversion says: which things are likely to be hollow, by the words of their names."""

import numpy as np
import trimesh
from autophyx_tet.fem.scene.mesh import TetMesh
from autophyx_tet.predictors.asset import Asset, Part
from autophyx_tet.toolkit.meshing.messages import likely_hollow


def hollow(name):
    """Whether a part of that name is likely to be a shell."""
    asset = Asset("thing", (Part(name, trimesh.creation.box()),))
    mesh = TetMesh(np.eye(4, 3), np.array([[3, 0, 1, 2]]), np.zeros(1, np.int32), (name,))
    return bool(likely_hollow(asset, mesh, {}))


def test_words_of_hollow_things_are_whole_words():
    """An object is no box, a staircase no case; plurals, camelCase and two words count."""
    rows = {
        "staircase": False,
        "two_objects": False,
        "robin": False,
        "jarrah plank": False,
        "tankard": False,
        "hullabaloo": False,
        "Box_01": True,
        "bottles": True,
        "lowerCabinet": True,
        "medicoscopia_bottle2": True,
        "lamp shade": True,
        "Lampshade": True,
        "suit-case": True,
    }
    for name, wanted in rows.items():
        assert hollow(name) is wanted, name
