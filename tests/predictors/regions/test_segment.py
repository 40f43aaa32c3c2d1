"""Regions: of one look, connected, thick apart from thin; shells tell what looks do not."""

import numpy as np
import pytest
from autophyx_tet.predictors.appearance.features import PLAIN_FINISH, Appearance, cell_appearance
from autophyx_tet.predictors.asset import Asset, Part, upright
from autophyx_tet.predictors.regions.division import MOST, cut, segment
from autophyx_tet.predictors.regions.network import MEASURES, measured, quarter_turned

RED, BLUE = np.array([0.8, 0.1, 0.1]), np.array([0.1, 0.1, 0.8])


def block(low, high):
    """Cells from one corner to another."""
    return np.argwhere(np.ones(np.subtract(high, low))) + low


def looks(colours):
    """Colours (n, 3) with the finish of a scan."""
    return np.concatenate([colours, np.tile(PLAIN_FINISH, (len(colours), 1))], axis=1)


def same(a, b):
    """Whether two labellings are one up to the numbers."""
    pairs = np.unique(np.stack([a, b]), axis=1)
    return pairs.shape[1] == len(np.unique(a)) == len(np.unique(b))


def table():
    """A top on four thin legs, of one colour: cells and whether each is of the top."""
    legs = [block((x, y, 0), (x + 2, y + 2, 20)) for x in (2, 26) for y in (2, 26)]
    top = block((0, 0, 20), (30, 30, 30))
    cells = np.concatenate([top, *legs])
    return cells, np.arange(len(cells)) < len(top)


def test_two_colours_are_two_regions_the_larger_first():
    cells = block((0, 0, 0), (20, 10, 10))
    red = cells[:, 0] < 7
    region = segment(cells, looks(np.where(red[:, None], RED, BLUE)))
    assert same(region, red)
    assert (region[~red] == 0).all()


def test_what_is_apart_is_another_region_though_of_one_colour():
    cells = np.concatenate([block((0, 0, 0), (5, 5, 5)), block((9, 0, 0), (14, 5, 5))])
    region = segment(cells, looks(np.tile(RED, (len(cells), 1))))
    assert same(region, cells[:, 0] > 7)


def test_shells_tell_touching_things_of_one_colour_apart():
    cells = block((0, 0, 0), (20, 8, 8))
    seen, shell = looks(np.tile(RED, (len(cells), 1))), (cells[:, 0] < 8).astype(int)
    assert segment(cells, seen).max() == 0
    assert same(segment(cells, seen, shell), shell)


def test_thin_legs_leave_a_thick_top():
    """Of one colour and one shell: the four legs are regions of their own, but for their ends."""
    cells, top = table()
    region = segment(cells, looks(np.tile(RED, (len(cells), 1))))
    assert len(np.unique(region)) == 5
    for k in range(5):
        assert np.isin(top[region == k].mean().round(1), (0.0, 1.0))


def test_specks_go_to_what_is_around_them():
    cells = block((0, 0, 0), (20, 20, 20))
    colours = np.tile(RED, (len(cells), 1))
    colours[np.random.default_rng(0).choice(len(cells), 20, replace=False)] = BLUE
    assert segment(cells, looks(colours)).max() == 0


def test_there_are_never_more_than_a_sentence_can_use():
    rng = np.random.default_rng(0)
    cells = block((0, 0, 0), (48, 48, 4))
    tile = cells[:, 0] // 4 * 12 + cells[:, 1] // 4
    region = segment(cells, looks(rng.random((144, 3))[tile]))
    assert region.max() < MOST


@pytest.mark.slow
@pytest.mark.parametrize("up", ["x", "y", "-y", "-z"])
def test_the_axis_that_points_up_changes_nothing(up):
    """The same thing lying on its side is cut alike, and measured alike."""
    cells, top = table()
    colours = np.where(top[:, None], RED, BLUE)

    def seen(at):
        grid = np.zeros((40, 40, 40, 3))
        grid[tuple(at.T)] = colours
        return Appearance(grid)

    stands = cut(cells, seen(cells), "z")
    # the inverse of what makes it stand: the cells of a thing that lies
    turn = np.array([upright(axis, up) for axis in np.eye(3)])
    lies = np.rint(cells @ turn.T).astype(int)
    lies -= lies.min(axis=0)
    found = cut(lies, seen(lies), up)
    np.testing.assert_array_equal(found.cells, stands.cells)
    assert same(found.region, stands.region)


def test_measures_of_a_table_are_what_it_is():
    """The top has 30 x 30 x 10 of 11,000 + 320 cells; legs are mirrored, alike, and touch it."""
    cells, top = table()
    region = np.where(top, 0, 1)
    found = measured(cells, looks(np.where(top[:, None], RED, BLUE)), region)
    value = dict(zip(MEASURES, found.values.T, strict=True))
    assert value["share"][0] == pytest.approx(9000 / 9320, rel=1e-6)
    assert value["own height"].tolist() == pytest.approx([10 / 30, 20 / 30])
    assert value["lowest"].tolist() == pytest.approx([2 / 3, 0])
    assert value["mirror x"].tolist() == pytest.approx([1, 1])
    # both touch nothing else: 16 faces, four legs of 2 x 2 cells, of 16 and one
    assert found.contact[0, 1] == found.contact[1, 0] == pytest.approx(16 / 17)
    # of 16 + 4 x 4 x 20 ... faces: four sides of 40 cells a leg, its foot, and the top above it
    assert value["inner contact"][1] == pytest.approx(16 / (16 + 4 * (4 * 40 + 4)))


def test_measures_of_a_turned_thing_are_those_that_change_places():
    """Of a lopsided thing: no two of its measures across and along are equal."""
    cells = np.concatenate([block((0, 0, 0), (20, 8, 6)), block((3, 1, 6), (7, 4, 15))])
    region = (cells[:, 2] >= 6).astype(int)
    seen = looks(np.where(region[:, None], RED, BLUE))
    turned = np.stack([-cells[:, 1], cells[:, 0], cells[:, 2]], axis=1)
    found, after = measured(cells, seen, region), measured(turned, seen, region)
    assert not np.allclose(found.values, after.values)
    # single precision
    np.testing.assert_allclose(quarter_turned(found).values, after.values, atol=1e-5)
    np.testing.assert_allclose(found.contact, after.contact)


def test_shells_of_two_boxes_are_two_and_of_a_welded_one_is_one():
    import trimesh

    box = trimesh.creation.box((1, 1, 1))
    apart = trimesh.util.concatenate([box, box.copy().apply_translation((3, 0, 0))])
    asset = Asset("boxes", (Part("boxes", apart),))
    centres = np.array([[0.4, 0, 0], [2.6, 0, 0], [3.4, 0, 0]])
    _, shell = cell_appearance(asset, centres)
    assert shell.tolist() == [0, 1, 1]
    halves = trimesh.creation.box((1, 1, 1))
    parts = tuple(
        Part(name, halves.submesh([faces], append=True))
        for name, faces in (("a", range(6)), ("b", range(6, 12)))
    )
    _, shell = cell_appearance(Asset("welded", parts), centres[:1])
    assert shell.tolist() == [0]
