"""Laws of the FiLM network, its data and its predictor."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.field import DEFAULT, Normalisation
from autophyx_tet.predictors.film.predictor import FilmPredictor
from autophyx_tet.predictors.film.unet import (
    USELESS,
    FilmBlock,
    FilmUNet,
    MaskedGroupNorm,
    Modulation,
    NetworkConfig,
    VoxelScene,
    count_parameters,
    halve,
)
from autophyx_tet.predictors.film.words import CHANNELS, LOUDNESS, with_lexicon
from autophyx_tet.predictors.grid import Grid, PartVoxels
from autophyx_tet.research.datasets.constraints import holds
from autophyx_tet.research.datasets.grammar import (
    Grammar,
    is_held_out_pair,
    level_value,
    split_frames,
    write_phrases,
)
from autophyx_tet.research.datasets.objects import CATEGORIES, HELD_OUT, make_objects
from autophyx_tet.research.datasets.parts import LEVELS, part_kinds
from autophyx_tet.research.datasets.shapes import EMPTY, Solid, pack, rasterise
from autophyx_tet.research.datasets.wordings import wordings
from autophyx_tet.research.evaluation.parser import listen
from autophyx_tet.research.training.film.recipe import text_values

SMALL = NetworkConfig(widths=(8, 16, 16, 16, 16), text_dim=12, slot_width=16, key_width=8)


pytestmark = pytest.mark.usefixtures("one_thread")


def scene(cells=16, clauses=3, seed=0, dim=12) -> VoxelScene:
    g = torch.Generator().manual_seed(seed)

    def unit(*shape):
        return torch.nn.functional.normalize(torch.randn(*shape, generator=g), dim=-1)

    part = torch.full((1, cells, cells, cells), -1)
    part[:, 3:12, 3:12, 3:8] = 0
    part[:, 3:12, 3:12, 8:13] = 1
    occupied = (part >= 0).float()[:, None]
    inputs = torch.cat([occupied, torch.rand(1, 7, cells, cells, cells, generator=g)], 1)
    evidence = torch.randn(1, 2, clauses, cells, cells, cells, generator=g)
    return VoxelScene(
        inputs * occupied, unit(1, clauses, dim), torch.ones(1, clauses, dtype=torch.bool),
        unit(1, dim), torch.tensor([True]), evidence, torch.tensor([[0.5, 0.0]]),
        unit(1, 2, dim), torch.tensor([[True, False]]), part,
    )  # fmt: skip


def test_normalisation_round_trip():
    """E, nu, rho of every row come back from [-1, 1] to 1e-9, and from JSON the same object.

    Of all but diamond: it alone is stiffer than the network can say, and only words name it.
    """
    rows = [row for row in load_table() if row.name != "diamond"]
    for row in rows:
        value = row.value()
        assert np.allclose(
            DEFAULT.physical(DEFAULT.normalise(*value)), value, rtol=1e-9, atol=1e-12
        )
    other = Normalisation(log10_E=(2.0, 10.88), log10_rho=(1.0, 4.0))
    assert Normalisation.from_dict(json.loads(json.dumps(other.to_dict()))) == other


def test_steel_is_within_the_ranges():
    """Ranges that end at 7.6e10 Pa, as Pixie's, would lose steel; ours keep it."""
    steel = load_table().exact("steel").value()
    short = Normalisation(log10_E=(2.0, 10.88))
    assert short.physical(short.normalise(*steel))[0] < 0.5 * steel.E
    np.testing.assert_allclose(DEFAULT.physical(DEFAULT.normalise(*steel))[0], steel.E)


@pytest.mark.slow
def test_masked_norm_sees_occupied_voxels_alone():
    """Padding the grid with empty space changes nothing: one network for any grid."""
    x, mask = torch.randn(1, 8, 4, 4, 4), (torch.rand(1, 1, 4, 4, 4) > 0.4).float()
    norm = MaskedGroupNorm(8)
    wide = torch.nn.functional.pad(x, (2, 2, 2, 2, 2, 2), value=7.0)
    wide_mask = torch.nn.functional.pad(mask, (2, 2, 2, 2, 2, 2))
    inner = norm(wide, wide_mask)[:, :, 2:-2, 2:-2, 2:-2]
    torch.testing.assert_close(inner, norm(x, mask), atol=1e-5, rtol=1e-5)


@pytest.mark.slow
def test_film_starts_as_the_identity():
    """gamma = 1 + delta with delta = beta = 0 at the start: modulation changes nothing."""
    block = FilmBlock(8, 5)
    x, mask = torch.randn(1, 8, 4, 4, 4), torch.ones(1, 1, 4, 4, 4)
    modulation = Modulation(torch.rand(1, 4, 4, 4, 3), torch.randn(1, 3, 5))
    torch.testing.assert_close(block(x, mask, modulation), block(x, mask))


