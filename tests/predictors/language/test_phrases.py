"""The phrase network: rows of words that no list has, and what it writes it reads."""

import numpy as np
import pytest
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.encoders.minilm import MiniLM
from autophyx_tet.predictors.text.phrases import WEIGHTS, PhraseNetwork, features, load_phrases

# E [Pa] and rho [kg/m3] of matters by data sheets and handbooks.
STEEL, CAST, BRONZE = (
    (1.85e11, 2.2e11, 7600, 8000),
    (1.5e11, 1.85e11, 7000, 7350),
    (0.95e11, 1.3e11, 8500, 9000),
)
NEW = {
    "CuSn12Ni2-C-GS": BRONZE,
    "EN-GJS-600-3U": CAST,
    "rolled S420ML plate": STEEL,
    "UNS S32654": STEEL,
    "Stahlblech verzinkt 2 mm": STEEL,
    "tablette en chêne massif ciré": (0.9e10, 1.5e10, 600, 800),
    "crushed walnut shells": (2e9, 1e10, 900, 1350),
    "Buchensperrholzplatte": (0.5e10, 1.5e10, 600, 850),
    "Ti-6Al-4V ELI gr 23": (1.03e11, 1.22e11, 4380, 4480),
    "lambswool felt": (1e5, 1e8, 60, 500),
}  # fmt: skip


@pytest.fixture(scope="module")
def learned_from():
    from autophyx_tet.research.training.phrases.recipe import phrases_of

    return phrases_of(load_table())


@pytest.mark.parametrize("phrase", NEW)
def test_what_no_list_has_means_a_row(phrase, learned_from):
    """Its E and rho are those of the handbooks; it was not learned by heart."""
    assert phrase.lower() not in {known.text.lower() for known in learned_from}
    meant = load_phrases().meant(phrase)
    row, (least, most, light, heavy) = load_table().exact(meant.row), NEW[phrase]
    assert meant.share > 0.4
    assert least <= (row.E.min * row.E.max) ** 0.5 <= most
    assert light <= (row.rho.min * row.rho.max) ** 0.5 <= heavy


@pytest.mark.parametrize("phrase", ["stuff from my attic", "thing", "blue"])
def test_words_of_no_matter_mean_no_row(phrase):
    assert load_phrases().meant(phrase).row == ""


def test_the_weights_are_small_and_know_the_table():
    assert WEIGHTS.stat().st_size < 3e6
    known = {row.name for row in load_table()}
    assert len({*load_phrases().rows} - known - {""}) == 0
    assert len(known - {*load_phrases().rows}) < 0.02 * len(known)


def test_spaces_do_not_matter_and_capitals_do():
    assert features(" grey  iron ") == features("grey iron")
    assert features("Co") != features("CO")


@pytest.mark.slow
def test_numpy_reads_what_torch_trains(tmp_path):
    """A few steps learn something; a byte a number changes no share by a hundredth."""
    import torch
    from autophyx_tet.research.training.phrases.recipe import train_phrases

    learned = train_phrases(steps=200, batch=64, output=tmp_path / "phrases.safetensors")
    assert learned.history[-1]["loss"] < 0.8 * np.log(len(learned.rows))  # of chance
    network = PhraseNetwork(tmp_path / "phrases.safetensors")
    places, senses = [features(phrase) for phrase in NEW], MiniLM().text([*NEW])
    with torch.no_grad():
        shares = learned.network(places, senses).softmax(-1).numpy()
    for phrase, own in zip(NEW, shares, strict=True):
        meant = network.meant(phrase)
        assert meant.row == learned.rows[own.argmax()]
        assert meant.share >= own.max() - 0.01


def test_a_designation_from_no_list_is_read():
    from autophyx_tet.predictors.text.reader import read_sentence
    from autophyx_tet.predictors.text.tagger import with_second_opinion

    labels, table = [["retaining_ring"], ["wear_plate"]], load_table()
    text = "retaining ring CuSn12Ni2-C-GS, wear plate Hardwearalloy QX9"
    bound = with_second_opinion(read_sentence(text, labels, table), labels, table)
    rows = {bound.sentence.clauses[k].material for k in bound.parts[0].clauses}
    assert any(row and "bronze" in row for row in rows)
