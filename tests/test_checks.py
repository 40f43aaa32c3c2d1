"""The checks of types and shapes that conftest.py puts on every function of ours are at work."""

import numpy as np
import pytest
from autophyx_tet.fem.mesh import TetMesh
from autophyx_tet.fem.scene.loads import spread_force
from autophyx_tet.fem.table import load_table

POINTS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
TETS, REGION = np.arange(4)[None], np.zeros(1, dtype=int)


def test_a_wrong_type_is_an_error():
    with pytest.raises(TypeError, match="violates type hint"):
        load_table(3)


def test_a_wrong_shape_is_an_error_of_functions_and_data_classes():
    mesh = TetMesh(POINTS, TETS, REGION)
    for wrong in (lambda: TetMesh(POINTS, TETS[0], REGION), lambda: spread_force(mesh, TETS, 1)):
        with pytest.raises(TypeError, match="Type-check error whilst checking the parameters"):
            wrong()