@pytest.mark.parametrize("fine", [False, True])
def test_clause_order_means_nothing(fine):
    """Permuting the clauses permutes the logits and leaves the values, to 1e-4."""
    torch.manual_seed(0)
    network = FilmUNet(NetworkConfig(**{**SMALL.to_dict(), "fine": fine})).eval()
    given, order = scene(cells=32 if fine else 16), [2, 0, 1]
    turned = given._replace(clauses=given.clauses[:, order], evidence=given.evidence[:, :, order])
    with torch.no_grad():
        first, second = network(given), network(turned)
    torch.testing.assert_close(first.values, second.values, atol=1e-4, rtol=1e-4)
    torch.testing.assert_close(first.logits[:, [*order, 3]], second.logits, atol=1e-4, rtol=1e-4)


def test_fine_stage_starts_as_the_coarse_network():
    """At the start the fine stage repeats the values found at half the resolution."""
    torch.manual_seed(0)
    network = FilmUNet(NetworkConfig(**{**SMALL.to_dict(), "fine": True})).eval()
    given = scene(cells=32)._replace(name_mask=torch.tensor([[False, False]]))
    with torch.no_grad():
        fine, stage = network(given), network.fine
        network.fine = None
        coarse = network(halve(given))
        network.fine = stage
    doubled = torch.nn.functional.interpolate(coarse.values, scale_factor=2)
    torch.testing.assert_close(fine.values, doubled, atol=1e-5, rtol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("conditioning", ["grounded", "global", "concat", "crossattn"])
def test_values_are_bounded_and_trainable(conditioning):
    """Outputs lie in (-1, 1) and the loss reaches the text for every row of the ablation."""
    network = FilmUNet(NetworkConfig(**{**SMALL.to_dict(), "conditioning": conditioning}))
    output = network(scene())
    assert output.values.abs().max() < 1
    output.values.square().sum().backward()
    text = {
        "grounded": network.sayings.direct,
        "crossattn": network.sayings.direct,
        "concat": network.context,
    }
    layer = text.get(conditioning, network.decode[0].film)
    assert layer.weight.grad is not None
    assert layer.weight.grad.abs().sum() > 0


def test_evidence_binds_where_words_cannot():
    """With one reliable source, the strongest evidence raises its clause on those voxels."""
    torch.manual_seed(0)
    network = FilmUNet(SMALL).eval()
    given = scene()
    more = given.evidence.clone()
    more[:, 0, 1] += 5
    with torch.no_grad():
        before = network(given).logits.softmax(1)[:, 1]
        after = network(given._replace(evidence=more)).logits.softmax(1)[:, 1]
    assert (after - before)[given.part >= 0].mean() > 0.1


def test_levels_are_ordered():
    """A stiffer level has a higher E, a denser one a higher rho, for every kind of part."""
    for kind in part_kinds().values():
        stiff = [level_value(kind, LEVELS[n]).E for n in ("very soft", "soft", "medium", "stiff")]
        dense = [level_value(kind, LEVELS[n]).rho for n in ("very light", "light", "dense")]
        assert stiff == sorted(stiff)
        assert dense == sorted(dense)


def test_held_out_wordings_frames_and_pairs_never_train():
    """Twenty wordings a level train, five do not; frames and part/material pairs are split too."""
    for level in LEVELS:
        train, test = wordings(level, held_out=False), wordings(level, held_out=True)
        assert len(train) >= 20
        assert len(test) == 5
        assert not set(train) & set(test)
    frames = [str(i) for i in range(20)]
    assert len(split_frames(frames, held_out=True)) == 4
    train = Grammar(np.random.default_rng(0))
    for key in (0, 5):
        for _ in range(30):
            phrase = train.part(key)
            rows = [r for r in load_table() if phrase.value == r.value()]
            assert not rows or any(
                not is_held_out_pair(train.kinds[key].name, r.name) for r in rows
            )


@pytest.mark.slow
def test_training_clauses_hold_no_word_of_the_held_out_parts():
    """Boat and umbrella stay unseen: none of their part words is in the corpus."""
    words = {w for k in part_kinds().values() if k.held_out for w in k.words}
    text = " ".join(p.text for p in write_phrases(np.random.default_rng(0), per_part=8))
    assert not [word for word in words if f" {word} " in f" {text} "]


def test_every_category_has_named_parts():
    """At least 30 categories; each part that is named has voxels at 32^3."""
    assert len(CATEGORIES) >= 30
    rng = np.random.default_rng(0)
    names = [*CATEGORIES, *HELD_OUT]
    chosen = make_objects(6, rng, names=[str(n) for n in rng.choice(names, 6)])
    label = rasterise(torch.tensor(chosen.rows), cells=32)
    for one, kinds in zip(label, chosen.kinds, strict=True):
        count = (kinds >= 0).sum()
        assert count >= 2
        seen = set(one.unique().tolist()) - {EMPTY}
        assert seen == set(range(count))


def test_rasterised_ball_has_its_volume():
    """A ball of unit radius fills pi/6 of its box, to 3 % at 32 cells."""
    ball = Solid()
    ball.ball("ball", (0, 0, 0), 1.0)
    inside = (rasterise(torch.tensor(pack([ball])), cells=34) != EMPTY).sum().item()
    assert inside == pytest.approx(np.pi / 6 * 32**3, rel=0.03)


def test_constraints_are_data_not_code():
    """ "pot stiffer than trunk" is decided; anything but names, numbers, comparisons is refused."""
    values = {
        "pot": load_table().exact("ceramic").value(),
        "trunk": load_table().exact("wood").value(),
    }
    assert holds("pot.E > trunk.E and pot.rho > 1.5 * trunk.rho", values)
    assert not holds("pot.nu > 10 * trunk.nu", values)
    for bad in ("__import__('os')", "pot.__class__", "pot.E ** 999", "(lambda: 1)()", "box.E > 1"):
        with pytest.raises(ValueError, match="constraint"):
            holds(bad, values)


def chair(cells=48) -> PartVoxels:
    chosen = make_objects(1, np.random.default_rng(3), names=["chair"])
    label = rasterise(torch.tensor(chosen.rows), cells=cells)[0].numpy().astype(np.int64)
    label[label == EMPTY] = -1
    return PartVoxels(Grid(np.zeros(3), 0.02, (cells,) * 3), label, ("leg", "seat", "back"))


@pytest.mark.slow
def test_shipped_weights_follow_words():
    """What the network finds by itself: oak for the legs; other parts move by < .1 with them."""
    predictor, parts = FilmPredictor(), chair()
    oak = load_table().exact("oak").value()
    oaken = parts.part == 0
    learnt, swapped = (
        predictor.field(parts, listen(f"{legs} legs and a soft foam seat", predictor.table))
        for legs in ("oak", "steel")
    )
    assert abs(np.log10(learnt.E[oaken]).mean() - np.log10(oak.E)) < 0.3
    others = (parts.part == 1) | (parts.part == 2)
    moved = np.abs(np.log10(swapped.E[others]) - np.log10(learnt.E[others]))
    assert np.median(moved) < 0.1
    assert count_parameters(predictor.model.network) < 8e6


@pytest.mark.long
def test_a_cpu_trains_the_small_network(tmp_path):
    """Sixty steps bring the loss of the small network below .45."""
    from autophyx_tet.research.datasets.text_table import build_text_table, save_text_table
    from autophyx_tet.research.training.film.presets import CPU
    from autophyx_tet.research.training.film.recipe import train_film

    rng = np.random.default_rng(0)

    def embed(texts):
        return np.stack([np.random.default_rng(len(t)).normal(size=384) / 20 for t in texts])

    def hinted(texts):
        return np.concatenate([with_lexicon(embed(texts), texts), embed(texts)], axis=1)

    table = build_text_table(rng, hinted, per_part=4)
    save_text_table(tmp_path / "text", table)
    whole = train_film(CPU, text=tmp_path / "text")
    assert whole.history[-1]["loss"] < 0.45
    assert whole.history[-1]["loss"] < whole.history[0]["loss"]


def test_what_the_lexicon_is_told_arrives_exactly():
    """A clause alone that names a material has the lexicon's value, untouched by tanh."""
    config = NetworkConfig(
        widths=(8, 8, 8, 8, 8), text_dim=4 + len(CHANNELS) + 4, slot_width=16, key_width=8,
        told=True, sentence_dim=4,
    )  # fmt: skip
    network = FilmUNet(config).eval()
    value = torch.tensor([[0.7, -0.2, 0.4]])
    embedding = torch.zeros(1, config.text_dim)
    hints = torch.cat([torch.ones(1, 1), value, torch.zeros(1, len(CHANNELS) - 4)], 1)
    embedding[:, 4 : 4 + len(CHANNELS)] = hints * LOUDNESS / 4**0.5
    assert torch.allclose(text_values(network, embedding, torch.tensor([0])), value, atol=1e-6)
    silent = torch.zeros(1, config.text_dim)
    assert not torch.allclose(text_values(network, silent, torch.tensor([0])), value, atol=0.05)


def test_a_useless_source_is_not_heard():
    """Evidence whose source is known to be useless changes nothing at all."""
    network = FilmUNet(replace(SMALL, graded=True)).eval()
    given = scene()
    known = given._replace(reliability=torch.tensor([[USELESS, 0.0]]))
    absent = given._replace(
        reliability=torch.zeros(1, 2), evidence=torch.zeros_like(given.evidence)
    )
    with torch.no_grad():
        assert torch.equal(network(known).values, network(absent).values)
        assert not torch.equal(network(given).values, network(absent).values)
