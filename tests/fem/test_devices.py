"""The same answers on every device of this machine; what starting one costs."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from autophyx_tet.fem.device import MAPPED, checked_device, start_warp
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.linalg import solver
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.dynamics import Dynamics
from autophyx_tet.fem.solve.statics import solve_static

DEVICES = ["cpu", *(["cuda"] if start_warp().is_cuda_available() else [])]


@pytest.fixture
def beam():
    """Cantilever of two materials, 11,520 tets: size S of ``benchmarks/statics.py``."""
    mesh = box_mesh((1, 0.2, 0.2), (40, 6, 8))
    high = mesh.centroids[:, 2] > 0.1
    E, nu, rho = (np.where(high, a, b) for a, b in ((1e7, 1e6), (0.4, 0.3), (1200.0, 1000.0)))
    return mesh.with_material(ElementMaterial(E, nu, rho))


@pytest.mark.slow
@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize(("order", "tip"), [(1, -0.123679197), (2, -0.148275040)])
def test_tip_of_the_bench_problem(beam, device, order, tip):
    """Mean u_z of the end: what dolfinx, pyamg, scikit-fem, CalculiX and Pardiso answer."""
    held = Supports.clamp(len(beam.points), beam.points[:, 0] == 0)
    result = solve_static(beam, held, gravity_vector=(0, 0, -9.81), order=order, device=device)
    assert result.displacement[beam.points[:, 0] == 1, 2].mean() == pytest.approx(tip, rel=1e-7)
    assert result.residual <= 1e-8


@pytest.mark.slow
@pytest.mark.parametrize("device", DEVICES)
def test_what_is_kept_of_a_mesh_serves_its_other_bodies(beam, device):
    """Other moduli, a stronger contrast, another support: each the answer of its first time."""
    ends = [np.flatnonzero(beam.points[:, 0] == x) for x in (0, 1)]
    soft = beam.centroids[:, 0] > 0.5
    bodies = []
    for share, end in ((1.0, 0), (3.0, 0), (1e-6, 0), (3.0, 1), (1.0, 0)):
        taken = replace(beam.material, E=beam.material.E * np.where(soft, share, 1.0))
        held = Supports.clamp(len(beam.points), ends[end])
        bodies.append((beam.with_material(taken), held))
    options = {"gravity_vector": (0, 0, -9.81), "order": 1, "device": device}
    in_a_row = [solve_static(*body, **options).displacement for body in bodies]
    for body, known in zip(bodies, in_a_row, strict=True):
        solver._RECENT.clear()
        alone = solve_static(*body, **options).displacement
        np.testing.assert_allclose(known, alone, atol=1e-6 * np.abs(alone).max())


@pytest.mark.slow
@pytest.mark.parametrize("device", DEVICES)
def test_steps_are_those_of_the_cpu(beam, device):
    """Three implicit steps to a tight residual: the same motion."""
    held = Supports.clamp(len(beam.points), beam.points[:, 0] == 0)
    options = {"supports": held, "gravity_vector": (0, 0, -9.81), "tolerance": 1e-8}
    there, here = (Dynamics(beam, device=d, **options) for d in (device, "cpu"))
    for a, b in zip(there.run(0.01, 3), here.run(0.01, 3), strict=True):
        assert a.u == pytest.approx(b.u, abs=1e-9)


def test_an_unknown_device_is_named():
    """A device that is not here: which ones are, and what to do."""
    with pytest.raises(InputError, match="no device 'cuda:99' here"):
        checked_device("cuda:99")


@pytest.mark.slow
@pytest.mark.skipif(not MAPPED.exists(), reason="only Linux says what is resident")
def test_start_up_leaves_little_of_the_libraries_resident():
    """Of some 110 MB that the start of warp reads, what no kernel needs is given back."""
    code = """
import re
from pathlib import Path
from autophyx_tet.fem.device import start_warp
wp = start_warp()
mapped = re.split(r"\\n(?=[0-9a-f]+-[0-9a-f]+ )", Path("/proc/self/smaps").read_text())
mine = [m for m in mapped if "warp" in m.partition("\\n")[0] and ".so" in m.partition("\\n")[0]]
print(sum(int(re.search(r"\\nRss: +(\\d+)", m)[1]) for m in mine))
assert wp.zeros(3, device="cpu").numpy().sum() == 0  # it still runs
"""
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert int(done.stdout) < 40_000  # kB: written data, a fifth of it, and constants
