"""The tables of the paper: their rows, and that the truth they are scored by is as it is said."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.research.evaluation.paper.feedback import belief_of, feedback_table, riddles
from autophyx_tet.research.evaluation.paper.joint import JOINT_ROWS, joint_table
from autophyx_tet.research.evaluation.paper.networks import ROWS, SPLITS, paper_table
from autophyx_tet.research.evaluation.paper.springs import (
    RULES,
    ridge_scale,
    spring_case,
    springs_table,
)
from autophyx_tet.research.evaluation.paper.theta import AFFINE, CONSTANT, HEAD, theta_table
from autophyx_tet.research.training.unipixie.config import CPU
from autophyx_tet.research.voxels import voxel_mesh


@pytest.mark.slow
def test_the_truth_of_s5_is_a_draw_of_what_the_words_leave_open(names):
    """Inside the ends, at the mean and spread on average, and never the mean itself."""
    every = [
        (riddle.truth[p], *(column[p] for column in riddle.belief))
        for riddle in riddles(names, 64, 16, "seen")
        for p in np.unique(riddle.part[riddle.part >= 0])
    ]
    truth, mean, spread, low, high = (np.array(column) for column in zip(*every, strict=True))
    assert ((low - 1e-6 <= truth) & (truth <= high + 1e-6)).all()
    assert (np.abs(truth - mean)[:, 0] > 0).all()
    apart = ((truth - mean) / spread)[:, [0, 2]]
    assert np.abs(apart.mean(axis=0)).max() < 4 / len(apart) ** 0.5  # four standard errors
    # Of a uniform draw (apart)^2 has a deviation below 1; spreads are raised where nothing is open.
    assert (apart**2).mean() == pytest.approx(1, abs=4 / len(apart) ** 0.5)


def test_a_belief_has_the_mean_and_the_spread_of_its_draws(names):
    """Of a word that leaves several rows: a million draws agree."""
    kinds = torch.arange(len(names.plain.count))
    name = names.plain(kinds, torch.zeros(len(kinds)))
    name = name[name >= 0][:1]
    dice = torch.Generator().manual_seed(0)
    many = name.expand(10**6)
    row = names.choose_row(many, torch.rand(10**6, generator=dice))
    place = torch.rand(10**6, 3, generator=dice)
    drawn = (names.low[row] + (names.high[row] - names.low[row]) * place).double()
    found = belief_of(names, name)
    error = 4e-3 * found.spread[0]  # four standard errors of a million draws
    assert (np.abs(drawn.mean(0).numpy() - found.mean[0]) < error).all()
    np.testing.assert_allclose(drawn.std(0).numpy(), found.spread[0], rtol=4e-3)


def test_a_ridge_finds_a_slope_and_a_body_alike_its_own():
    """Without noise and with many bodies the penalty of one body is little."""
    looks = np.random.default_rng(0).normal(size=(1000, 2))
    scales = 3 + looks @ [0.5, -1.0]
    told = ridge_scale(scales, looks, np.array([1.0, 1.0]))
    assert told == pytest.approx(2.5, abs=2e-3)  # the slopes shrink by 1 / 1001


@pytest.mark.slow
def test_the_scale_of_springs_is_told_without_a_unit():
    """A block a thousand times stiffer needs the same scale: both frequencies rise alike."""
    block = voxel_mesh(np.ones((4, 4, 8), dtype=bool))
    cases = [
        spring_case(
            block.with_material(ElementMaterial.uniform(len(block.tets), E=E, nu=0.25, rho=1e3)),
            300,
        )
        for E in (1e6, 1e9)
    ]
    assert cases[0].scale == pytest.approx(cases[1].scale, abs=1e-6)  # of the eigensolvers
    assert cases[0].look == pytest.approx(cases[1].look)


@pytest.mark.slow
def test_a_table_of_the_paper_trains_its_rows(ranges):
    """Rows differ in one thing, and each is scored where training was and where it was not."""
    base = replace(CPU, steps=2, every=2, objects=3)
    told: list[str] = []
    rows = paper_table("S6", base, ranges=ranges, objects=4, progress=told.append)
    assert told == list(ROWS["S6"])
    assert [(row.row, row.split) for row in rows] == [(t, s) for t in told for s in SPLITS]
    assert all(row.steps == 2 and min(row.soft + row.stiff) > 0 for row in rows)
    assert rows[0].middle != rows[2].middle


@pytest.mark.slow
def test_table_s3_has_a_joint_row_and_specialists(ranges):
    """The joint network has fewer parameters than both specialists; each is scored as it can."""
    base = replace(CPU, steps=2, every=2, objects=3)
    rows = joint_table(base, ranges=ranges, objects=2, bodies=3)
    assert [(r.row, r.split) for r in rows] == [(t, s) for t in JOINT_ROWS for s in SPLITS]
    count = {row.row: row.parameters for row in rows}
    assert count["joint"] < count["separate, matter"] + count["separate, skinning"]
    for row in rows:
        assert (row.soft > 0) == ("mpm" in JOINT_ROWS[row.row])
        assert (0 < row.share < 1) == (row.row != "separate, matter")


@pytest.mark.long
def test_table_s5_has_an_agent_that_a_measurement_helps(ranges):
    """The agent ends nearer to the truth and to its motion than its first proposal."""
    rows = {(r.row, r.split): r for r in feedback_table(ranges=ranges, objects=2)}
    assert len(rows) == 4 * len(SPLITS)
    for split in SPLITS:
        words, agent = rows["words alone", split], rows["agent", split]
        assert agent.mse_E < words.mse_E
        assert agent.psnr > words.psnr
        assert 0 < agent.rounds <= 5
        assert words.rounds == 0 < words.mse_E


@pytest.mark.slow
def test_the_heads_have_tables_beside_constants(ranges):
    """Handles help even where nothing is learned from them; a rule of constants is one number."""
    base = replace(CPU, steps=2, every=2)
    rows = theta_table(base, ranges=ranges, objects=2, bodies=3, cells=8)
    assert [(r.row, r.split) for r in rows] == [
        (name, split) for name in (AFFINE, CONSTANT, HEAD) for split in SPLITS
    ]
    assert all(0 < row.share < 1 for row in rows)
    assert all((row.gain < 0) == (row.row == AFFINE) for row in rows if row.row != HEAD)
    found = springs_table(ranges=ranges, objects=3, cells=10, anchors=256)
    assert [row.row for row in found[:: len(SPLITS)]] == list(RULES)
    assert all(row.bodies + row.left_out == 3 and row.mean > 0 for row in found)
