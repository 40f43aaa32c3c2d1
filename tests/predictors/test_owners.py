"""Training of the network of things in one piece: its questions, and the two forward passes."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from autophyx_tet.predictors.text import one_piece
from autophyx_tet.predictors.text.tagger import load_tagger
from autophyx_tet.research.datasets.natural import Meant, Natural
from autophyx_tet.research.training.owners import (
    RANK,
    THINGS,
    OwnerSampler,
    batch_of,
    encoded,
    of_natural,
    of_template,
    of_thing,
    owner_loss,
)
from autophyx_tet.research.training.tagger.recipe import TaggerNetwork, save_learned
from autophyx_tet.research.training.tagger.templates import marked_template

TEXT = "Fruit bowl of walnut, the rim and the foot brass, soil inside."
SAID = Natural(
    "Scopia", 0, TEXT,
    (
        Meant("bowl", "walnut", ("a",)), Meant("rim and the foot", "brass", ("b", "c")),
        Meant("soil", "", ("d",)),
    ),
)  # fmt: skip
MARKED = """# en | lid, box
Lid {lid|m:oak}, not {lid|x:teak}; {box|m:zinc} for the box; a steel table stands by"""


def words(text: str, place: tuple[int, int]) -> str:
    return text[slice(*place)]


def test_a_hand_says_what_is_meant_and_what_names_it():
    found = {
        words(TEXT, one.matter): (one.meant, tuple(words(TEXT, p) for p in one.parts or ()))
        for one in of_natural(SAID)
    }
    assert found == {
        "Fruit": (False, ()), "walnut": (True, ("bowl",)), "brass": (True, ("rim and the foot",)),
        "soil": (True, ("soil",)),
    }  # fmt: skip


def test_a_marked_text_says_what_is_meant_and_what_names_it():
    template = marked_template(MARKED)
    found = {
        words(template.text, one.matter): (
            one.meant, one.parts and tuple(words(template.text, p) for p in one.parts)
        )
        for one in of_template(template) if not one.name
    }  # fmt: skip
    assert found == {
        "oak": (True, ("Lid",)), "teak": (False, None), "zinc": (True, ("box",)),
        "steel": (False, None),
    }  # fmt: skip
    # And of a file that has but one of the parts
    named = {words(template.text, x.matter): x.meant for x in of_template(template) if x.name}
    (only,) = {one.name for one in of_template(template) if one.name}
    assert named == {
        "oak": only == "lid", "zinc": only == "box", "teak": False, "steel": False,
    }  # fmt: skip


def test_of_one_thing_every_matter_is_told():
    line = (
        '{"name": "roller_2", "text": "PEEK tyre on a steel hub, steel pin by others",'
        ' "matters": [["PEEK", 1, "tyre"], ["steel", 1, "hub"], ["steel", 0, "pin"]]}'
    )
    found = [*of_thing(line)]
    assert [(one.matter[0], one.meant) for one in found] == [(0, True), (15, True), (26, False)]
    assert [words(one.text, place) for one in found for place in one.parts] == [
        "tyre", "hub", "pin",
    ]  # fmt: skip
    lines = THINGS.read_text("utf-8").splitlines()
    assert all([*of_thing(each)] for each in lines)


@pytest.fixture(scope="module")
def asked():
    asked = [one._replace(name="object") for one in of_natural(SAID)]
    return encoded(asked, load_tagger()._tokenizer)


def test_a_batch_marks_the_matter_and_never_as_the_text(asked):
    batch = batch_of(asked, "cpu")
    assert not (batch.own & (batch.types == 1)).any()
    assert batch.own.any(dim=1).all()
    assert (batch.named[batch.types == 1] >= 0).sum() == sum(
        len(one.text) - (one.own.stop - one.own.start) for one in asked if one.meant
    )


def test_another_matter_stands_where_it_stood(asked):
    sampler = OwnerSampler([asked], [[5]], seed=3, device="cpu")
    varied = [sampler._varied(asked[1]) for _ in range(40)]
    assert len({tuple(one.words) for one in varied}) > 1
    for one in varied:
        assert one.text[one.own] == one.words
        assert len(one.text) == len(one.named)
        # the words for the part are those that they were
        named = [token for token, label in zip(one.text, one.named, strict=True) if label == 1]
        assert named == [t for t, x in zip(asked[1].text, asked[1].named, strict=True) if x == 1]
    # some have their name withheld, but never where it is what the text is asked about
    assert {tuple(one.name) for one in varied} == {tuple(asked[1].name), (5,)}
    assert all(sampler._varied(asked[1], part=True).name == asked[1].name for _ in range(40))


@pytest.mark.slow
def test_numpy_finds_what_torch_trains_and_it_learns(asked, tmp_path, monkeypatch):
    torch.manual_seed(0)
    weights = {name: torch.from_numpy(x.copy()) for name, x in load_tagger()._weights.items()}
    network = TaggerNetwork(weights, roles=2, rank=RANK, word_rank=0).eval()
    batch = batch_of(asked, "cpu")
    learned = [p for p in network.parameters() if p.requires_grad]
    optimizer, losses = torch.optim.AdamW(learned, lr=2e-3), []
    for _ in range(25):
        logits = network.logits(batch.tokens, batch.types, batch.seen)
        loss = owner_loss(logits, batch).total
        losses.append(float(loss.detach()))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    assert losses[-1] < losses[0] / 10  # four questions are learned by heart
    with torch.no_grad():
        logits = network.logits(batch.tokens, batch.types, batch.seen)
        own = batch.own.float()
        chance = ((logits[..., 1] * own).sum(1) / own.sum(1)).sigmoid().numpy()
    save_learned(network, tmp_path / "one_piece.safetensors")
    monkeypatch.setattr(one_piece, "OWNERS", tmp_path / "one_piece.safetensors")
    found = one_piece.OwnerFinder().owners(TEXT, [one.matter for one in of_natural(SAID)], "object")
    finder, places = one_piece.OwnerFinder(), [one.matter for one in of_natural(SAID)]
    unnamed, named = ([x[0] for x in finder._asked(TEXT, places, n)] for n in ("object", "vase"))
    both = [one.chance for one in finder.owners(TEXT, places, "vase")]
    assert not np.allclose(unnamed, named)
    odds = (np.array(unnamed) + named) / 2
    np.testing.assert_allclose(both, 1 / (1 + np.exp(-odds)), rtol=1e-5)
    # bytes in place of single precision: a hundredth of a chance
    np.testing.assert_allclose([one.chance for one in found], chance, atol=0.02)
    assert [[words(TEXT, p) for p in one.parts] for one in found[1:3]] == [
        ["bowl"],
        ["rim and the foot"],
    ]
