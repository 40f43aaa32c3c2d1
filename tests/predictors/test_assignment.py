"""Words settle what they can; the network divides and fills what they leave open."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from autophyx_tet.fem.errors import UsageError
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.assign import predict_materials
from autophyx_tet.predictors.film.predictor import (
    Calibration,
    Certainty,
    FilmModel,
    FilmPredictor,
    Inference,
)
from autophyx_tet.predictors.film.words import HintedEncoder, overlap, unbound_clauses
from autophyx_tet.predictors.grid import Grid, PartVoxels
from autophyx_tet.predictors.partition import SPECK, partition
from autophyx_tet.predictors.prediction import Prediction
from autophyx_tet.predictors.resolve.resolve import Lookup, lookup_of
from autophyx_tet.predictors.text.clauses import Clause, Subject
from autophyx_tet.predictors.text.parts import NamedPart, vocabulary_of
from autophyx_tet.predictors.text.reader import read_sentence
from autophyx_tet.research.datasets.objects import make_objects
from autophyx_tet.research.datasets.shapes import EMPTY, rasterise
from autophyx_tet.research.evaluation.parser import listen

TABLE = load_table()
WORDS = vocabulary_of(TABLE)


def block(*names: str, cells: int = 8) -> PartVoxels:
    """A block whose parts are slabs along x."""
    part = np.repeat(np.arange(len(names)), cells)[:, None, None]
    part = np.broadcast_to(part, (len(part), cells, cells)).copy()
    return PartVoxels(Grid(np.zeros(3), 0.01, part.shape), part, names)


class Model(FilmModel):
    """Finds the same everywhere, and counts how often it is asked."""

    def __init__(self, found: Inference | None = None) -> None:
        super().__init__()
        self.found, self.asked = found, 0

    @property
    def words(self) -> HintedEncoder:
        return HintedEncoder(NoEncoder())

    def infer(self, parts, heard, **_) -> Inference:
        """Return what is found, with what is heard of the sentence beside it."""
        self.asked += 1
        assert self.found is not None
        return self.found._replace(of_pieces=heard.of_pieces, unbound=heard.unbound)


class NoEncoder:
    """Words as vectors of one number: what is bound to what is no matter of likeness here."""

    def text(self, sentences) -> np.ndarray:
        return np.ones((len(sentences), 1), dtype=np.float32)


def assigned(parts: PartVoxels, text: str, **options) -> Prediction:
    """The materials of parts under a text."""
    return predict_materials(parts, read_sentence(text, parts.part_labels, TABLE), **options)


def network(found: Inference | None = None) -> FilmPredictor:
    """The predictor over such a model."""
    predictor = FilmPredictor()
    predictor.model = Model(found)
    return predictor


def test_the_network_is_not_asked_where_words_settle_everything():
    for names, text in (
        (("leg", "seat"), "the legs are oak, the seat is soft foam"),
        (("geometry_0",), "oak"),
        (("geometry_0",), "a steel bracket"),
        (("chair",), "an oak chair"),
        (("leg", "seat"), "foam seat, the rest is steel"),
        (("mat_3", "Metal_Chrome"), "the rest is rubber"),
    ):
        film = network()
        found = assigned(block(*names), text, predictor=film)
        assert film.model.asked == 0, text
        assert found.parts.part_names == names
        assert all(choice.settled for choice in found.choices), text


def test_clauses_about_parts_that_the_asset_lacks_are_known():
    for names, text, lost in (
        (("geometry_0",), "the legs are oak, the seat is soft foam", 2),
        (("chair",), "an oak chair with steel legs", 1),
        (("geometry_0",), "steel with a rubber grip", 1),
        (("geometry_0",), "the legs are stiff", 1),
        (("leg", "seat"), "the legs are oak, the seat is soft foam", 0),
        (("geometry_0",), "an oak chair", 0),
        (("geometry_0",), "everything is soft", 0),
        (("geometry_0",), "a steel bracket", 0),
    ):
        clauses = listen(text, TABLE).clauses
        parts = [NamedPart.of([name], WORDS, 1.0) for name in names]
        assert len(unbound_clauses(clauses, overlap(clauses, parts))) == lost, text


def halves(parts: PartVoxels, *, speck: bool = False) -> Inference:
    """The lower half is of the first clause, the upper of the second; perhaps one cell is not."""
    shares = np.zeros((*parts.part.shape, 3), dtype=np.float32)
    middle = parts.part.shape[2] // 2
    shares[..., :middle, 0] = shares[..., middle:, 1] = 1
    if speck:
        shares[4:6, 4:6, 1:3] = [0, 0, 1]  # under 1 % of the cells
    values = np.zeros((*parts.part.shape, 3), dtype=np.float32)
    clauses = [
        Clause("oak legs", (0, 8), Subject("parts", (("leg",),)), "oak", "oak"),
        Clause("soft foam seat", (0, 14), Subject("parts", (("seat",),)), "soft foam", "soft foam"),
    ]
    return Inference(clauses, values, shares, np.zeros(parts.part.shape))


@pytest.mark.parametrize("speck", [False, True])
def test_a_part_is_divided_where_two_clauses_speak_of_it(speck):
    """The pieces are the halves, each with the exact values of its material; specks are not."""
    parts = block("blob", cells=12)
    assert not speck or 8 < SPECK * parts.part.size
    found = assigned(
        parts, "oak legs, soft foam seat", predictor=network(halves(parts, speck=speck))
    )
    assert sorted(found.parts.part_names) == ["blob leg", "blob seat"]
    assert found.parents == (0, 0)
    for name, row, cells in (
        ("blob leg", "oak", slice(0, 6)),
        ("blob seat", "soft foam", slice(6, 12)),
    ):
        index = found.parts.part_names.index(name)
        assert (found.parts.part[..., cells] == index).all()
        np.testing.assert_allclose(found.field.E[..., cells], TABLE.exact(row).value().E)
        assert found.choices[index].binding is not None
        assert found.choices[index].binding.share > 0.95


def test_pieces_partition_their_part_and_others_stay():
    """Every cell of an open part is in one piece of it; a settled part is untouched."""
    parts = block("blob", "Metal_Chrome")
    found = halves(parts)
    pieces, parents, owners = partition(parts, [0], found.shares, found.clauses)
    assert len(set(pieces.part_names)) == len(parents) == len(owners) == 3
    np.testing.assert_array_equal(np.array(parents)[pieces.part], parts.part)
    assert owners[1] is None


def test_every_clause_gets_a_part_if_there_are_enough():
    """Two parts that look most like legs, and a sentence about legs and a seat: one is the seat."""
    parts = block("a", "b")
    found = halves(parts)
    shares = np.zeros_like(found.shares)
    shares[parts.part == 0], shares[parts.part == 1] = [0.9, 0.1, 0], [0.6, 0.3, 0.1]
    film = network(found._replace(shares=shares))
    film.certainty = Certainty(Calibration(1.0, 0.0), ((0.5, 1.0),))
    told = assigned(parts, "oak legs, soft foam seat", predictor=film)
    assert [choice.row.name for choice in told.choices] == [
        TABLE.exact("oak").name,
        TABLE.exact("soft foam").name,
    ]
    assert told.parts is parts
    # The first is what its share says, and how often that is right is known; the second is what is
    # left, and nobody measured that.
    first, second = (choice.binding for choice in told.choices)
    assert first.certainty == pytest.approx(0.9, abs=1e-4)  # shares are single precision
    assert "right in about 9 of 10" in told.choices[0].why
    assert second.certainty is None
    assert "right in" not in told.choices[1].why


def test_what_was_not_understood_stays_so_where_the_network_decides():
    """Its values are then the network's own, and still no answer to what was said."""
    parts = block("blob", "leg")
    found = halves(parts)
    shares = np.zeros_like(found.shares)
    shares[..., 2] = 1
    film = network(found._replace(shares=shares))
    told = assigned(parts, "the blob is blarg, the leg is oak", predictor=film)
    blob, leg = told.choices
    assert film.model.asked == 1
    assert told.unbound == ()  # its part is there, and that is told of it
    assert blob.network
    assert not blob.understood
    assert leg.understood


