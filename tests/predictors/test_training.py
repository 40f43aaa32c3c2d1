"""Laws of the trainer: an interrupted run is the uninterrupted one; processes stay in step."""

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import torch
from autophyx_tet.fem.errors import InputError
from autophyx_tet.predictors.film.predictor import Frame
from autophyx_tet.predictors.film.unet import NetworkConfig
from autophyx_tet.predictors.film.words import with_lexicon
from autophyx_tet.predictors.grid import Grid, PartVoxels
from autophyx_tet.research.datasets.objects import make_objects
from autophyx_tet.research.datasets.shapes import EMPTY
from autophyx_tet.research.datasets.text_table import (
    build_text_table,
    load_text_table,
    save_text_table,
)
from autophyx_tet.research.training.film.mixture import Mixture
from autophyx_tet.research.training.film.presets import ABLATIONS, CPU, TEXT_DIM
from autophyx_tet.research.training.film.recipe import train_film
from autophyx_tet.research.training.film.sampler import VoxelSampler
from autophyx_tet.research.training.sentences import Sentences
from autophyx_tet.research.training.stores import procedural_store

TINY = replace(
    CPU, batch=2, steps=20, every=10, objects=8, text_batch=8,
    network=NetworkConfig(widths=(8, 8, 8, 8, 8), text_dim=TEXT_DIM, slot_width=16, key_width=8),
)  # fmt: skip


pytestmark = pytest.mark.usefixtures("one_thread")


@pytest.fixture(scope="module")
def text(tmp_path_factory):
    """A table of clauses whose embeddings mean nothing: the trainer does not mind."""

    def embed(texts):
        vectors = [np.random.default_rng(len(t)).normal(size=384) / 20 for t in texts]
        return np.concatenate([with_lexicon(np.stack(vectors), texts), np.stack(vectors)], 1)

    path = tmp_path_factory.mktemp("text") / "text.safetensors"
    save_text_table(path, build_text_table(np.random.default_rng(0), embed, per_part=3))
    return path


def same(first, second) -> bool:
    pairs = zip(first.state_dict().values(), second.state_dict().values(), strict=True)
    return all(torch.equal(a, b) for a, b in pairs)


def test_rows_of_the_ablation_differ_in_one_thing():
    """All rows have one budget and one seed; network or mixture differs, never both."""
    short = ABLATIONS["short"]
    for name, row in ABLATIONS.items():
        assert replace(row, network=short.network, mixture=short.mixture) == short
        changed = (row.network != short.network) + (row.mixture != short.mixture)
        assert changed == (name != "short")


@pytest.mark.slow
def test_resume_is_exact(text, tmp_path):
    """Ten steps, a pause and ten more end at the very weights of twenty without a pause."""
    whole = train_film(TINY, text=text)
    half = train_film(TINY, text=text, resume=tmp_path, pause=0.0)
    rest = train_film(TINY, text=text, resume=tmp_path)
    assert (half.steps, rest.steps) == (10, 20)
    assert not same(half.network, whole.network)
    assert same(rest.network, whole.network)


@pytest.mark.slow
def test_another_config_does_not_resume(text, tmp_path):
    """A state belongs to its config: with another one the way out is said."""
    train_film(TINY, text=text, resume=tmp_path, pause=0.0)
    with pytest.raises(InputError, match="resume with the same one"):
        train_film(replace(TINY, rate=1e-5), text=text, resume=tmp_path)


PROGRAM = """
import sys
from pathlib import Path
import torch
sys.path.insert(0, sys.argv[2])
from test_training import TINY, train_film
torch.set_num_threads(1)
seen = []
trained = train_film(TINY, text=Path(sys.argv[1]), report=seen.append)
import os
from safetensors.torch import save_file
rank = os.environ["RANK"]
weights = {name: w.contiguous() for name, w in trained.network.state_dict().items()}
save_file(weights, f"{sys.argv[3]}/{rank}.safetensors")
Path(sys.argv[3], f"{rank}.reports").write_text(str(len(seen)))
"""


@pytest.mark.long
def test_two_processes_stay_in_step(text, tmp_path):
    """Gradients are averaged: both processes end at the same weights; only the first reports."""
    from safetensors.torch import load_file

    (tmp_path / "program.py").write_text(PROGRAM)
    command = [
        sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2",
        str(tmp_path / "program.py"), str(text), os.path.dirname(__file__), str(tmp_path),
    ]  # fmt: skip
    subprocess.run(command, check=True, timeout=300, env={**os.environ, "OMP_NUM_THREADS": "1"})
    first, second = (load_file(tmp_path / f"{rank}.safetensors") for rank in range(2))
    assert all(torch.equal(first[name], second[name]) for name in first)
    assert (tmp_path / "0.reports").read_text() == "2"
    assert (tmp_path / "1.reports").read_text() == "0"


@pytest.mark.slow
def test_training_sees_what_prediction_sees(text):
    """Of 5 objects both get the same voxels, colours (to their noise) and places (to a cell)."""
    cells = 64
    made = make_objects(5, np.random.default_rng(4))
    palette = torch.rand(5, 6, 3, generator=torch.Generator().manual_seed(0))
    store = procedural_store(made, cells=cells, device="cpu")._replace(colour=palette)
    mixture = Mixture(colour=1.0, augment=0.0)
    sentences = Sentences(load_text_table(text), "cpu")
    sampler = VoxelSampler(sentences, store, None, None, mixture=mixture, seed=0)
    part = torch.where(store.label == EMPTY, -1, store.label.long())
    trained = sampler._inputs(store, part).numpy()
    for index in range(5):
        cell = part[index].numpy()
        parts = PartVoxels(Grid(np.zeros(3), 0.01, cell.shape), cell, tuple("abcdef"))
        frame = Frame.of(parts, "z")
        colours = palette[index].numpy()[cell.clip(min=0)]
        seen = frame.inputs(frame.forward(cell, outside=-1), colours)
        ours, theirs = trained[index][:, cell >= 0], seen[:, seen[0] > 0]
        assert ours.shape == theirs.shape
        assert np.abs(ours[1:4] - theirs[1:4]).max() <= 0.04 + 1e-6
        assert np.array_equal(ours[4], theirs[4])
        assert np.abs(ours[5:] - theirs[5:]).max() <= 2 / (cells - 2) + 1e-6
