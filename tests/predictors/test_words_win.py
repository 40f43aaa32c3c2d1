"""What a text says is what a part gets, and what is told of a part is what it got."""

import json

import autophyx_tet as apx
import pytest
import trimesh
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.resolve.resolve import Lookup
from autophyx_tet.predictors.text.clauses import bind
from autophyx_tet.predictors.text.reader import parse
from autophyx_tet.toolkit.options import AssignOptions, ConvertOptions

pytestmark = pytest.mark.blockers

TABLE = load_table()
LOOKUP = Lookup(table=TABLE)
# Of plain words; what begins with a letter is written in one ("E-glass") and names no part.
PLAIN = [
    phrase
    for phrase in TABLE.phrases
    if phrase.replace(" ", "").isalpha() and len(phrase.split()[0]) > 1
]
UNKNOWN = """
the unobtainium is xyzzy
it is made of blarg
vibranium
adamantium box
the box is zorblat
a box of plumbite-9
some frobnium
it is quuxite
the box is made from kryptonium
dilithium, maybe
a wibble box
the box is gloopy stuff of type K-99x
wakandite plates
mithril box
carbonadium
promethium-x alloy box
octiron
the box is stonium
handwavium with a dash of phlebotinum
nanobdenum
corbomite
the thing is thiotimoline
tritanium hull
duranium
the box is inertron
ferrocrete-ish flubber
flubber
energon
scrith
bolonium
upsidaisium
balonium
saronite
elerium
cavorite
element zero
orichalcum box
hihiirokane
neutronium shell
aether crystal
xenoplast
plastoid
turbofoam-77
the lid is glimmerstone
ironwoodium
it is steelite
the box is polyfoo
a box in Zytonex 12
cellubond board
Kwazar-42
""".strip().splitlines()


def row_of(text: str, part: str) -> str:
    bound = bind(parse(text, TABLE, [part]), [[part]])
    (choice,) = LOOKUP.settle([[part]], bound).choices
    return choice.row.name


@pytest.mark.slow
def test_a_row_that_is_the_text_wins_over_every_word_of_it_that_names_the_part():
    """``spring_clip.stl`` with "spring steel" is spring steel; so of some thousand phrases."""
    assert row_of("spring steel", "spring_clip") == "spring steel"
    parts = {(phrase, f"{word}_clip") for phrase in PLAIN[::18] for word in phrase.split()}
    found = {(phrase, part): row_of(phrase, part) for phrase, part in parts}
    assert {pair: row for pair, row in found.items() if row != TABLE.phrases[pair[0]].name} == {}


@pytest.mark.parametrize(
    ("part", "text"),
    [
        ("glass_cup", "steel"),
        ("glass", "glass fibre"),
        ("soda", "soda lime glass"),
        ("honey", "honey locust"),
        ("grain", "full grain leather"),
        ("saddle", "saddle leather"),
    ],
)
def test_a_name_is_not_held_against_the_only_thing_that_the_text_speaks_of(part, text):
    assert row_of(text, part) == TABLE.exact(text).name


@pytest.mark.long
def test_what_is_told_of_an_unknown_word_is_what_the_mesh_holds(tmp_path):
    """Texts of words that nobody knows: warning, row, document and mesh name one material."""
    body = box_mesh((0.1, 0.1, 0.1), (2, 2, 2))
    names = {row.name for row in TABLE}
    read_as_unknown = 0
    for number, text in enumerate(UNKNOWN[::4]):
        path = tmp_path / f"{number}.msh"
        made = apx.assign(body, text, output=path, options=AssignOptions(cells=8))
        (choice,), (row,) = made.choices, made.part_rows()
        # "Alloy" is a name of the table; "tritanium" is mended to titanium, and that is told.
        named = {r for p, r in TABLE.phrases.items() if f" {p} " in f" {text.lower()} "}
        mended = any(repr(word) in line for line in made.warnings for word in text.split())
        assert choice.guessed or choice.row in named or mended, text
        assert row["guessed"] == choice.guessed, text
        assert row["material"] == choice.material, text
        said = {name for name in names for line in made.warnings if f"like {name};" in line}
        for line in made.warnings:
            if "is no material that is known" in line:
                read_as_unknown += 1
                assert f"taken as {choice.material}, " in line, text
        assert said <= {choice.row.name}, text
        assert made.mesh.material is not None
        assert made.mesh.material.E == pytest.approx(row["E"], rel=1e-4), text  # float32 cells
        record = json.loads(path.with_name(f"{number}.msh.json").read_text())["record"]
        (kept,) = record["assign"]["parts"]
        assert (kept["material"], kept["guessed"]) == (choice.material, choice.guessed), text
    assert read_as_unknown >= 3  # or the loop above looked at no such line


@pytest.mark.long
def test_run_records_an_unknown_word_as_a_guess(tmp_path):
    """``run.json`` of a box of "xyzzy": the material that the warning names, and a guess."""
    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "box.stl")
    known = {"output": tmp_path / "out", "convert_options": ConvertOptions(edge_length_rel=0.3)}
    apx.run(tmp_path / "box.stl", ["the unobtainium is xyzzy"], **known)
    document = json.loads((tmp_path / "out" / "run.json").read_text())
    (case,) = document["cases"]
    (part,) = case["parts"]
    assert part["guessed"]
    (told,) = (w for w in case["warnings"] if "'xyzzy' is no material that is known" in w)
    assert f"taken as {part['material']}, " in told
