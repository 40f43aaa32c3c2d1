"""Training of the region network: batches say what they should, and a few steps learn."""

from dataclasses import fields, replace

import numpy as np
import pytest
import torch
from autophyx_tet.predictors.matter import FEATURES
from autophyx_tet.predictors.regions.network import MEASURES, OUTLIER, RegionNetwork
from autophyx_tet.predictors.text.parts import KINDS
from autophyx_tet.research.datasets.one_piece import OnePiece
from autophyx_tet.research.datasets.region_sets import (
    CLAUSES,
    NULL,
    OPTIONS,
    SLOTS,
    RegionCorpus,
    Sentence,
    baked_light,
    in_baked_light,
    row_of,
    said_anew,
    shorter,
)
from autophyx_tet.research.training.regions.recipe import (
    PRESETS,
    calibrated,
    clicked,
    region_loss,
    train_one,
    train_regions,
)
from autophyx_tet.research.training.regions.sampler import Habits, RegionSampler

pytestmark = pytest.mark.usefixtures("one_thread")
CALM = Habits(*[0.0] * len(fields(Habits)))
WORDS, REGIONS, THINGS = 6, 4, 12


@pytest.fixture(scope="module")
def corpus():
    """Things of four regions, each a slot, told apart by one measure; clause k is of slot k."""
    rng = np.random.default_rng(0)
    values = np.zeros((THINGS, 48, len(MEASURES)), dtype=np.float32)
    values[:, :REGIONS] = rng.normal(size=(THINGS, REGIONS, len(MEASURES))) * 0.1
    values[:, :REGIONS, 30] = np.arange(REGIONS)
    cells = np.zeros((THINGS, 48, SLOTS), dtype=np.float32)
    cells[:, np.arange(REGIONS), np.arange(REGIONS)] = [400, 300, 200, 100]
    part = np.full((THINGS, CLAUSES, OPTIONS), -1)
    part[:, :3, 0] = [0, 1, 2]
    material = np.full((THINGS, CLAUSES), -1)
    material[:, :3] = [0, 1, 0]
    clause = np.full((THINGS, SLOTS), -1)
    clause[:, :3], clause[:, 3] = [0, 1, 2], NULL
    return RegionCorpus(
        values, np.zeros((THINGS, 48, 48), np.float32), cells, np.full((THINGS, SLOTS), -1),
        np.arange(THINGS), np.zeros(THINGS, bool), np.zeros(THINGS, bool), np.ones(THINGS, bool),
        rng.normal(size=(THINGS, SLOTS, len(FEATURES))),
        np.tile(np.arange(SLOTS) % len(KINDS), (THINGS, 1)),
        np.arange(THINGS), np.zeros(THINGS, bool), part, material, clause,
        np.eye(WORDS, 384, dtype=np.float32), np.eye(2, 384, dtype=np.float32)[::-1].copy(),
        np.array([0, 3]), np.array([1, -1]),
        {"words": [*"abcdef"], "materials": ["x", "y"], "categories": ["p", "q"],
         "things": [*map(str, range(THINGS))]},
    )  # fmt: skip


def test_a_batch_wants_of_each_region_the_clause_that_speaks_of_it(corpus):
    """Slot k of clause k; of the fourth, of which nobody speaks, the null clause, the first."""
    sampler = RegionSampler(corpus, seed=0, device="cpu", habits=CALM)
    batch = sampler.batch(torch.arange(3), torch.arange(3), varied=False)
    wanted = batch.wanted[:, :REGIONS, : REGIONS + 1]
    expected = torch.zeros(REGIONS, REGIONS + 1)
    expected[[0, 1, 2, 3], [1, 2, 3, 0]] = torch.tensor([400.0, 300.0, 200.0, 100.0])
    assert torch.equal(wanted, expected.expand_as(wanted))
    assert batch.spoken[:, :5].tolist() == [[True, True, True, True, False]] * 3
    assert batch.part[0, 1:4].argmax(dim=1).tolist() == [0, 1, 2]
    assert not batch.part[0, 0].any()


def test_clauses_that_change_places_take_their_regions_along(corpus):
    """Whatever the order, the region of slot k belongs to the clause with word k."""
    habits = replace(CALM, real=1.0, shuffled=1.0)
    batch = RegionSampler(corpus, seed=0, device="cpu", habits=habits).draw(64)
    word = batch.part.argmax(dim=2)
    owner = batch.wanted[:, :3].argmax(dim=2)
    assert torch.equal(word.gather(1, owner), torch.arange(3).expand(64, 3))
    assert len(torch.unique(owner, dim=0)) == 6  # all orders of three


