"""Laws of the evaluation: a perfect answer has no error, masses compare as the papers say."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch
from autophyx_tet.fem.errors import InputError, UsageError
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.field import DEFAULT
from autophyx_tet.predictors.film.unet import Output, VoxelScene
from autophyx_tet.predictors.grid import Grid, PartVoxels
from autophyx_tet.predictors.text.parts import Vocabulary
from autophyx_tet.research.datasets.real import CELLS, RealObject
from autophyx_tet.research.datasets.shapes import EMPTY
from autophyx_tet.research.evaluation import held_out
from autophyx_tet.research.evaluation.ablations import (
    pooled_by_part,
    with_one_matter,
    with_slot_names,
    with_vision,
)
from autophyx_tet.research.evaluation.examples import Example, load_example, save_example
from autophyx_tet.research.evaluation.folder_evaluation import evaluate_folder
from autophyx_tet.research.evaluation.held_out import HeldOutObject, HeldOutSet, ImageFeatures
from autophyx_tet.research.evaluation.held_out_evaluation import evaluate_held_out
from autophyx_tet.research.evaluation.mass_errors import mass_errors
from autophyx_tet.research.evaluation.metrics import Score, against_best, summary
from autophyx_tet.research.evaluation.rows import BASELINES, ROWS
from autophyx_tet.research.evaluation.ssim import ImageSimilarity


def table_example(mass=None) -> Example:
    """Oak legs under a steel top, 8 x 8 x 8 cells of 1 cm."""
    part = np.full((8, 8, 8), -1)
    part[1:7, 1:7, 1:4], part[1:7, 1:7, 4:7] = 0, 1
    parts = PartVoxels(Grid(np.zeros(3), 0.01, part.shape), part, ("legs", "top"))
    oak, steel = (load_table().exact(name).value() for name in ("oak", "steel"))
    text = "oak legs and a steel top"
    return Example("table", parts, (text,), np.array([[oak, steel]]), mass=mass)


def test_example_round_trip(tmp_path):
    """What is written is read: cells, names, texts, values, colours, mass."""
    given = table_example(mass=2.5)
    save_example(tmp_path / "table.safetensors", given)
    found = load_example(tmp_path / "table.safetensors")
    assert np.array_equal(found.parts.part, given.parts.part)
    assert (found.parts.part_names, found.texts) == (given.parts.part_names, given.texts)
    assert np.array_equal(found.values, given.values)
    assert (found.mass, found.parts.grid.h, found.up) == (2.5, 0.01, "z")


def test_another_file_is_refused(tmp_path):
    """A file of another kind is named, not guessed."""
    (tmp_path / "noise.safetensors").write_bytes(b"noise")
    with pytest.raises(InputError, match="not an object with texts"):
        load_example(tmp_path / "noise.safetensors")
    with pytest.raises(InputError, match="holds no"):
        evaluate_folder(tmp_path / "nothing")


def test_a_perfect_answer_has_no_error(tmp_path):
    """Retrieval that sees the names takes both rows exactly, and so the mass."""
    oak, steel = (load_table().exact(name).value().rho for name in ("oak", "steel"))
    mass = 6 * 6 * 3 * 1e-6 * (oak + steel)
    save_example(tmp_path / "table.safetensors", table_example(mass=mass))
    rows, masses = evaluate_folder(tmp_path, ("retrieval-names",))
    assert rows[0].mse_mean < 1e-12
    assert masses["retrieval-names"].MnRE == pytest.approx(1, abs=1e-6)


def test_mass_errors():
    """Twice and half the mass: ALDE ln 2, MnRE 1/2; ADE and ARE by hand."""
    errors = mass_errors(np.array([1.0, 2.0]), np.array([2.0, 1.0]))
    assert errors.ALDE == pytest.approx(np.log(2))
    assert errors == pytest.approx((np.log(2), 1.0, 0.75, 0.5))
    with pytest.raises(InputError, match="positive"):
        mass_errors(np.array([1.0]), np.array([0.0]))


def test_differences_are_paired():
    """A row that is better by .1 on every object is better by .1, however the objects differ.

    An object's score is the mean over its texts: here that of one clause is .05 worse, the other
    better, and so are their own differences.
    """
    errors = np.random.default_rng(0).uniform(0.2, 5, 20)
    table = {"film": errors - 0.1, "table-mean": errors, "constant": errors + 1}
    scores = {
        name: {
            i: [
                Score(np.full(3, e + side * (name == "film")), e, e, np.nan, said, 0.0, seen)
                for side, said, seen in ((0.05, 1, ImageSimilarity(30.0, e)), (-0.05, 2, None))
            ]
            for i, e in enumerate(v)
        }
        for name, v in table.items()
    }
    rows = [summary(name, "test", list(found.values())) for name, found in scores.items()]
    film, best, constant = against_best(rows, scores, ("table-mean", "constant"))
    assert (film.best_baseline, film.difference) == ("table-mean", pytest.approx(-0.1))
    assert film.difference_interval == pytest.approx((-0.1, -0.1))
    assert film.difference_by_clauses is not None
    assert film.difference_by_clauses[1] == pytest.approx((-0.05, -0.05))
    assert film.difference_by_clauses[2] == pytest.approx((-0.15, -0.15))
    assert best.difference is None
    assert constant.difference == pytest.approx(1)
    assert (film.objects, film.texts) == (20, 40)
    assert (film.rendered, film.psnr_interval) == (20, (30.0, 30.0))
    assert film.ssim == pytest.approx(film.mse_mean)
    # Each picture beside that of the baseline that is best in it: the constant's SSIM is its error.
    assert film.psnr_difference == (0, 0)
    assert film.ssim_difference == pytest.approx((-1.1, -1.1))
    assert constant.ssim_difference is None
    assert against_best(rows[:1], scores, ("table-mean",))[0].best_baseline is None


def test_one_clause_for_all_is_what_binding_is_measured_against():
    """Right in .9 where the largest matter alone is right in .6: a margin of .3 on every object."""
    errors, n = np.zeros(3), np.nan
    texts = [
        [Score(errors, n, n, right, 2, 0.0, largest=right - 0.3), Score(errors, n, n, n, 0, 0.0)]
        for right in (0.8, 1.0)
    ]
    row = summary("film", "merged", texts)
    assert (row.clause_accuracy, row.largest_clause) == (pytest.approx(0.9), pytest.approx(0.6))
    assert row.clause_margin_interval == pytest.approx((0.3, 0.3))


@pytest.mark.slow
def test_merged_things_are_of_several_kinds_that_are_all_spoken_of(monkeypatch):
    """Of a plank, and of a table of wood and steel, the table alone is scored; both are named."""
    embed = lambda texts: np.random.default_rng(0).normal(size=(len(texts), 12)) / 4  # noqa: E731
    monkeypatch.setattr(held_out, "HintedEncoder", lambda encoder: SimpleNamespace(text=embed))
    label = np.full((CELLS,) * 3, EMPTY, dtype=np.uint8)
    label[8:56, 8:56, 30:40] = 0
    plank = RealObject("Plank", "test", label, ("wood",), np.full((1, 3), 0.5))
    label = label.copy()
    label[20:30, 20:30, 8:30] = 1
    table = RealObject("Table", "test", label, ("wood", "steel"), np.full((2, 3), 0.5))
    asked = HeldOutSet("merged", objects=2, cells=16, real=[plank, table])
    ((index, example),) = asked.drawn(asked.text_table())
    assert index == 1
    assert sorted(bool(said) for said in example.said) == [False] * 5 + [True] * 2


def test_a_part_is_of_one_matter():
    """Values become the mean of their part, shares too; the pieces of one part stay apart."""
    part = torch.zeros((1, 4, 4, 4), dtype=torch.long)
    part[:, 2:] = 1
    blank = torch.zeros(1, 2, 4)
    there = torch.tensor([[True, False]])
    scene = VoxelScene(
        torch.zeros(1, 8, 4, 4, 4), blank, there, blank[0], torch.tensor([False]),
        torch.zeros(1, 2, 2, 4, 4, 4), torch.zeros(1, 2), blank, torch.tensor([[False]]), part,
    )  # fmt: skip
    found = Output(torch.rand(1, 3, 4, 4, 4), torch.randn(1, 3, 4, 4, 4))
    pooled = pooled_by_part(found, scene)
    for half in (slice(0, 2), slice(2, 4)):
        cells = (slice(None), slice(None), half)
        mean = found.values[cells].mean((2, 3, 4), keepdim=True)
        assert torch.allclose(pooled.values[cells], mean.expand_as(found.values[cells]), atol=1e-6)
        share = found.logits.softmax(1)[cells].mean((2, 3, 4), keepdim=True)
        assert torch.allclose(pooled.logits.exp()[cells], share.expand(1, 3, 2, 4, 4), atol=1e-6)
    three = scene._replace(clause_mask=torch.ones(1, 3, dtype=torch.bool))
    assert pooled_by_part(found, three) is found


@pytest.mark.parametrize("clauses", [2, 3])
def test_assigned_is_the_material_that_is_named(clauses):
    """Parts that are .6 and .4 zinc are zinc and walnut, as each clause has one; cells if more."""
    part = torch.zeros((1, 4, 4, 4), dtype=torch.long)
    part[:, 2:] = 1
    part[:, :, 0] = -1
    said = ["the metal is zinc", "the wood is walnut", "the glass is glass"][:clauses]
    shares = torch.full((1, clauses + 1, 4, 4, 4), 0.05)
    shares[:, 0, :2], shares[:, 1, :2] = 0.6, 0.3
    shares[:, 0, 2:], shares[:, 1, 2:] = 0.5, 0.4
    scene = SimpleNamespace(part=part)
    example = HeldOutObject(SimpleNamespace(scene=scene), said)  # type: ignore[arg-type]
    given = Output(torch.zeros(1, 3, 4, 4, 4), shares.log())
    values, logits = with_one_matter(given, example, DEFAULT)
    found = values[0].movedim(0, -1).numpy()
    zinc, walnut = (
        DEFAULT.normalise(*load_table().exact(name).value()) for name in ("zinc", "walnut")
    )
    assert found[:2, 1:] == pytest.approx(np.broadcast_to(zinc, (2, 3, 4, 3)), abs=1e-6)
    other = walnut if clauses == 2 else zinc  # of pieces none is kept for a clause
    assert found[2:, 1:] == pytest.approx(np.broadcast_to(other, (2, 3, 4, 3)), abs=1e-6)
    assert (found[:, 0] == 0).all()
    owner = logits.argmax(1)[0][:, 1:]
    assert owner[:2].eq(0).all()
    assert owner[2:].eq(1 if clauses == 2 else 0).all()


class Letters:
    """Embeds a text as how often it has each of four letters."""

    dim = 4

    def text(self, texts) -> np.ndarray:
        counts = np.array([[1 + t.count(letter) for letter in "aeio"] for t in texts], np.float32)
        return counts / np.linalg.norm(counts, axis=1, keepdims=True)


def test_names_and_looks_are_heard_together():
    """Evidence of names joins that of an encoder at half the resolution, and leaves it alone."""
    part = torch.full((1, 8, 8, 8), -1)
    part[0, 2:6, 2:6, 2:4], part[0, 2:6, 2:6, 4:6] = 0, 1
    empty = torch.zeros(1, 2, 2, 8, 8, 8)
    blank = torch.zeros(1, 1, 4)
    scene = VoxelScene(
        (part >= 0).float()[:, None].expand(1, 8, 8, 8, 8), torch.zeros(1, 2, 4),
        torch.ones(1, 2, dtype=torch.bool), blank[0], torch.tensor([False]), empty,
        torch.zeros(1, 2), blank, torch.tensor([[False]]), part,
    )  # fmt: skip
    cells = np.argwhere(np.ones((2, 2, 2), dtype=bool)) + 1
    values = np.random.default_rng(0).random((8, 4)).astype(np.float32)
    sample = HeldOutObject(
        None, ["oak legs", "a steel top"], ("legs", "top"), ImageFeatures(cells, values)
    )
    looks = with_vision(scene, sample, Letters())
    both = with_slot_names(looks, sample, Letters(), Vocabulary(load_table().phrases))
    assert both.evidence.shape == (1, 2, 2, 4, 4, 4)
    assert torch.equal(both.evidence[:, 0], looks.evidence[:, 0])
    assert (both.evidence[0, 1, :, 1, 1, 1] * torch.tensor([1, -1]) > 0).all()
    assert (both.reliability > 0).all()


class Truth:
    """A row that knows the answer."""

    names = False

    def build(self, setting):
        return lambda example: (example.batch.target, None)


@pytest.mark.slow
def test_a_row_is_one_entry(monkeypatch):
    """A contender of anyone's is scored beside ours; a row that is not there is named at once."""
    embed = lambda texts: np.random.default_rng(0).normal(size=(len(texts), 12)) / 4  # noqa: E731
    monkeypatch.setattr(held_out, "HintedEncoder", lambda encoder: SimpleNamespace(text=embed))
    ROWS.register("truth", Truth())
    try:
        rows = evaluate_held_out(
            HeldOutSet("procedural", objects=4, cells=16), ("truth", "constant")
        )
    finally:
        ROWS.unregister("truth")
    truth, constant = rows
    assert truth.mse_mean == 0
    assert truth.best_baseline == "constant"
    assert truth.difference == pytest.approx(-constant.mse_mean)
    with pytest.raises(UsageError, match="unknown row 'truth'"):
        evaluate_held_out(HeldOutSet("procedural"), ("truth",))


@pytest.mark.long
def test_reading_clauses_helps_the_baselines():
    """On held-out objects the mean of what is said is nearer than a constant, and looks so."""
    asked = evaluate_held_out(HeldOutSet("procedural", objects=12, cells=32), BASELINES, renders=4)
    rows = {row.predictor: row for row in asked}
    assert rows["table-mean"].mse_mean < rows["constant"].mse_mean
    assert rows["constant"].difference > 0
    assert rows["table-mean"].rendered == rows["constant"].rendered == 4
    assert all(0 < row.ssim < 1 and 10 < row.psnr < 54 for row in asked)
    low, high = rows["constant"].interval
    assert low < rows["constant"].mse_mean < high
