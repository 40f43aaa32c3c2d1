"""What a conversion says: which things are likely to be hollow, by the words of their names."""

import numpy as np
import trimesh
from autophyx_tet.fem.mesh import TetMesh, box_mesh
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


def test_a_vessel_with_walls_of_its_own_is_not_told_of():
    """A pot that is modelled as one fills little of its hull; a block called pot is told."""
    block = box_mesh((1, 1, 1), (10, 10, 10))
    x, y, z = block.centroids.T
    walls = (z < 0.1) | (np.abs(x - 0.5) > 0.4) | (np.abs(y - 0.5) > 0.4)
    asset = Asset("thing", (Part("pot", trimesh.creation.box()),))
    for tets, told in ((block.tets, ("pot",)), (block.tets[walls], ())):
        mesh = TetMesh(block.points, tets, np.zeros(len(tets), np.int32), ("pot",))
        assert likely_hollow(asset, mesh, {}) == told