def test_what_a_dropped_clause_spoke_of_is_of_the_null_clause(corpus):
    habits = replace(CALM, real=1.0, dropped=1.0)
    batch = RegionSampler(corpus, seed=0, device="cpu", habits=habits).draw(64)
    assert (batch.spoken.sum(dim=1) == 3).all()  # two clauses and the null
    lost = batch.wanted[:, :3, 0] > 0
    assert (lost.sum(dim=1) == 1).all()
    assert lost.any(dim=0).all()
    assert torch.equal(batch.wanted.sum(dim=(1, 2)), torch.full((64,), 1000.0))


def test_clauses_by_size_stand_with_the_largest_first(corpus):
    """Slot k has (4 - k) hundred cells: whatever the places before, clause k is the k-th."""
    habits = replace(CALM, real=1.0, by_size=1.0)
    batch = RegionSampler(corpus, seed=0, device="cpu", habits=habits).draw(8)
    assert batch.part[:, 1:4].argmax(dim=2).tolist() == [[0, 1, 2]] * 8


def test_what_a_user_tells_of_a_region_is_so(corpus):
    """One or two regions of each thing, with the clause that speaks of them."""
    habits = replace(CALM, real=1.0, told=1.0)
    batch = RegionSampler(corpus, seed=0, device="cpu", habits=habits).draw(64)
    known = batch.told >= 0
    assert set(known.sum(dim=1).tolist()) == {1, 2}
    assert torch.equal(batch.told[known], batch.wanted.argmax(dim=2)[known])
    of_user = batch.evidence[..., 2]
    assert torch.equal(of_user[known].argmax(dim=1), batch.told[known])
    assert not of_user[~known].any()


def test_a_thing_that_turned_has_its_sides_exchanged(corpus):
    habits = replace(CALM, real=1.0, turned=1.0)
    sampler = RegionSampler(corpus, seed=0, device="cpu", habits=habits)
    batch = sampler.batch(torch.arange(3), torch.arange(3), varied=True)
    i, j = MEASURES.index("own width"), MEASURES.index("own depth")
    kept = MEASURES.index("height")
    seen, plain = batch.region[:, :REGIONS], sampler.region[:3, :REGIONS]
    assert torch.equal(seen[..., kept], plain[..., kept])
    depth = (corpus.values[:3, :REGIONS, j] - sampler.mean[i]) / sampler.deviation[i]
    assert np.allclose(seen[..., i], depth.clip(-OUTLIER, OUTLIER), atol=1e-5)
    assert not torch.equal(seen[..., i], plain[..., i])


def test_a_user_names_the_region_where_most_is_wrong(corpus):
    """A network that gives every region to the first clause is most wrong of the second's."""
    batch = RegionSampler(corpus, seed=0, device="cpu", habits=CALM).draw(8)
    first = torch.zeros(batch.wanted.shape)
    first[..., 1] = 1.0
    generator = torch.Generator().manual_seed(0)
    told = clicked(lambda _: first, batch, 1.0, generator)
    assert told.told[:, :REGIONS].tolist() == [[-1, 2, -1, -1]] * 8
    assert told.evidence[:, 1, :4, 2].tolist() == [[-1, -1, 1, -1]] * 8
    assert not told.evidence[:, [0, 2, 3], :, 2].any()
    assert (clicked(lambda _: first, batch, 0.0, generator).told == -1).all()


