"""The verbs about learning: data and training, each from its file to its file."""

from dataclasses import replace

import numpy as np
import pytest
import tyro
from autophyx_tet.fem.errors import InputError
from autophyx_tet.predictors.encoders import minilm
from autophyx_tet.predictors.unipixie.predictor import load_unipixie
from autophyx_tet.research.learning import train
from autophyx_tet.research.prepare import build_dataset, build_ranges, show_dataset
from autophyx_tet.research.training.unipixie import config
from autophyx_tet.toolkit.cli.main import COMMANDS

CONFIG = """
cells = 16
batch = 2
steps = 4
every = 2
objects = 4
composites = 0
text_batch = 4
device = "cpu"
bfloat16 = false

[network]
widths = [8, 8, 8, 8, 8]
text_dim = 397
slot_width = 16
key_width = 8
"""


@pytest.mark.slow
def test_samples_are_drawn(tmp_path):
    """Every sample shows an object and says a clause of each of its parts."""
    document = show_dataset(tmp_path / "samples.png", count=2)
    assert (tmp_path / "samples.png").stat().st_size > 1000
    assert len(document["samples"]) == 2
    assert all(sample["clauses"] for sample in document["samples"])


def test_an_unreadable_config_is_named(tmp_path):
    """A missing file and an unknown option are errors of one line."""
    with pytest.raises(InputError, match="cannot read the training config"):
        train(tmp_path / "none.toml", data=tmp_path, output=tmp_path / "run")
    (tmp_path / "bad.toml").write_text("colour = 3")
    with pytest.raises(InputError, match="training config"):
        train(tmp_path / "bad.toml", data=tmp_path, output=tmp_path / "run")


def test_commands_parse():
    """The commands read their options as the others do."""
    arguments = "evaluate --split procedural --objects 3 --predictors film constant --json".split()
    command = tyro.extras.subcommand_cli_from_dict(dict(COMMANDS), args=arguments)
    assert (command.objects, command.predictors) == (3, ("film", "constant"))
    assert command.common.json


@pytest.mark.slow
def test_build_and_train(tmp_path):
    """The documented commands rebuild the data and a (shortened) training; done is done."""
    made = build_dataset(tmp_path / "data", per_part=3, real=False)
    assert made["clauses"] > 500
    (tmp_path / "run.toml").write_text(CONFIG)
    trained = train(tmp_path / "run.toml", data=tmp_path / "data", output=tmp_path / "run")
    assert trained["steps"] == 4
    again = train(tmp_path / "run.toml", data=tmp_path / "data", output=tmp_path / "run")
    assert again["history"] == trained["history"]


@pytest.mark.long
def test_ranges_and_their_network(tmp_path, monkeypatch):
    """`dataset ranges` and `train unipixie-cpu` (shortened) give weights; done is done."""
    monkeypatch.setattr(minilm, "MiniLM", _Letters)
    made = build_ranges(tmp_path / "data")
    assert made["names"] > 9000
    short = replace(config.CPU, steps=4, every=2, objects=3, batch=2)
    monkeypatch.setitem(config.PRESETS, "unipixie-cpu", short)
    trained = train("unipixie-cpu", data=tmp_path / "data", output=tmp_path / "run")
    assert trained["steps"] == 4
    assert load_unipixie(tmp_path / "run" / "unipixie.safetensors").network.config == short.network
    again = train("unipixie-cpu", data=tmp_path / "data", output=tmp_path / "run")
    assert again["history"] == trained["history"]


class _Letters:
    """Vectors of texts without a model."""

    def __init__(self, *, device: str) -> None:
        self.device = device

    def text(self, sentences):
        return np.random.default_rng(0).normal(size=(len(sentences), 384))
