"""FEniCSx reads what we export for it and sags as we do: its own Python runs ``fenics_beam.py``."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from autophyx_tet.converters.npz import load_npz
from autophyx_tet.converters.programs.export import export_mesh
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.statics import solve_static
from scipy.spatial import cKDTree

from .test_external import beam, run, wooden_beam

pytestmark = pytest.mark.external


@pytest.fixture(scope="module")
def fenics_python() -> str:
    """A Python that has dolfinx: of a system's package, or ours."""
    for python in ("/usr/bin/python3", sys.executable):
        call = [python, "-c", "import dolfinx, gmsh"]
        if Path(python).exists() and not subprocess.run(call, capture_output=True).returncode:
            return python
    pytest.skip("dolfinx is not installed")


@pytest.mark.parametrize(("body", "order"), [(beam, 1), (beam, 2), (wooden_beam, 2)])
def test_fenicsx_sags_as_we_do(body, order, fenics_python, tmp_path):
    """Clamped beam of two materials, one with a grain, under gravity: every corner as ours."""
    mesh = body((10, 3, 3))
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)
    export_mesh(mesh, "fenics", tmp_path / "m")
    ours = solve_static(mesh, held, gravity_vector=(0, 0, -9.81), order=order).displacement
    script = Path(__file__).with_name("fenics_beam.py")
    run(fenics_python, str(script), str(tmp_path), "m_fenics", str(order), cwd=tmp_path)
    found = load_npz(tmp_path / "found.npz")
    apart, there = cKDTree(found["points"]).query(mesh.points)
    assert np.max(apart) < 1e-9
    theirs = found["displacement"][there]
    np.testing.assert_allclose(theirs, ours, atol=1e-6 * np.abs(ours).max())  # our residual is 1e-8
