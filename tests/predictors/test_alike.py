"""Parts that are one thing several times get one answer of a predictor, whoever it is."""

from dataclasses import replace

import numpy as np
import pytest
from autophyx_tet.converters.transfer import congruent_regions
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.assign import predict_materials
from autophyx_tet.predictors.field import DEFAULT
from autophyx_tet.predictors.grid import Grid, PartVoxels
from autophyx_tet.predictors.prediction import PartChoice, Prediction
from autophyx_tet.predictors.predictor import PREDICTORS
from autophyx_tet.predictors.resolve.resolve import nearest_row
from autophyx_tet.predictors.text.reader import read_sentence
from scipy.spatial.transform import Rotation

TABLE = load_table()


def regions(*bodies: TetMesh) -> TetMesh:
    """Bodies beside each other, a region each."""
    counts = np.cumsum([0, *(len(body.points) for body in bodies[:-1])])
    return TetMesh.oriented(
        np.concatenate([body.points + np.array([3.0 * i, 0, 0]) for i, body in enumerate(bodies)]),
        np.concatenate([body.tets + first for body, first in zip(bodies, counts, strict=True)]),
        np.repeat(np.arange(len(bodies)), [len(body.tets) for body in bodies]),
        region_names=tuple(f"part {i}" for i in range(len(bodies))),
    )


def wedge(cells=(2, 3, 4)) -> TetMesh:
    """A body with no symmetry: a box that is sheared and tapered."""
    box = box_mesh((0.3, 0.5, 0.9), cells)
    x, y, z = box.points.T
    return replace(box, points=np.stack([x * (1 + z), y * (1 + x / 2) + 0.2 * z, z], axis=1))


def test_shape_is_what_no_rigid_motion_changes():
    """Moved, turned, mirrored and meshed otherwise it is the same; larger by 3 % it is not."""
    turned = Rotation.random(random_state=0).as_matrix()
    body, finer = wedge(), wedge((4, 6, 8))
    mirrored = TetMesh.oriented(body.points * [-1, 1, 1], body.tets)
    larger = replace(body, points=1.03 * body.points)
    mesh = regions(body, replace(finer, points=finer.points @ turned.T), mirrored, larger)
    assert congruent_regions(mesh) == (0, 0, 0, 3)


def test_a_rod_is_no_bar_of_its_radii_of_gyration():
    side, radius = 0.2 * 3**0.5, 0.2
    bar = box_mesh((side, side, 1.0), (2, 2, 8))
    box = box_mesh((2.0, 2.0, 1.0), (12, 12, 8))
    x, y = (box.points[:, :2] - 1).T
    squared = np.maximum(abs(x), abs(y)) / np.maximum(np.hypot(x, y), 1e-9)
    rod = np.stack([radius * squared * x, radius * squared * y, box.points[:, 2]], axis=1)
    assert congruent_regions(regions(bar, replace(box, points=rod))) == (0, 1)


class Whim:
    """A predictor whose answer follows from the cells of a part, and differs between all parts."""

    name, takes_alpha, takes_samples = "whim", False, False

    def predict(self, parts, sentence, *, choices=None, **_):
        assert choices is not None
        decided = list(choices)
        for i, choice in enumerate(choices):
            if choice.settled or i not in parts.part:
                continue
            place = np.argwhere(parts.part == i).mean(axis=0) / 64
            row = nearest_row(TABLE, DEFAULT, place)
            value = row.value(0.5)._replace(E=1e6 * (1 + float(place @ [1, 2, 3])))
            decided[i] = PartChoice(choice.part, row, value, 0.5, 0.5, "whim", settled=False)
        return Prediction.of(parts, decided, sentence)


