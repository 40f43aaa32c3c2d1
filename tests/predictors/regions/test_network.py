"""The region network: the same in numpy as where it is trained, and what no order may change."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.encoders.minilm import MiniLM
from autophyx_tet.predictors.regions.division import NULL, Regions, assigned, divide, told_regions
from autophyx_tet.predictors.regions.network import (
    MEASURES,
    WEIGHTS,
    Inputs,
    RegionNetwork,
    Said,
    Words,
    kind_index,
    measured,
    part_vector,
    part_words,
)
from autophyx_tet.predictors.text.parts import KINDS

SAID = (Said("top", "oak", "red oak (along grain)"), Said("legs", "steel", "carbon steel"))


@lru_cache(maxsize=1)
def minilm():
    """The text encoder, once."""
    return MiniLM()


def table():
    """A brown top on four grey legs: cells, looks, and whether each is of the top."""
    top = np.argwhere(np.ones((30, 30, 4))) + np.array([0, 0, 20])
    legs = [
        np.argwhere(np.ones((3, 3, 20))) + np.array([x, y, 0]) for x in (1, 26) for y in (1, 26)
    ]
    cells = np.concatenate([top, *legs])
    of_top = np.arange(len(cells)) < len(top)
    brown, grey = (0.45, 0.3, 0.15), (0.5, 0.5, 0.52)
    seen = np.where(of_top[:, None], (*brown, 1, 0, 0.04, 0.6), (*grey, 1, 1, 0.04, 0.3))
    return cells, seen, of_top


def given(said=SAID) -> Inputs:
    """Inputs of the table in two regions."""
    cells, seen, of_top = table()
    found = measured(cells, seen, np.where(of_top, 0, 1))
    network = RegionNetwork.load()
    words = Words.of(said, minilm())
    return network.inputs(found, said, words=words, shells=True, table=load_table())


def test_shares_of_every_region_are_one_in_all():
    shares = RegionNetwork.load()(given())
    assert shares.shape == (2, 3)
    np.testing.assert_allclose(shares.sum(axis=1), 1, rtol=1e-5)


def test_the_number_of_a_region_says_nothing():
    """Regions in another order get the same shares."""
    inputs = given()
    turned = inputs._replace(
        region=inputs.region[::-1], pairs=inputs.pairs[::-1, ::-1],
        evidence=inputs.evidence[::-1],
    )  # fmt: skip
    network = RegionNetwork.load()
    np.testing.assert_allclose(network(turned), network(inputs)[::-1], atol=1e-5)


def test_in_torch_it_is_the_same_network():
    """What is trained, and written, is what runs: to the round-off of its half precision."""
    torch = pytest.importorskip("torch")
    from autophyx_tet.research.training.regions.network import RegionBatch, RegionTransformer

    inputs = given()
    network = RegionNetwork.load()
    found = []
    for k in range(len(network.tensors["kind"])):
        twin = RegionTransformer(len(network.facts["categories"])).eval()
        twin.load_state_dict({name: torch.tensor(x[k]) for name, x in network.tensors.items()})
        there = torch.ones(1, 2, dtype=torch.bool), torch.ones(1, 3, dtype=torch.bool)
        batch = RegionBatch(*(torch.tensor(x)[None] for x in inputs), *there, torch.zeros(1, 2, 3))
        with torch.inference_mode():
            found.append(twin(batch).softmax(dim=-1)[0].numpy())
    np.testing.assert_allclose(network(inputs), np.mean(found, axis=0), atol=2e-5)


def test_written_as_bytes_it_is_read_to_half_a_step_of_each_row(tmp_path):
    """A step is the largest of its row in 127 parts; what is no matrix has half precision."""
    torch = pytest.importorskip("torch")
    from autophyx_tet.research.training.regions.network import RegionTransformer
    from autophyx_tet.research.training.regions.recipe import save_regions

    shipped = RegionNetwork.load()
    torch.manual_seed(0)
    made = [RegionTransformer(len(shipped.facts["categories"])) for _ in range(2)]
    path = tmp_path / "regions.safetensors"
    save_regions(path, made, dict(shipped.facts))
    read = RegionNetwork.load(path).tensors
    for name, tensor in made[0].state_dict().items():
        wanted = np.stack([one.state_dict()[name].numpy() for one in made])
        step = np.abs(wanted).max(axis=-1, keepdims=True) / 127
        # 1e-3: of a number of half precision, 2^-11, and of a step of it
        least = step / 2 + np.abs(wanted) * 1e-3 + 0.01 / 127 / 2
        assert (np.abs(read[name] - wanted) <= (least if tensor.ndim > 1 else 1e-3)).all(), name


def test_a_table_top_and_its_legs_are_told_apart():
    """As said in either order: the small things are the legs."""
    cells, seen, of_top = table()
    regions = Regions(cells, seen, np.where(of_top, 0, 1)[None], np.where(of_top, 0, 1), True)
    for said, top in ((SAID, 0), (SAID[::-1], 1)):
        found = divide(regions, said, encoder=minilm(), table=load_table())
        assert (found.owner[of_top] == top).all()
        assert (found.owner[~of_top] == 1 - top).all()


def test_what_a_user_tells_of_a_region_stands():
    """Told that the top is of the second clause, it is, and the sum of its shares is one."""
    cells, seen, of_top = table()
    label = np.where(of_top, 0, 1)
    regions = Regions(cells, seen, label[None], label, True)
    told = np.where(of_top, 1, -1)
    found = divide(regions, SAID, encoder=minilm(), table=load_table(), told=told)
    assert (found.owner[of_top] == 1).all()
    np.testing.assert_allclose(found.share[of_top], 1)
    nobody = divide(
        regions, SAID, encoder=minilm(), table=load_table(), told=np.where(of_top, 2, -1)
    )
    assert (nobody.owner[of_top] == 2).all()


def legs_apart() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The table's cells and looks, and its regions: the top, and each leg by itself."""
    cells, seen, of_top = table()
    side = (cells[:, :2] > cells[:, :2].mean(axis=0)) @ [1, 2]
    return cells, seen, np.where(of_top, 0, 1 + side)


