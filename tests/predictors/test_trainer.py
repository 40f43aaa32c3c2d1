"""Laws of the trainer, on a line through points: any network, sampler and loss will do."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from typing import NamedTuple

import pytest
import torch
from autophyx_tet.fem.errors import InputError
from autophyx_tet.research.training.options import TrainerOptions
from autophyx_tet.research.training.processes import rank
from autophyx_tet.research.training.trainer import Losses, train_network
from torch import Tensor, nn

pytestmark = pytest.mark.usefixtures("one_thread")
OPTIONS = TrainerOptions(batch=32, steps=100, rate=0.2, warm_up=3, decay=0.8, every=10)


class Points(NamedTuple):
    """Places (n, 1) and heights (n, 1)."""

    x: Tensor
    y: Tensor


class Line:
    """Draws points of y = 2 x + 1, with some noise."""

    def __init__(self) -> None:
        self.generator = torch.Generator().manual_seed(0)

    def draw(self, n: int) -> Points:
        x, noise = torch.randn(2, n, 1, generator=self.generator)
        return Points(x, 2 * x + 1 + 0.01 * noise)


def squares(found: Tensor, points: Points) -> Losses:
    """Mean squared error, with the largest error to watch."""
    error = found - points.y
    total = error.square().mean()
    return Losses(total, {"loss": total.detach(), "largest": error.detach().abs().max()})


def heights(network: nn.Linear, points: Points) -> Tensor:
    return network(points.x)


def fitted(options=OPTIONS, **given):
    torch.manual_seed(0)
    return train_network(nn.Linear(1, 1), Line(), squares, options, forward=heights, **given)


def weights(trained) -> list[float]:
    return [float(trained.network.weight.detach()), float(trained.network.bias.detach())]


@pytest.mark.slow
def test_a_line_is_found():
    """The averaged network is y = 2 x + 1; reports hold what the loss reports, and fall."""
    reports = []
    trained = fitted(report=reports.append)
    assert weights(trained) == pytest.approx([2, 1], abs=0.02)
    assert (trained.steps, trained.history) == (100, reports)
    assert list(reports[0]) == ["step", "loss", "largest", "rate", "samples_per_second"]
    assert reports[-1]["loss"] < 1e-2 * reports[0]["loss"]


@pytest.mark.slow
def test_resume_is_exact(tmp_path):
    """Ten steps, a pause and ninety more end at the very weights of a hundred without a pause."""
    whole = fitted()
    half = fitted(resume=tmp_path, pause=0.0)
    rest = fitted(resume=tmp_path)
    assert (half.steps, rest.steps) == (10, 100)
    assert weights(half) != weights(whole)
    assert weights(rest) == weights(whole)
    keys = ("step", "loss", "largest", "rate")
    for found, wanted in zip(rest.history, whole.history, strict=True):
        assert [found[key] for key in keys] == [wanted[key] for key in keys]


def test_a_finished_run_is_left_as_it_is(tmp_path):
    """Resumed at its end, a run takes no step; its network is written again."""
    first, written = fitted(resume=tmp_path), []
    again = fitted(resume=tmp_path, save=lambda network, steps: written.append((network, steps)))
    assert weights(again) == weights(first)
    assert written == [(again.network, 100)]


def test_a_state_belongs_to_its_config(tmp_path):
    """With other data a state is refused, and the way out is said."""
    fitted(resume=tmp_path, pause=0.0, config={"rows": (1, 2)})
    with pytest.raises(InputError, match="resume with the same one"):
        fitted(resume=tmp_path, config={"rows": (1, 3)})
    assert fitted(resume=tmp_path, config={"rows": (1, 2)}).steps == 100


def test_a_loss_that_is_no_number_ends_the_run():
    """Divergence is an error that names the way out."""

    def divided(found: Tensor, points: Points) -> Losses:
        return Losses((found / 0).mean(), {"loss": found.mean()})

    torch.manual_seed(0)
    with pytest.raises(InputError, match="lower `rate`"):
        train_network(nn.Linear(1, 1), Line(), divided, OPTIONS, forward=heights)


def test_weights_decay():
    """Where rate times decay is 1, nothing is left of the weights but the first step, +-rate."""
    options = replace(OPTIONS, rate=0.1, warm_up=0, weight_decay=10.0, steps=1)
    network = nn.Linear(1, 1)
    train_network(network, Line(), squares, options, forward=heights)
    assert [abs(float(p.detach())) for p in network.parameters()] == pytest.approx([0.1, 0.1])


def test_rate_warms_up_and_falls_like_a_cosine():
    """Linear to the full rate, half way down in the middle, the final rate at the end."""
    options = TrainerOptions(batch=1, steps=100, rate=1.0, final_rate=0.2, warm_up=4)
    assert options.rate_at(0, 0.0) == pytest.approx(0.25)
    assert options.rate_at(50, 0.0) == pytest.approx(0.6)
    assert options.rate_at(100, 0.0) == pytest.approx(0.2)
    assert replace(options, minutes=1.0).rate_at(50, 60.0) == pytest.approx(0.2)


class Share(Line):
    """Draws this process's every second point of what one process draws, or all of them."""

    def __init__(self, every: int) -> None:
        super().__init__()
        self.every = every

    def draw(self, n: int) -> Points:
        whole = super().draw(self.every * n)
        return Points(*(column[rank() % self.every :: self.every] for column in whole))


def shared(every: int) -> list[float]:
    """Weights in double precision after a run on such shares."""
    torch.manual_seed(0)
    options = replace(OPTIONS, batch=OPTIONS.batch // every, steps=30)
    sampler, forward = Share(every), lambda network, points: network(points.x.double())
    return weights(
        train_network(nn.Linear(1, 1).double(), sampler, squares, options, forward=forward)
    )


PROGRAM = """
import atexit, json, os, pathlib, sys
sys.path.insert(0, sys.argv[1])

@atexit.register
def no_thread_outlives_the_group():
    threads = [f.read_text() for f in pathlib.Path("/proc/self/task").glob("*/comm")]
    if any("gloo" in name for name in threads):
        os._exit(3)

from test_trainer import shared
found = [shared(1), shared(2)]
if os.environ["RANK"] == "0":
    print(json.dumps(found))
"""


@pytest.mark.slow
def test_two_processes_are_one(tmp_path):
    """On the same batches to the last bit; on a half each to the round-off of their sums."""
    (tmp_path / "program.py").write_text(PROGRAM)
    command = [
        sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2",
        str(tmp_path / "program.py"), os.path.dirname(__file__),
    ]  # fmt: skip
    told = subprocess.run(
        command, check=True, timeout=300, env={**os.environ, "OMP_NUM_THREADS": "1"},
        capture_output=True,
    )  # fmt: skip
    same, halves = json.loads(told.stdout)
    assert same == shared(1)
    assert halves == pytest.approx(shared(1), rel=1e-12)
    # One process alone, on its half: far beyond the round-off that the sums may or may not show.
    assert halves != pytest.approx(shared(2), rel=1e-6)
