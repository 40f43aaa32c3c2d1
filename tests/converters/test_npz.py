"""Our archive: fields and meshes come back whole; pickles, bombs and strangers are refused."""

import numpy as np
import pytest
from autophyx_tet.converters.npz import load, load_npz, save, save_npz
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.predictors.field import MaterialField, Ranges
from autophyx_tet.predictors.grid import Grid
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

ARRAYS = ("occupied", "E", "nu", "rho", "part", "material")


def some_field(seed, shape, h, names) -> MaterialField:
    """A random field; every other one with parts, materials and ranges."""
    rng = np.random.default_rng(seed)
    occupied = rng.random(shape) < 0.5
    occupied[0, 0, 0] = True
    E, rho = 10 ** rng.uniform(3, 12, shape), 10 ** rng.uniform(0.7, 4.4, shape)
    nu = np.where(occupied, rng.uniform(0, 0.495, shape), np.nan)
    labelled = bool(seed % 2)
    pair = np.stack([E, 2 * E], axis=-1)
    return MaterialField(
        Grid(rng.normal(size=3), h, shape), occupied, E, nu, rho,
        part=rng.integers(0, len(names), shape) if labelled else None,
        part_names=tuple(names) if labelled else (),
        material=rng.integers(0, 9, shape) if labelled else None,
        material_names=("oak", "steel") if labelled else (),
        ranges=Ranges(pair, pair / 1e13, pair) if labelled else None,
        alpha=0.25 if labelled else None,
    )  # fmt: skip


@settings(
    max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    seed=st.integers(0, 2**32 - 1),
    shape=st.tuples(*[st.integers(1, 5)] * 3),
    h=st.floats(1e-4, 10),
    names=st.lists(st.text(), min_size=1, max_size=3, unique=True),
)
def test_field_round_trip_is_bit_exact(seed, shape, h, names, tmp_path):
    path, field = tmp_path / "field.npz", some_field(seed, shape, h, names)
    save(path, field)
    back = load(path)
    assert isinstance(back, MaterialField)
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(back, name), getattr(field, name))
    assert (back.ranges is None) == (field.ranges is None)
    if field.ranges is not None:
        np.testing.assert_array_equal(back.ranges.nu, field.ranges.nu)
    np.testing.assert_array_equal(back.grid.lo, field.grid.lo)
    assert (back.grid.h, back.grid.shape) == (field.grid.h, field.grid.shape)
    assert back.part_names == field.part_names
    assert back.material_names == field.material_names
    assert back.alpha == field.alpha


def test_the_file_states_units_and_version(tmp_path):
    save(tmp_path / "m.npz", box_mesh((1, 1, 1), (1, 1, 1)))
    meta = str(load_npz(tmp_path / "m.npz")["meta"])
    assert '"version": 1' in meta
    assert '"points": "m"' in meta


def test_pickled_objects_are_refused_both_ways(tmp_path):
    path = tmp_path / "evil.npz"
    np.savez(path, meta=np.array([{"kind": "TetMesh"}], dtype=object))
    with pytest.raises(InputError, match="allow_pickle"):
        load(path)
    with pytest.raises(InputError, match="Python objects"):
        save_npz(tmp_path / "mine.npz", a=np.array([{}], dtype=object))


def test_an_archive_bomb_is_refused_before_it_unpacks(tmp_path):
    save_npz(tmp_path / "bomb.npz", zeros=np.zeros(1 << 20))
    assert (tmp_path / "bomb.npz").stat().st_size < 20_000
    with pytest.raises(InputError, match="unpacks to"):
        load_npz(tmp_path / "bomb.npz", max_bytes=1 << 20)


def test_corrupt_archives_end_in_a_clear_error(tmp_path):
    for content in (b"", b"PK\x03\x04 cut", b"\x93NUMPY"):
        (tmp_path / "bad.npz").write_bytes(content)
        with pytest.raises(InputError, match=r"bad\.npz"):
            load(tmp_path / "bad.npz")


def test_a_strangers_archive_is_told_apart(tmp_path):
    save_npz(tmp_path / "other.npz", density=np.zeros(3))
    with pytest.raises(InputError, match=r"no entry 'meta', got \['density'\]"):
        load(tmp_path / "other.npz")