def test_what_a_user_tells_of_a_leg_is_of_all_legs_and_of_no_top():
    cells, seen, label = legs_apart()
    found = measured(cells, seen, label)

    def told(**each: int) -> list[int]:
        of_cell = np.full(len(label), -1)
        for name, clause in each.items():
            of_cell[label == int(name[1:])] = clause
        return told_regions(found, label, of_cell, 2).tolist()

    assert told(_1=1) == [-1, 1, 1, 1, 1]
    assert told(_0=0) == [0, -1, -1, -1, -1]
    assert told(_1=0, _2=1) == [-1, 0, 1, -1, -1]  # two that disagree tell nothing of others
    assert told(_3=2) == [-1, -1, -1, 2, -1]  # nor does one of which no clause speaks


def test_no_larger_region_moves_where_a_user_tells_of_a_small_one():
    """A leg that is told the top's clause does not turn the top to the other one."""
    cells, seen, label = legs_apart()
    regions = Regions(cells, seen, label[None], label, True)
    known = {"encoder": minilm(), "table": load_table()}
    before = divide(regions, SAID, **known)
    assert (before.owner[label == 0] == 0).all()
    for leg in (1, 4):
        after = divide(regions, SAID, told=np.where(label == leg, 0, -1), **known)
        assert (after.owner[label == leg] == 0).all()
        assert (after.owner[label == 0] == 0).all()


def test_each_clause_has_a_region_where_that_costs_little():
    shares = np.array([[0.9, 0.1, 0.0], [0.6, 0.4, 0.0], [0.8, 0.2, 0.0]])
    assert assigned(shares).tolist() == [0, 1, 0]
    sure = np.array([[1 - 1e-9, 1e-9, 0.0]] * 3)
    assert assigned(sure).tolist() == [0, 0, 0]


def test_nobody_speaks_of_a_region_only_where_the_null_clause_wins():
    """At ``NULL``, not before: below it the likeliest clause has the region."""
    below, above = NULL - 0.01, NULL + 0.01
    shares = np.array([
        [0.98, 0.01, 0.01], [0.01, 0.98, 0.01],
        [0.7 * (1 - below), 0.3 * (1 - below), below],
        [0.7 * (1 - above), 0.3 * (1 - above), above],
    ])  # fmt: skip
    assert assigned(shares).tolist() == [0, 1, 0, 2]


def test_words_for_several_parts_are_their_mean():
    assert part_words("the base, armrests and Legs") == ["the base", "armrests", "legs"]
    both = part_vector("base and armrests", minilm())
    single = minilm().text(["base", "armrests"])
    assert np.linalg.norm(both) == pytest.approx(1, abs=1e-6)
    np.testing.assert_allclose(both @ single[0], both @ single[1], atol=1e-6)
    words = Words.of([Said("base and armrests"), Said("", "oak")], minilm())
    np.testing.assert_allclose(words.part, [both, np.zeros_like(both)], atol=1e-6)
    assert not words.material[0].any()


def test_the_kind_of_a_matter_is_that_of_its_words_or_its_row():
    known = load_table()
    assert KINDS[kind_index("walnut", known.exact("walnut").name, known)] == "wood"
    assert KINDS[kind_index("PVC", known.exact("pvc").name, known)] == "plastic"
    assert kind_index("vibranium", "", known) == -1


def test_weights_of_other_measures_are_refused(tmp_path):
    from safetensors.numpy import save_file

    with pytest.raises(InputError, match="does not hold weights"):
        RegionNetwork.load(tmp_path / "none.safetensors")
    save_file({"kind": np.zeros((1, 2, 4))}, tmp_path / "a.safetensors", {"measures": '["L"]'})
    with pytest.raises(InputError, match="does not hold weights"):
        RegionNetwork.load(tmp_path / "a.safetensors")


def test_certainty_is_what_calibration_makes_of_the_expected_share():
    """A slope of 0 says its offset of every thing; the shipped file is at most 4 MB."""
    cells, seen, of_top = table()
    regions = Regions(cells, seen, np.where(of_top, 0, 1)[None], np.where(of_top, 0, 1), True)
    shipped = RegionNetwork.load()
    flat = replace(shipped, facts={**shipped.facts, "certainty": [0.0, np.log(0.7 / 0.3)]})
    found = divide(regions, SAID, encoder=minilm(), table=load_table(), network=flat)
    assert found.certainty == pytest.approx(0.7)
    assert len(MEASURES) == len(shipped.facts["mean"])
    assert WEIGHTS.stat().st_size <= 4e6
