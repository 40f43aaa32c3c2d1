"""Laws of the simulated ends, on a column that stands: similarity, superposition, identity."""

import numpy as np
import pytest
from autophyx_tet.fem.table import Band, Span
from autophyx_tet.research.datasets.audit.findings import DISTINCT, Examiner
from autophyx_tet.research.datasets.audit.probe import PERIODS, SAG, TOO_FAR, Probe, difference
from autophyx_tet.research.datasets.audit.proposal import End, PartRange, Proposal

COLUMN = np.full((24, 24, 24), -1)
COLUMN[10:14, 10:14, :12], COLUMN[10:14, 10:14, 12:] = 0, 1
NAMES = ("foot", "head")


def of(foot: tuple[float, float], head: tuple[float, float], rho: float = 500.0) -> Proposal:
    """A column of two parts of these E [Pa] at their ends, nu .3."""
    return Proposal(
        {
            name: PartRange(Band(Span(*E), Span(0.3, 0.3), Span(rho, rho)))
            for name, E in zip(NAMES, (foot, head), strict=True)
        }
    )


@pytest.fixture(scope="module")
def probe() -> Probe:
    return Probe(COLUMN, NAMES)


SOFT = of((1e5, 1e5), (1e5, 1e5))


def test_the_load_moves_the_soft_end_by_a_tenth(probe):
    """By definition; twice the E moves half as far, whatever the load: elements are linear."""
    load = probe.load(of((1e5, 2e5), (1e5, 2e5)))
    found = of((1e5, 2e5), (1e5, 2e5))
    assert probe.sag(found, End.SOFT, load) == pytest.approx(SAG, rel=1e-9)
    assert probe.sag(found, End.STIFF, load) == pytest.approx(SAG / 2, rel=1e-9)


def test_linear_ends_are_proportional():
    """The forecast: four times the E, a quarter of the way, in every voxel; no step is taken."""
    quick, found = Probe(COLUMN, NAMES, linear=True), of((1e5, 4e5), (1e5, 4e5))
    load, soft = quick.tried_load(found)
    stiff = quick.simulate(found, End.STIFF, load)
    assert (soft.x - quick.x) == pytest.approx(4 * (stiff.x - quick.x), rel=1e-9, abs=1e-12)
    assert (soft.substeps, soft.failure) == (0, None)
    assert SAG < soft.largest / quick.length <= 2 * SAG  # twice that at rest; voxels end inside


def test_the_load_scales_with_stiffness_and_the_time_with_sound(probe):
    """a ~ E / rho, T ~ sqrt(rho / E): the body's own load and time."""
    a, b = probe.load(SOFT), probe.load(of((4e7, 4e7), (4e7, 4e7), rho=2000.0))
    assert b.acceleration / a.acceleration == pytest.approx(100, rel=1e-9)
    assert a.duration / b.duration == pytest.approx(10, rel=1e-9)


def test_the_period_is_that_of_a_cantilever(probe):
    """T = 2 pi L^2 / 3.516 sqrt(rho A / (E I)), L 1 m, side 1/6 m.

    Shear makes it 6 % longer (Timoshenko, L / h = 6), elements of two cells across 30 % shorter.
    """
    thin = 2 * np.pi / 3.516 * np.sqrt(500.0 / 1e5 * 12 * 36)
    assert probe.load(SOFT).duration / PERIODS == pytest.approx(thin, rel=0.35)


@pytest.mark.slow
def test_the_particles_move_as_in_any_other_unit(probe):
    """E and the load a hundredfold in a tenth of the time: the same motion, in as many steps."""
    fast = of((1e7, 1e7), (1e7, 1e7))
    one = probe.simulate(SOFT, End.SOFT, probe.load(SOFT))
    other = probe.simulate(fast, End.SOFT, probe.load(fast))
    assert one.failure is None
    assert one.substeps == other.substeps
    assert difference(one, other, probe.part, probe.length) < 1e-6  # rounding of the last step


@pytest.mark.slow
def test_the_particles_correct_what_elements_get_wrong(probe):
    """Two cells across bend 2.7 times too little: the load is lowered until the soft end turns at
    twice a tenth, as a load does that is put on at once, with what is allowed beyond."""
    first = probe.load(SOFT)
    load, run = probe.tried_load(SOFT)
    assert load.acceleration < first.acceleration
    assert load.duration > first.duration
    assert SAG < run.largest / probe.length <= 2 * SAG * TOO_FAR


@pytest.mark.slow
def test_ends_that_are_one_are_alike_and_others_are_not(probe):
    """A range of nothing is found out; a factor of four is seen."""
    alike = Examiner(probe, SOFT).examine(SOFT)
    assert [finding.kind for finding in alike.findings] == ["indistinguishable"]
    assert alike.difference == 0
    wide = of((1e5, 4e5), (1e5, 4e5))
    found = Examiner(probe, wide).examine(wide)
    assert not found.findings
    assert found.difference is not None
    assert found.difference > 5 * DISTINCT


@pytest.mark.slow
def test_a_part_too_stiff_is_found_before_running_and_rigid_after(probe):
    """A head of steel on rubber: cfl without a step; decoupled it moves as one, undeformed."""
    steel = of((1e5, 4e5), (2e11, 2e11))
    examiner = Examiner(probe, steel)
    found = examiner.examine(steel)
    assert {(f.kind, f.part) for f in found.findings} == {("cfl", "head")}
    assert found.steps == (0, 0)
    head = PartRange(steel.parts["head"].band, rigid=(End.SOFT, End.STIFF))
    free = steel.with_part("head", head)
    assert not examiner.examine(free).findings
    moved = probe.simulate(free, End.SOFT, examiner.load).x[:, probe.part == 1]
    arms = moved - moved.mean(axis=1, keepdims=True)
    lengths = np.linalg.norm(arms, axis=2)
    assert lengths == pytest.approx(np.tile(lengths[0], (len(lengths), 1)), abs=1e-9)
    assert np.linalg.norm(moved[-1] - moved[0], axis=1).max() > DISTINCT