def test_words_are_looked_up_by_one_lookup(monkeypatch):
    """What is embedded for the words serves the predictors too, and the next text."""
    made, init = [], Lookup.__init__

    def noted(*args, **options):
        made.append(args)
        init(*args, **options)

    monkeypatch.setattr(Lookup, "__init__", noted)
    lookup_of.cache_clear()
    for predictor in ("film", "retrieval"):
        assigned(block("leg"), "the legs are oak", predictor=predictor)
    assert len(made) == 1


def test_what_speaks_of_nothing_is_told():
    """No part is called handle, and words settle all parts: the clause is not lost silently."""
    knife, text = block("blade", "grip"), "steel blade, rubber grip, oak handle"
    found = assigned(knife, text, predictor="retrieval")
    assert found.unbound == ("oak handle",)
    assert any("'oak handle'" in doubt for doubt in found.doubts())
    option = {"grip": "oak handle"}  # the way out that the doubt names; now rubber has no part
    found = assigned(knife, text, overrides=option, predictor="retrieval")
    assert found.unbound == ("rubber grip",)
    rest = "steel blade, the rest is rubber"
    assert not assigned(knife, rest, predictor="retrieval").unbound


def test_numbers_of_no_part_are_a_doubt():
    """A modulus that nothing follows is lost; words of a matter alone are a note."""
    parts = block("mount", "sleeve")
    text = "mount rubber; on the sheet the bolt has a modulus of 3 GPa; sleeve steel"
    told = [note.kind for note in assigned(parts, text, predictor="retrieval").doubts()]
    assert "prediction.numbers_idle" in told
    text = "mount rubber; the bolt is brass; sleeve steel"
    told = [note.kind for note in assigned(parts, text, predictor="retrieval").doubts()]
    assert "prediction.part_idle" in told