class Splitter(Whim):
    """The same, that divides every part of it by height into two pieces."""

    def predict(self, parts, sentence, *, choices=None, **_):
        made = super().predict(parts, sentence, choices=choices)
        high = np.arange(parts.part.shape[2]) >= parts.part.shape[2] // 3
        count = len(parts.part_names)
        label = np.where((parts.part >= 0) & high, parts.part + count, parts.part)
        upper = tuple(f"{name} upper" for name in parts.part_names)
        pieces = PartVoxels(parts.grid, label, parts.part_names + upper)
        raised = (replace(c, value=c.value._replace(E=2 * c.value.E)) for c in made.choices)
        chosen = [*made.choices, *(replace(c, part=n) for c, n in zip(raised, upper, strict=True))]
        return replace(
            Prediction.of(pieces, chosen, sentence), parents=(*range(count), *range(count))
        )


def table(names: tuple[str, ...], shapes: tuple[int, ...] = ()) -> PartVoxels:
    """A top on four legs, of which the first is a cell longer."""
    part = np.full((16, 16, 16), -1)
    part[:, :, 13:] = 0
    for i, (x, y) in enumerate(((1, 1), (1, 12), (12, 1), (12, 12))):
        part[x : x + 3, y : y + 3, (0 if i else 1) : 13] = i + 1
    return PartVoxels(Grid(np.zeros(3), 0.05, part.shape), part, names, shapes=shapes)


def answered(parts: PartVoxels, predictor, **options) -> Prediction:
    bound = read_sentence("", parts.part_labels, TABLE)
    return predict_materials(parts, bound, predictor=predictor, **options)


LEGS = ("top", "leg_fl", "leg_fr", "leg_bl", "leg_br")
MUTE = ("Mesh_0", "Mesh_1", "Mesh_2", "Mesh_3", "Mesh_4")


@pytest.mark.parametrize(("names", "shapes"), [(LEGS, ()), (MUTE, (0, 1, 1, 1, 1))])
def test_legs_have_one_answer(names, shapes):
    """Of four legs, alike by name or by shape; not of parts that neither makes alike."""
    made = answered(table(names, shapes), Whim())
    E = [choice.value.E for choice in made.choices]
    assert E[0] != E[1]
    assert E[1:] == E[1:2] * 4
    assert [choice.part for choice in made.choices] == list(names)
    for part, choice in enumerate(made.choices):
        assert (made.field.E[made.parts.part == part] == choice.value.E).all()
    assert (made.parts.part == table(names).part).all()
    apart = answered(table(MUTE), Whim())
    assert len({choice.value.E for choice in apart.choices}) == 5


def test_what_words_say_of_one_leg_stays_its_own():
    made = answered(table(LEGS), Whim(), overrides={"leg_fl": "steel"})
    E = dict(zip(LEGS, (choice.value.E for choice in made.choices), strict=True))
    assert E["leg_fl"] > 1e11
    assert E["leg_fr"] == E["leg_bl"] == E["leg_br"] < 1e8


def test_what_words_leave_open_of_each_is_not_mixed():
    """Three drawers of which words name a matter each, though not for sure, stay apart."""
    names = ("top", "drawer_1", "drawer_2", "drawer_3", "back")
    text = "the first drawer is pine, the second drawer oak and the third one cherry"
    parts = table(names)
    bound = read_sentence(text, parts.part_labels, TABLE)
    made = predict_materials(parts, bound, predictor="retrieval")
    assert len({choice.material for choice in made.choices[1:4]}) == 3


def test_pieces_of_like_parts_are_alike():
    """Each leg is divided as the others, into pieces of its own name and of one matter."""
    made = answered(table(LEGS), Splitter())
    E = {choice.part: choice.value.E for choice in made.choices}
    low, high = ({E[name + end] for name in LEGS[1:]} for end in ("", " upper"))
    assert len(low) == len(high) == 1
    assert high.pop() == 2 * low.pop()
    parent = np.array(made.parents)[made.parts.part]
    whole = table(LEGS).part
    assert (parent[whole >= 0] == whole[whole >= 0]).all()
    assert made.field.part_names == tuple(choice.part for choice in made.choices)


@pytest.mark.slow
@pytest.mark.parametrize("name", list(PREDICTORS))
def test_every_predictor_answers_alike_of_legs(name):
    made = answered(table(MUTE, (0, 1, 1, 1, 1)), PREDICTORS[name]())
    assert len({choice.value for choice in made.choices[1:]}) == 1
