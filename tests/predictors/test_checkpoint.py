"""Laws of weight files: what the network's numbers mean is written, read and used."""

import json

import numpy as np
import pytest
import torch
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.field import DEFAULT, Normalisation
from autophyx_tet.predictors.film.predictor import FilmPredictor, load_checkpoint
from autophyx_tet.predictors.film.unet import FilmUNet, NetworkConfig
from autophyx_tet.predictors.film.words import CHANNELS
from autophyx_tet.predictors.grid import Grid, PartVoxels
from autophyx_tet.research.evaluation.parser import listen
from autophyx_tet.research.training.film.recipe import save_checkpoint
from safetensors import safe_open
from safetensors.torch import save_file

SMALL = NetworkConfig(
    widths=(8, 8, 8, 8, 8), text_dim=4 + len(CHANNELS) + 4, slot_width=16, key_width=8,
    told=True, sentence_dim=4,
)  # fmt: skip
NARROW = Normalisation(log10_E=(5.0, 11.0), nu=(0.1, 0.45), log10_rho=(2.0, 4.0))
TABLE = load_table()

pytestmark = pytest.mark.usefixtures("one_thread")


class Words:
    """An encoder of four numbers."""

    def text(self, sentences):
        """The same for all."""
        return np.full((len(sentences), 4), 0.5, dtype=np.float32)


def block(cells=6) -> PartVoxels:
    part = np.zeros((cells,) * 3, dtype=np.int64)
    return PartVoxels(Grid(np.zeros(3), 0.1, part.shape), part, ("geometry_0",))


def network(normalisation: Normalisation = DEFAULT) -> FilmUNet:
    torch.manual_seed(0)
    return FilmUNet(SMALL, normalisation=normalisation).eval()


def test_a_network_carries_its_ranges(tmp_path):
    """Written by the network's own, or those it is told; read again; kept when it is resaved."""
    save_checkpoint(tmp_path / "a", network(), normalisation=NARROW, facts={"steps": 3})
    read = load_checkpoint(tmp_path / "a")
    assert read.normalisation == NARROW
    save_checkpoint(tmp_path / "b", read)
    assert load_checkpoint(tmp_path / "b").normalisation == NARROW
    save_checkpoint(tmp_path / "c", network())
    assert load_checkpoint(tmp_path / "c").normalisation == DEFAULT


@pytest.mark.slow
def test_a_network_predicts_in_its_own_ranges(tmp_path):
    """The same weights with other ranges: the same numbers in [-1, 1] mean other E, nu and rho."""
    fields = []
    for ranges in (DEFAULT, NARROW):
        save_checkpoint(tmp_path / "film", network(), normalisation=ranges)
        predictor = FilmPredictor(weights=tmp_path / "film", encoder=Words())
        assert predictor.model.network.normalisation == ranges
        fields.append(predictor.field(block(), listen("", TABLE)))
    wide, narrow = (ranges.normalise(f.E, f.nu, f.rho)
                    for ranges, f in zip((DEFAULT, NARROW), fields, strict=True))  # fmt: skip
    np.testing.assert_allclose(wide, narrow, atol=1e-6)
    assert not np.allclose(fields[0].E, fields[1].E, rtol=0.1)


def bound_to_the_first(scene, *_) -> torch.Tensor:
    """Logits that give every cell to the first clause."""
    logits = torch.zeros(1, scene.clauses.shape[1] + 1, *scene.inputs.shape[2:])
    logits[:, 0] = 50.0
    return logits


@pytest.mark.slow
def test_a_named_material_keeps_its_value_in_other_ranges(tmp_path):
    """The lexicon speaks to a network in that network's numbers: oak is oak in either."""
    oak = TABLE.exact("oak").value()
    for ranges in (DEFAULT, NARROW):
        save_checkpoint(tmp_path / "film", network(), normalisation=ranges)
        predictor = FilmPredictor(weights=tmp_path / "film", encoder=Words())
        predictor.model.network.binder.forward = bound_to_the_first
        field = predictor.field(block(), listen("oak legs", TABLE))
        for found, wanted in zip((field.E, field.nu, field.rho), oak, strict=True):
            np.testing.assert_allclose(found, wanted, rtol=1e-4)


def test_other_files_are_no_checkpoint(tmp_path):
    """A file without the ranges, or no weights at all, is refused by its name."""
    save_checkpoint(tmp_path / "a", network())
    with safe_open(tmp_path / "a", framework="pt") as file:
        facts = {"network": file.metadata()["network"]}
        tensors = {key: file.get_tensor(key) for key in file.keys()}
    save_file(tensors, tmp_path / "b", metadata=facts)
    save_file(tensors, tmp_path / "c", metadata=facts | {"normalisation": json.dumps({"x": 1})})
    (tmp_path / "d").write_text("no weights")
    for name in "bcd":
        with pytest.raises(InputError, match="not a"):
            load_checkpoint(tmp_path / name)
