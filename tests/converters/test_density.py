"""Density grids: places of cells, round trips, foreign layouts written from their definitions."""

import gzip
import subprocess
import sys
from itertools import product

import numpy as np
import pytest
from autophyx_tet.converters.grids import DensityGrid, read_density, write_density
from autophyx_tet.converters.registry import GRID_FORMATS
from autophyx_tet.fem.errors import InputError
from autophyx_tet.predictors.grid import Grid
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st


def some_grid(seed, shape, fields=()):
    rng = np.random.default_rng(seed)
    lo = rng.normal(size=3)
    density = rng.random(shape).astype("f4") + 0.5
    extra = {name: rng.random(shape).astype("f4") for name in fields}
    return DensityGrid(lo, lo + rng.uniform(0.5, 2, 3), density, 0.7, extra)


@settings(
    max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(st.integers(0, 999), st.tuples(*[st.integers(1, 6)] * 3))
def test_own_archive_is_bit_exact(tmp_path, seed, shape):
    grid = some_grid(seed, shape, ("E", "nu", "rho"))
    write_density(tmp_path / "g.npz", grid)
    back = read_density(tmp_path / "g.npz")
    for name in ("lo", "hi", "density"):
        np.testing.assert_array_equal(getattr(back, name), getattr(grid, name))
    assert back.threshold == grid.threshold
    assert list(back.fields) == ["E", "nu", "rho"]
    np.testing.assert_array_equal(back.fields["E"], grid.fields["E"])


def test_nanovdb_keeps_values_and_places(tmp_path):
    """One file an array; values to the bit, origin and spacing to float32."""
    h = 0.25
    lo = np.array([1.0, -2.0, 0.5])
    density = np.arange(1, 2 * 9 * 5 + 1, dtype="f4").reshape(2, 9, 5)
    grid = DensityGrid(lo, lo + h * np.array([2, 9, 5]), density, fields={"E": density * 1e6})
    files = write_density(tmp_path / "g.nvdb", grid)
    assert [f.name for f in files] == ["g.nvdb", "g.E.nvdb"]
    for file, expected in zip(files, (density, density * 1e6), strict=True):
        back = read_density(file)
        there = back.density > 0  # the format fills up blocks of 8 cells with its background, 0
        np.testing.assert_array_equal(back.density[there], expected.ravel())
        cells = back.centers().reshape(*back.density.shape, 3)[there]
        np.testing.assert_allclose(cells, grid.centers(), atol=1e-6)


@pytest.mark.parametrize("suffix", [".pt", ".safetensors"])
def test_nerfacc_state_is_read_at_its_finest_level(suffix, tmp_path):
    """Flat occs of two levels, box of the first: occs[0] in the order x, y, z."""
    import torch
    from safetensors.torch import save_file

    shape = (4, 3, 2)
    occs = torch.arange(48.0)
    state = {
        "estimator.occs": occs,
        "estimator.aabbs": torch.tensor([[0.0, 0, 0, 1, 1, 1], [-1, -1, -1, 2, 2, 2]]),
        "estimator.resolution": torch.tensor(shape, dtype=torch.int32),
    }
    path = tmp_path / f"s{suffix}"
    torch.save(state, path) if suffix == ".pt" else save_file(state, path)
    grid = read_density(path)
    np.testing.assert_array_equal(grid.density, occs[:24].numpy().reshape(shape))
    np.testing.assert_array_equal([grid.lo, grid.hi], [[0, 0, 0], [1, 1, 1]])


def test_a_pickle_in_a_checkpoint_never_runs(tmp_path):
    """A checkpoint with an object in it is refused, not executed."""
    import torch

    path = tmp_path / "evil.pt"
    torch.save({"occs": Grid(np.zeros(3), 1.0, (1, 1, 1))}, path)
    with pytest.raises(InputError, match=r"evil\.pt"):
        read_density(path)


@pytest.mark.parametrize("packed", [False, True])
def test_instant_ngp_snapshot(packed, tmp_path):
    """Morton order, x lowest; axes y, z, x of the dataset; unit cube = scale x + offset."""
    msgpack = pytest.importorskip("msgpack")
    n = 4
    scale, offset = 0.5, np.array([0.5, 0.25, 0.0])
    marked = np.array([0.9, -0.1, 0.7])  # a point of the dataset, in its own axes
    cube = (marked * scale + offset)[[1, 2, 0]]  # its place in the snapshot's unit cube
    cell = np.floor(cube * n).astype(int)
    place = sum((int(cell[a]) >> b & 1) << (3 * b + a) for a in range(3) for b in range(2))
    raw = np.zeros(2 * n**3, dtype="<f2")  # two cascades
    raw[place] = 1.0
    dataset = {"scale": scale, "offset": offset.tolist()}
    content = msgpack.packb(
        {
            "snapshot": {
                "density_grid_size": n,
                "density_grid_binary": raw.tobytes(),
                "nerf": {"dataset": dataset},
            }
        }
    )
    path = tmp_path / ("s.ingp" if packed else "s.msgpack")
    path.write_bytes(gzip.compress(content) if packed else content)
    grid = read_density(path)
    full = grid.density.ravel() > grid.threshold
    assert full.sum() == 1
    np.testing.assert_array_less(np.abs(grid.centers()[full][0] - marked), grid.spacing / 2 + 1e-9)
    # 1 = sigma sqrt(3)/1024 per unit of the cube, which is 1 / scale long in the dataset
    np.testing.assert_allclose(grid.density.max(), 1024 / 3**0.5 * scale, rtol=1e-6)


def test_linear_density_is_reproduced_on_cubes():
    """sigma = 1 + a.x sampled on a grid of cubes inside the box is 1 + a.x."""
    slope = np.array([0.3, -0.2, 0.1])
    shape = (8, 5, 6)
    box = DensityGrid(np.zeros(3), np.array([1.0, 2.0, 3.0]), np.ones(shape, dtype="f4"))
    values = (1 + box.centers() @ slope).reshape(shape)
    grid = Grid(np.array([0.3, 0.5, 0.6]), 0.1, (4, 8, 12))
    found = DensityGrid(box.lo, box.hi, values).on_grid(grid)
    np.testing.assert_allclose(found, 1 + grid.centers() @ slope, rtol=1e-6)


def test_box_of_the_occupied_cells():
    density = np.zeros((4, 4, 4))
    density[1:3, 2, 0] = 5.0
    grid = DensityGrid(np.zeros(3), np.full(3, 2.0), density, threshold=1.0)
    np.testing.assert_allclose(grid.occupied_box(), [[0.5, 1, 0], [1.5, 1.5, 0.5]])
    with pytest.raises(InputError, match="no cell has a density above 9"):
        DensityGrid(grid.lo, grid.hi, density, threshold=9.0).occupied_box()


def test_hostile_density_files(tmp_path):
    """Nothing, zeros and noise under every suffix: one error that names the file."""
    for suffix, content in product(GRID_FORMATS, (b"", b"\x00" * 300, b"\x93nonsense\xff" * 20)):
        path = tmp_path / f"bad{suffix}"
        path.write_bytes(content)
        with pytest.raises(InputError, match=rf"bad\{suffix}"):
            read_density(path)


@pytest.mark.slow
def test_volumes_start_without_a_banner(tmp_path):
    """The standard output belongs to --json: writing and reading NanoVDB prints nothing."""
    script = (
        "import sys, numpy as np\n"
        "from autophyx_tet.converters.grids import DensityGrid\n"
        "from autophyx_tet.converters.grids import read_density, write_density\n"
        "grid = DensityGrid(np.zeros(3), np.ones(3), np.ones((2, 2, 2), 'f4'), 0.5, {})\n"
        "write_density(sys.argv[1], grid)\n"
        "read_density(sys.argv[1])\n"
    )
    command = [sys.executable, "-c", script, str(tmp_path / "g.nvdb")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
