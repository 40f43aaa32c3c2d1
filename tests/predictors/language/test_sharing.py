"""Sharing out: what is said of all parts together decides which matter each is of."""

import itertools
import math

import numpy as np
import pytest
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.text import tagger
from autophyx_tet.predictors.text.reader import read_sentence
from autophyx_tet.predictors.text.tagger import Said, stretches, with_second_opinion, words_of
from hypothesis import given
from hypothesis import strategies as st

TABLE = load_table()


def moves(chosen, kinds, weights):
    """What the order and the names of an assignment are worth, as its definition says."""
    total, last, owners, taken = 0.0, -1, set(), set()
    for part, c in enumerate(chosen):
        if c is None:
            total += weights["none"]
            continue
        step = c - last
        move = "next" if step == 1 else "later" if step > 1 else "same" if step == 0 else "earlier"
        total += weights["alike" if (c, kinds[part]) in owners else move]
        owners.add((c, kinds[part]))
        taken.add(c)
        last = c
    return total, taken


@given(
    st.integers(1, 3), st.integers(1, 2), st.integers(0, 2**32 - 1),
    st.lists(st.booleans(), min_size=3),
)  # fmt: skip
def test_chances_are_those_of_all_assignments(parts, count, seed, same):
    """Where the search keeps every assignment its chances are the sums over all of them."""
    rng, weights = np.random.default_rng(seed), tagger.load_sharing()
    score, unclaimed = rng.normal(size=(parts, count)), rng.uniform(0, 2, count)
    kinds = ["a" if alike else str(i) for i, alike in zip(range(parts), same, strict=False)]
    wanted = np.zeros((parts, count + 1))
    for chosen in itertools.product([*range(count), None], repeat=parts):
        total, taken = moves(chosen, kinds, weights)
        total += sum(score[i, c] for i, c in enumerate(chosen) if c is not None)
        total += sum(unclaimed[c] for c in taken)
        for i, c in enumerate(chosen):
            wanted[i, count if c is None else c] += math.exp(total)
    wanted /= wanted.sum(axis=1, keepdims=True)
    # 27 assignments at most, of which 40 are kept; sums of exponentials in doubles
    assert tagger._chances(score, unclaimed, kinds, weights) == pytest.approx(wanted, abs=1e-9)


def heard(text, *chances):
    """What a tagger says that gives words of a text these chances, a list a part."""
    places = words_of(text)
    return [
        Said((), 1.0, matter=tuple(own.get(text[a:b], 0.0) for a, b in places)) for own in chances
    ]


def test_a_stretch_ends_where_the_parts_do():
    """Words of one matter are together; of two parts each has its own."""
    text = "oak brass, soft foam"
    every = heard(text, {"oak": 0.9}, {"brass": 0.9}, {"soft": 0.4, "foam": 0.9})
    found = [text[s.start : s.end] for s in stretches(text, every, ())]
    assert found == ["oak", "brass", "soft foam"]


@pytest.mark.parametrize(
    ("text", "parts", "rows"),
    [
        ("Flansch 1.4404, Sitz PTFE, Gewindewelle CuSn12", "flange seat stem", "316 PTFE tin"),
        ("Corps fonte GS, soufflet EPDM, rotule laiton", "body boot joint", "ductile EPDM brass"),
        ("cuerpo latón, fuelle EPDM, rótula nylon", "body bellows ball_joint", "brass EPDM nylon"),
        ("Rahmen S235, Wangen Eiche, Trittleiste Gummi", "frame stringer tread", "S235 oak rubber"),
    ],
)  # fmt: skip
def test_no_matter_is_said_for_nothing(text, parts, rows):
    """Parts that are called otherwise in the text have what the others leave."""
    labels = [[name] for name in parts.split()]
    bound = with_second_opinion(read_sentence(text, labels, TABLE), labels, TABLE)
    for part, row in zip(bound.parts, rows.split(), strict=True):
        assert any(row in (bound.sentence.clauses[k].material or "") for k in part.clauses), row


def test_who_names_all_parts_keeps_them():
    """Sharing out moves nothing that names bind, whatever the file's order."""
    text = "the legs are oak, the seat is soft foam, the frame is steel, the glides are nylon"
    names = ["leg_1", "leg_2", "seat", "frame", "glide_1"]
    for order in itertools.permutations(range(5)):
        labels = [[names[i]] for i in order]
        bound = read_sentence(text, labels, TABLE)
        own = [own[0] for own in labels]
        said = tagger.load_tagger().said(own, text)
        shared = tagger.shared_out(said, bound, own)
        assert not any(one.moved for one in shared)


def test_a_gloss_has_the_places_of_its_words():
    """Every word there stands for one here, in their order; English has no gloss."""
    text = "Gehäuse aus Edelstahl 1.4301, Deckel Eiche 12 mm"
    gloss = read_sentence(text, [["housing"], ["lid"]], TABLE).sentence.gloss
    assert gloss.text.startswith("housing of ")
    said = {text[c:d]: gloss.text[a:b] for a, b, c, d in gloss.places}
    assert (said["Gehäuse"], said["Deckel"], said["Eiche"]) == ("housing", "lid", "oak")
    assert [p[0] for p in gloss.places] == sorted(p[0] for p in gloss.places)
    english = "the housing is stainless steel"
    assert read_sentence(english, [["housing"]], TABLE).sentence.gloss is None
