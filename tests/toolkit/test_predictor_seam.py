"""The seams of predictors and encoders, as a user of the verbs meets them."""

import json
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import autophyx_tet as apx
import numpy as np
import pytest
import trimesh
from autophyx_tet.converters.mesh.meshdata import write_mesh
from autophyx_tet.fem.errors import UsageError
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.film import words as statement
from autophyx_tet.predictors.prediction import PartChoice, Prediction
from autophyx_tet.predictors.predictor import PREDICTORS, Predictor
from autophyx_tet.predictors.text import reader
from autophyx_tet.toolkit.cli.main import main
from autophyx_tet.toolkit.options import AssignOptions, FeatureOptions

LEAD = load_table().exact("lead")


def two_regions() -> TetMesh:
    """A bar along x of two regions that no word names."""
    box = box_mesh((2, 1, 1), (4, 2, 2))
    region = (box.centroids[:, 0] > 1).astype(int)
    return TetMesh(box.points, box.tets, region, ("mat_1", "seat"))


class Leaden:
    """A toy predictor: what words leave open is lead, as stiff as the dial says."""

    name: ClassVar[str] = "leaden"
    takes_alpha: ClassVar[bool] = True
    takes_samples: ClassVar[bool] = False

    def predict(self, parts, sentence, *, choices=None, appearance=None, up="z", alpha=None):
        """Lead for every open part."""
        place = 0.5 if alpha is None else alpha
        lead = [
            c
            if c.settled
            else PartChoice(c.part, LEAD, LEAD.value(place), 1.0, place, "toy", settled=False)
            for c in choices
        ]
        return Prediction.of(parts, lead, sentence, alpha=alpha)


@pytest.fixture
def toy():
    PREDICTORS.register("leaden", Leaden)
    yield Leaden
    PREDICTORS.unregister("leaden")


def test_a_predictor_is_one_class_and_one_registration(toy):
    """The toy gets what words leave open, and the dial that its kind takes; words stay."""
    assert isinstance(toy(), Predictor)
    options = AssignOptions(predictor="leaden", alpha=1.0, cells=16)
    found = apx.assign(two_regions(), "the seat is soft foam", options=options)
    by_part = {choice.part: choice for choice in found.choices}
    assert by_part["seat"].row is load_table().exact("soft foam")
    assert by_part["mat_1"].value.E == pytest.approx(LEAD.E.max)
    left = found.mesh.region == 0
    assert found.mesh.material is not None
    np.testing.assert_allclose(found.mesh.material.rho[left], LEAD.value().rho)


class Undecided(Leaden):
    """Another toy: an open part may be of any density, so many of them."""

    name: ClassVar[str] = "undecided"
    takes_samples: ClassVar[bool] = True

    def __init__(self, *, samples=0):
        self.samples = samples

    def predict(self, parts, sentence, **known):
        """Lead for every open part, and as often half as heavy, a third ..."""
        made, lead = super().predict(parts, sentence, **known), LEAD.value()
        drawn = tuple(lead._replace(rho=lead.rho / (k + 2)) for k in range(self.samples))
        left_open = {
            i: replace(c, draws=drawn) for i, c in enumerate(made.choices) if not c.settled
        }
        return made.with_choices(left_open)


@pytest.fixture
def undecided():
    PREDICTORS.register("undecided", Undecided)
    yield
    PREDICTORS.unregister("undecided")


@pytest.mark.slow
def test_samples_go_from_assign_to_simulate_by_the_sidecar(undecided, tmp_path, capsys):
    """The open half may weigh a half to a fifth of lead: mass and frequency have intervals."""
    write_mesh(tmp_path / "bar.msh", two_regions())
    given = ["--predictor", "undecided", "--samples", "4", "--part", "seat=steel"]
    m = str(tmp_path / "m.msh")
    assert main(["assign", str(tmp_path / "bar.msh"), *given, "-o", m, "-q"]) == 0
    answers = ["simulate", m, "-o", str(tmp_path / "s.vtu"), "--json", "-q"]
    assert main(answers) == 0
    found = json.loads(capsys.readouterr().out)["sag"]
    likely = found["intervals"]["likely"]
    assert likely["drawn"] == 4
    steel = load_table().exact("carbon steel").rho
    lightest, heaviest = LEAD.value().rho / 5, LEAD.value().rho / 2
    # Each region has 1 m3. The ends of the middle nine tenths lie within those of all.
    assert lightest + steel.min < likely["mass"]["low"] < likely["mass"]["high"]
    assert likely["mass"]["high"] < heaviest + steel.max
    assert any("4 samples" in verdict["sentence"] for verdict in found["verdicts"])


def test_samples_of_who_has_none_are_refused():
    for samples, predictor, said in (
        (4, "film", "--predictor unipixie"),
        (-1, "unipixie", "from 0"),
    ):
        options = AssignOptions(predictor=predictor, samples=samples, cells=8)
        with pytest.raises(UsageError, match=said):
            apx.assign(two_regions(), "", options=options)


