"""The span tagger: made texts, the two forward passes, windows, and what it says of texts."""

from __future__ import annotations

import random
import re

import numpy as np
import pytest
from autophyx_tet.research.training.tagger.generator import (
    EXCLUDED,
    LANGUAGES,
    MATTER,
    NUMBER,
    Generator,
    pairs,
)

MATERIALS = ["oak", "mild steel", "soft foam"]
LEXICON = {
    language: {"matter": ["Eiche", "Stahl"], "parts": {"leg": ["Bein"], "seat": ["Sitz"]}}
    for language in LANGUAGES
}


@pytest.mark.slow
def test_spans_of_made_texts_are_words_of_their_text_and_owned_by_parts_of_the_asset():
    maker = Generator(MATERIALS, LEXICON, 3)
    for _ in range(300):
        example = maker.example()
        assert len(set(example.names)) == len(example.names)
        assert not re.search(r"[{}<>]", "".join(example.names))
        assert not re.search(r"\{[A-Z]?\d?=|<mat>|<#", example.text)
        for span in example.spans:
            said = example.text[span.start : span.end]
            assert said == said.strip() != ""
            assert {*span.owners} <= {*range(len(example.names))}


@pytest.mark.slow
def test_a_made_text_tells_apart_what_a_part_is_and_what_it_is_not():
    """Each form of replacement has both; and one word is never both for one part."""
    maker, seen = Generator(MATERIALS, LEXICON, 5), 0
    for _ in range(400):
        example = maker.example()
        for _, own in pairs(example, random.Random(1)):
            roles = {role: {s[:2] for s in own if s.role == role} for role in (MATTER, EXCLUDED)}
            assert not roles[MATTER] & roles[EXCLUDED]
            seen += bool(roles[MATTER] and roles[EXCLUDED])
    assert seen > 20


def test_the_same_seed_makes_the_same_texts_and_another_others():
    one, same, other = (Generator(MATERIALS, LEXICON, seed) for seed in (7, 7, 8))
    texts = [[maker.example() for _ in range(20)] for maker in (one, same, other)]
    assert texts[0] == texts[1] != texts[2]


@pytest.mark.slow
def test_all_languages_and_roles_are_made():
    maker, languages, roles = Generator(MATERIALS, LEXICON, 11), set(), set()
    for _ in range(600):
        roles |= {span.role for span in maker.example().spans}
        languages.add(maker.language)
    assert languages == {"en", *LANGUAGES}
    assert roles == {MATTER, NUMBER, 3, 4, EXCLUDED, 6, 7}


@pytest.mark.slow
@pytest.mark.parametrize("full", [False, True])
def test_numpy_reads_what_torch_trains(full, tmp_path):
    """Both passes give the same roles, to the half precision of the weights' file."""
    import torch
    from autophyx_tet.predictors.encoders.minilm import packaged_weights
    from autophyx_tet.predictors.text.tagger import Tagger, asked
    from autophyx_tet.research.training.tagger.recipe import (
        PAD,
        QUESTION,
        Batch,
        TaggerNetwork,
        save_learned,
    )
    from safetensors.torch import load_file

    torch.manual_seed(0)
    network = TaggerNetwork(load_file(packaged_weights() / "model.safetensors"), full=full).eval()
    with torch.no_grad():
        for up in network.up.values():
            up.normal_(0, 0.02)
    save_learned(network, tmp_path / "learned.safetensors")
    tagger = Tagger(learned=(tmp_path / "learned.safetensors",))
    ask, text = [4190, 102, 3509], [1996, 4190, 2024, 6116]
    found = tagger._roles([ask, [3509]], text)[0]
    row, head = asked(ask, text)
    roles = [[QUESTION] * head + [0] * len(text) + [QUESTION, PAD]]
    with torch.no_grad():
        logits = network(Batch(torch.tensor([[*row, 0]]), torch.tensor(roles)))
    wanted = logits.softmax(-1)[0, head : head + len(text)].numpy()
    assert np.allclose(found, wanted, atol=1e-3)


TEXT = "the legs are oak, the seat is soft foam; everything else is steel"


def said(names: str, text: str) -> list[str]:
    """The words that the shipped tagger finds to decide each part's material."""
    from autophyx_tet.predictors.text.tagger import load_tagger

    found = load_tagger().said(names.split(), text)
    return [
        " ".join(text[w.start : w.end] for w in one.words if w.role in ("matter", "number"))
        for one in found
    ]


def test_the_shipped_tagger_tells_parts_what_is_said_of_them():
    assert said("seat leg_1 leg_2 back", TEXT) == ["soft foam", "oak", "oak", "steel"]
    assert said("pawl gear", "pawl Ck45, gear: illegible on the microfilm") == ["Ck45", ""]
    assert said("asiento pata_1", "la pata es de roble y lo demás de cuero") == ["cuero", "roble"]


@pytest.mark.slow
def test_what_stands_far_away_in_a_long_text_changes_nothing():
    """Windows: 3,000 characters of facts about nothing, before and after."""
    facts = "It was delivered on a Monday and everybody liked it. " * 30
    assert said("seat leg_1 leg_2 back", f"{facts}{TEXT}. {facts}") == said(
        "seat leg_1 leg_2 back", TEXT
    )


def test_sentences_of_the_sets_are_templates_whose_marks_move_with_their_words():
    import random

    from autophyx_tet.research.training.tagger.generator import MATTER, Generator, pairs
    from autophyx_tet.research.training.tagger.recipe import made_from
    from autophyx_tet.research.training.tagger.templates import TemplateTexts, load_templates

    every = load_templates()
    assert len(every) > 1300
    assert {t.text for t in load_templates(["tenth_trades"])} < {t.text for t in every}
    for one in every:
        for span in one.spans:
            assert one.text[span.start : span.end].strip()
            assert {*span.owners} <= {*range(len(one.names))} - one.skip
    makers = [TemplateTexts(every, Generator(*made_from(), seed=3), seed=4) for _ in range(2)]
    texts, told = [maker.example() for maker in makers * 200], 0
    assert texts[::2] == texts[1::2]  # of one seed
    for example in texts:
        for i, spans in pairs(example, random.Random(0)):
            told += any(span.role == MATTER for span in spans)
            assert i not in example.skip
            for span in spans:
                said = example.text[span.start : span.end]
                assert said == said.strip(" ,;:\n") != ""
    assert told > 600