def test_a_part_that_nothing_names_is_whole():
    """What is said of others by their names is not of its regions."""
    parts = block("skin", "core", "filler", cells=6)
    text = "skin of carbon fibre, a skin of oak; core balsa, core foam; rim steel"
    found = assigned(parts, text, predictor="film")
    assert [name for name in found.parts.part_names if name.startswith("filler")] == ["filler"]


def test_alpha_moves_words_only():
    """--alpha works where words name the material, and says so where they do not."""
    soft = assigned(block("geometry_0"), "oak", alpha=0.0, predictor=network())
    assert soft.choices[0].value.E == pytest.approx(TABLE.exact("oak").E.min)
    text = "the legs are oak and the seat is felt"
    with pytest.raises(UsageError, match=r"--alpha.*'blob'.*--predictor unipixie or retrieval"):
        assigned(block("blob"), text, alpha=0.0, predictor=network())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("category", "text", "named"),
    [
        (
            "chair",
            "oak legs, a soft foam seat and a leather back",
            {0: "leg", 1: "seat", 2: "back"},
        ),
        ("table", "steel legs and a glass top", {0: "leg", 1: "top"}),
    ],
)
def test_a_thing_in_one_piece_is_divided_as_a_person_would(category, text, named):
    """Procedural chairs and tables in one piece without a name: 9 of 10 cells get their clause."""
    made = make_objects(1, np.random.default_rng(3), names=[category])
    label = rasterise(torch.tensor(made.rows), cells=48)[0].numpy().astype(np.int64)
    truth = np.where(label == EMPTY, -1, label)
    parts = PartVoxels(Grid(np.zeros(3), 0.02, truth.shape), np.minimum(truth, 0), ("geometry_0",))
    found = assigned(parts, text, predictor="film")
    right = 0
    for index, word in named.items():
        cells = truth == index
        piece = found.parts.part_names.index(f"geometry_0 {word}")
        right += int((found.parts.part[cells] == piece).sum())
    assert right > 0.9 * (truth >= 0).sum()