def test_a_shorter_object_keeps_its_looks_and_slots():
    rng = np.random.default_rng(0)
    cells = np.argwhere(np.ones((8, 9, 10)))
    looks = np.tile(cells[:, :1] / 8, (1, 7))
    piece = OnePiece("", cells, looks, cells[:, 2] // 5, cells[:, 0] // 4, ("a", "b"))
    for _ in range(6):
        short = shorter(piece, rng)
        sides = np.ptp(short.cells, axis=0) + 1
        assert sorted(sides < (8, 9, 10)) == [False, False, True]
        assert len(np.unique(short.cells, axis=0)) == len(short.cells)
        assert np.array_equal(short.slot, (short.looks[:, 0] * 8 // 4).round())


def test_what_a_scan_sees_is_colours_alone():
    rng = np.random.default_rng(0)
    cells = np.argwhere(np.ones((20, 20, 20)))
    looks = np.full((len(cells), 7), 0.5)
    piece = OnePiece("", cells, looks, np.zeros(8000, int), np.zeros(8000, int), ("a",))
    seen = in_baked_light(piece, rng).looks
    assert len(np.unique(seen[:, 3:], axis=0)) == 1
    assert 0.03 < seen[:, 0].std() < 0.15
    assert np.all(piece.looks == 0.5)


def test_sentences_anew_are_of_what_was_said_of_the_same_slots():
    """Each clause has words and a matter that somebody gave its slots, or another name of it."""
    parts = [("top", "oak", ["a"]), ("legs", "steel", ["b", "c"]), ("feet", "rubber", ["d"])]
    said = [Sentence([("plate", "walnut", ["a"]), ("frame", "", ["c", "b"])])]
    made = said_anew(said, parts, 60, np.random.default_rng(0))
    assert all(one.anew and len(one.clauses) >= 2 for one in made)
    matters = {"a": {"oak", "walnut"}, "b": {"steel"}, "d": {"rubber"}}
    for one in made:
        for _, matter, slots in one.clauses:
            assert matter in matters[slots[0]]
    words = {part for one in made for part, _, slots in one.clauses if slots == ["a"]}
    assert {"top", "plate"} <= words
    assert any(one.clauses[0][2] == ["a"] for one in made)
    assert any(set(one.unsaid) == {"d"} for one in made)


def test_the_loss_of_what_is_sure_and_right_is_nothing(corpus):
    batch = RegionSampler(corpus, seed=0, device="cpu", habits=CALM).draw(8)
    sure = torch.where(batch.wanted > 0, 0.0, -1e4)
    found = region_loss(sure, batch)
    assert float(found.total) == pytest.approx(0, abs=1e-6)
    assert float(found.reported["right"]) == pytest.approx(1)


@pytest.mark.long
def test_sixty_steps_of_a_cpu_learn_what_one_measure_tells(corpus, tmp_path):
    """And the file that is written runs without torch, with the same shares."""
    config = PRESETS["regions-cpu"]
    options = replace(config.options, rate=3e-3)
    done = train_regions(
        replace(config, habits=(CALM,), options=options), corpus, output=tmp_path / "a.safetensors"
    )
    assert done[0].history[-1]["right"] > 0.95
    network = RegionNetwork.load(tmp_path / "a.safetensors")
    assert network.facts["mean"] == pytest.approx(
        corpus.values[:, :REGIONS].reshape(-1, len(MEASURES)).mean(axis=0), abs=1e-5
    )


@pytest.mark.slow
def test_an_interrupted_run_is_the_uninterrupted_one(corpus, tmp_path):
    config = replace(PRESETS["regions-cpu"], habits=(replace(CALM, noise=0.1),))
    options = replace(config.options, batch=8, steps=6, every=3)
    whole = train_one(replace(config, options=options), corpus)
    first = replace(config, options=replace(options, steps=6))
    train_one(first, corpus, resume=tmp_path)
    again = train_one(first, corpus, resume=tmp_path)
    for name, tensor in whole.network.state_dict().items():
        assert torch.equal(tensor, again.network.state_dict()[name]), name


def test_calibration_undoes_what_was_said_too_surely():
    """Shares whose log-odds were doubled get them back: a slope of one half."""
    said = np.random.default_rng(0).uniform(0.05, 0.95, 4000)
    odds = np.log(said / (1 - said))
    slope, offset = calibrated(said, 1 / (1 + np.exp(-odds / 2)))
    assert slope == pytest.approx(0.5, abs=0.01)
    assert offset == pytest.approx(0, abs=0.01)


def test_a_file_of_regions_is_read_as_it_was_written(corpus, tmp_path):
    corpus.save(tmp_path / "regions.npz")
    found = RegionCorpus.load(tmp_path / "regions.npz")
    assert found.facts == corpus.facts
    np.testing.assert_array_equal(found.cells, corpus.cells)
    np.testing.assert_allclose(found.values, corpus.values, rtol=1e-3, atol=1e-4)  # half precision


def test_baked_light_is_a_factor_around_one():
    cells = np.argwhere(np.ones((40, 40, 40)))
    light = baked_light(cells, np.random.default_rng(0), strength=0.15)
    assert light.mean() == pytest.approx(1, abs=0.1)
    assert 0.05 < light.std() < 0.2


@pytest.mark.slow
def test_the_row_of_a_matter_is_what_the_reader_hears():
    from autophyx_tet.fem.table import load_table

    table = load_table()
    assert row_of("soda-lime glass", table) == table.exact("soda-lime glass").name
    assert row_of("vibranium", table) == ""
    assert Sentence([("leg", "oak", ["a"])]).unsaid == ()