def test_unknown_predictors_are_named_in_one_line():
    known = "unknown predictor 'flim': known are film, unipixie, retrieval"
    with pytest.raises(UsageError, match=known):
        apx.assign(two_regions(), "oak", options=AssignOptions(predictor="flim", cells=8))


@pytest.mark.slow
def test_a_sentence_is_read_once_whoever_predicts(monkeypatch):
    """One parse of the text for each call of ``assign``, and no clause of it is read twice.

    Walls too: what a thing is and what it is full of comes from the clauses.
    """
    parsed, read = [], Counter()
    lex, hear = reader.lex, statement.Reader.__call__

    def counted_lexing(text, *others, **options):
        parsed.append(text)
        return lex(text, *others, **options)

    def counted_reading(self, text):
        read[text] += 1
        return hear(self, text)

    monkeypatch.setattr(reader, "lex", counted_lexing)
    monkeypatch.setattr(statement.Reader, "__call__", counted_reading)
    text = "the legs are very soft oak, the seat is squishy"
    for name in PREDICTORS:
        parsed.clear(), read.clear()
        apx.assign(two_regions(), text, options=AssignOptions(predictor=name, cells=8))
        assert parsed.count(text) == 1, name  # a second opinion reads what it says of one part
        assert set(read.values()) <= {1}, name
    option = "soft rubber"
    parsed.clear()
    apx.assign(
        two_regions(),
        text,
        options=AssignOptions(part=(f"seat={option}",), predictor="retrieval", cells=8),
    )
    assert [t for t in parsed if t in (text, option)] == [text, option]
    parsed.clear()
    text = "an aluminium can full of coffee"
    can = apx.assign(
        box_mesh((0.06, 0.06, 0.1), (2, 2, 2)),
        text,
        options=AssignOptions(predictor="retrieval", cells=8),
    )
    assert parsed.count(text) == 1
    assert can.built[0].construction.form == "shell"
    assert can.built[0].construction.filling == "ground coffee (contents)"


@pytest.fixture
def files(tmp_path):
    write_mesh(tmp_path / "bar.msh", two_regions())
    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "box.obj")
    return tmp_path


def test_an_unknown_encoder_is_refused_before_the_work(files, capsys):
    """Exit code 2, one line with the known names, nothing written; also where none is needed."""
    words = ["--text", "oak"]
    known = "embedded, openclip, rgb, occupancy"
    for command, encoder, said in (
        (["assign", "bar.msh", *words, "-o", "out.msh"], "nonsense", known),
        (["assign", "bar.msh", *words, "-o", "out.msh"], "rgb:3", "takes nothing after a colon"),
        (["assign", "bar.msh", *words, "-o", "out.msh"], "rgb", "reads no words"),
        (["run", "box.obj", *words, "-o", "out"], "nonsense", known),
        (["features", "box.obj", "-o", "out.npz"], "nonsense", known),
    ):
        verb, source, *rest = command
        rest[-1] = str(files / rest[-1])
        assert main([verb, str(files / source), *rest, "--encoder", encoder]) == 2, command
        error = capsys.readouterr().err
        assert said in error, command
        assert error.count("\n") == 1, command
    assert {path.name for path in files.iterdir()} == {"bar.msh", "box.obj"}
    for options in (AssignOptions(encoder="clap"), FeatureOptions(encoder="clap")):
        with pytest.raises(UsageError, match=known):
            options.checked()
    tagged = AssignOptions(encoder="openclip:some_tag")
    assert tagged.checked() is tagged


@pytest.mark.slow
def test_stated_numbers_go_from_assign_to_simulate_as_exact(tmp_path, capsys):
    """What the user said in numbers is not widened to its row's range; what was not said is."""
    write_mesh(tmp_path / "bar.msh", two_regions())
    numbers = "E = 200 GPa, nu = 0.3, density 7850 kg/m3"
    for text, known in ((f"all steel, {numbers}", None), ("all steel, density 7850 kg/m3", 0.0)):
        m = str(tmp_path / "m.msh")
        assert main(["assign", str(tmp_path / "bar.msh"), "--text", text, "-o", m, "-q"]) == 0
        assert main(["simulate", m, "-o", str(tmp_path / "s.vtu"), "--json", "-q"]) == 0
        found = json.loads(capsys.readouterr().out)["sag"]["intervals"]
        part, *_ = json.loads(Path(f"{m}.json").read_text())["record"]["assign"]["parts"]
        assert part["ranges"]["rho"] == {"min": 7850.0, "max": 7850.0}
        if known is None:
            assert found is None
        else:
            assert found["mass"]["high"] == pytest.approx(found["mass"]["low"], rel=1e-12)
            assert found["max_displacement"]["high"] > 1.05 * found["max_displacement"]["low"]
