"""No sentence ends a command with exit code 2, whatever it leaves open."""

import itertools
import tomllib

import autophyx_tet as apx
import numpy as np
import pytest
import trimesh
from autophyx_tet.converters.mesh.meshdata import write_mesh
from autophyx_tet.fem.errors import AutophyxError
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.asset import Asset, Part
from autophyx_tet.predictors.film.predictor import FilmModel

from .command import run_here

# Parts that no text speaks of, one that has no word for its matter and one that has: both open.
OPEN = (("gizmo", ()), ("widget", ("Metal_dark",)))
COLOURS = np.random.default_rng(0).integers(0, 256, (64, 4), dtype=np.uint8)


def thing(*names: str) -> tuple[TetMesh, Asset]:
    """Coloured boxes of 0.1 m in a row, one a name and then the open ones, and their mesh."""
    labels = {**dict.fromkeys(names, ()), **dict(OPEN)}
    boxes = [box_mesh((0.1, 0.1, 0.1), (1, 1, 1), lo=(0.2 * i, 0, 0)) for i in range(len(labels))]
    count = len(boxes[0].points)
    mesh = TetMesh(
        np.concatenate([box.points for box in boxes]),
        np.concatenate([box.tets + count * i for i, box in enumerate(boxes)]),
        region=np.repeat(np.arange(len(boxes)), len(boxes[0].tets)),
        region_names=tuple(labels),
    )
    parts = []
    for i, (name, words) in enumerate(labels.items()):
        box = trimesh.creation.box((0.1, 0.1, 0.1))
        box.apply_translation((0.2 * i + 0.05, 0.05, 0.05))
        box.visual.face_colors = COLOURS[i % len(COLOURS)] | (0, 0, 0, 255)
        parts.append(Part(name, box, words))
    return mesh, Asset("thing", tuple(parts))


def refused(text: str, *names: str) -> str:
    """What ``assign`` with the predictor of its defaults says against a text, "" for nothing."""
    mesh, asset = thing(*names)
    try:
        apx.assign(mesh, text, asset=asset, cells=2 * len(mesh.region_names))
    except AutophyxError as error:
        return f"{text[:80]!r}: {type(error).__name__}: {error}"
    return ""


def sentences(root):
    """Text and part names of every sentence of the sets that are not held out."""
    for path in sorted((root / "benchmarks" / "data").glob("sentences_*.toml")):
        for one in tomllib.loads(path.read_text(encoding="utf-8"))["sentence"]:
            yield one["text"], tuple(one["parts"])


@pytest.fixture
def any_answer(monkeypatch):
    """Whatever the network may find, in no time: 1,200 runs of it take twenty minutes."""
    draw = np.random.default_rng(1)

    def run(_, scene, __, turns):
        (x, y, z), slots = scene.inputs.shape[2:], scene.clause_mask.shape[1] + 1
        shares = draw.dirichlet(np.full(slots, 0.3), (x, 1, 1))
        values = draw.uniform(-1, 1, (turns, x, 1, 1, 3))
        return np.tile(values, (1, 1, y, z, 1)), np.tile(shares, (1, y, z, 1))

    monkeypatch.setattr(FilmModel, "_run", run)


@pytest.mark.slow
@pytest.mark.blockers
@pytest.mark.usefixtures("any_answer")
@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("PP seat", "seat"),
        ("the seat is PC", "seat"),
        ("EN AW-6082 legs", "leg"),
        ("chromed legs", "leg"),
        ("bamboo stalks", "leg"),
        ("the candles are wax", "seat"),
    ],
)
def test_a_material_is_one_of_the_table_however_it_is_written(text, part):
    assert not refused(text, part)


@pytest.mark.long
@pytest.mark.blockers
@pytest.mark.usefixtures("any_answer")
def test_no_sentence_of_any_set_is_refused(root):
    """Every hundredth of them: all take an hour."""
    every = list(sentences(root))
    assert len(every) > 1000
    found = [refused(text, *names) for text, names in every[::100]]
    assert not [line for line in found if line]


@pytest.mark.long
@pytest.mark.blockers
@pytest.mark.usefixtures("any_answer")
def test_no_name_of_the_table_is_refused():
    """Some 450 names and aliases, as "the X leg" and as "X seat", twenty a text."""
    phrases = sorted({p for row in load_table() for p in (row.name, *row.aliases)})[::60]
    found = []
    for at in range(0, len(phrases), 20):
        batch = phrases[at : at + 20]
        names = [f"{('leg', 'seat')[i % 2]}_{i}" for i in range(len(batch))]
        said = (
            f"the {phrase} leg {i}" if i % 2 == 0 else f"{phrase} seat {i}"
            for i, phrase in enumerate(batch)
        )
        found.append(refused("; ".join(said), *names))
    assert not [line for line in found if line]


@pytest.mark.long
@pytest.mark.blockers
def test_no_sentence_ends_the_command_with_exit_code_2(root, tmp_path):
    """A sample of the sets, by the command with its defaults and the asset beside the mesh."""
    codes = {}
    for text, names in itertools.islice(sentences(root), 0, None, 800):
        mesh, asset = thing(*names)
        write_mesh(tmp_path / "thing.msh", mesh)
        scene = trimesh.Scene({part.name: part.mesh for part in asset.parts})
        scene.export(tmp_path / "thing.glb")
        codes[text] = run_here(
            "assign", tmp_path / "thing.msh", "--asset", tmp_path / "thing.glb",
            "--text", text, "-o", tmp_path / "out.msh",
        )  # fmt: skip
    assert not {text: done.stderr for text, done in codes.items() if done.returncode}
