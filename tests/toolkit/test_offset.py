"""Walls and thickness: closed forms of parallel surfaces."""

import numpy as np
import pytest
import trimesh
from autophyx_tet.predictors.asset import Asset, Part
from autophyx_tet.toolkit.asset.repair import repair
from autophyx_tet.toolkit.asset.solids import Solids, hollowed, thickened, vertex_offsets
from autophyx_tet.toolkit.asset.surface import component_volumes
from autophyx_tet.toolkit.meshing.convert import tetrahedralize


def _hollow_volume(mesh, wall):
    """Volume of a hollowed body by sampling its label function."""
    surface, _ = repair([Part("body", mesh)])
    solids = hollowed(Solids.of(surface, 1, thinnest=1e-6), {0: wall})
    rng = np.random.default_rng(0)
    lo, hi = solids.bounds
    where = lo + (hi - lo) * rng.random((40_000, 3))
    return (solids.label(where) >= 0).mean() * np.prod(hi - lo), solids


def test_offset_of_a_box_is_mitred():
    """Each corner of a box moves by (1, 1, 1): all three faces there move by one."""
    box = trimesh.creation.box((2, 4, 6)).subdivide()
    move = vertex_offsets(np.asarray(box.vertices), np.asarray(box.faces))
    on_face = np.isclose(np.abs(box.vertices), box.extents / 2)
    assert np.abs(move) == pytest.approx(on_face.astype(float), abs=1e-9)


def test_offset_of_a_ball_is_radial():
    ball = trimesh.creation.icosphere(3)
    move = vertex_offsets(np.asarray(ball.vertices), np.asarray(ball.faces))
    assert move == pytest.approx(np.asarray(ball.vertices), abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mesh", "wall", "inner"),
    [
        (trimesh.creation.box((1, 2, 3)), 0.1, 0.8 * 1.8 * 2.8),
        (trimesh.creation.icosphere(4), 0.1, 4 / 3 * np.pi * 0.9**3),
        (trimesh.creation.cylinder(0.5, 2, sections=64), 0.05, np.pi * 0.45**2 * 1.9),
    ],
)
def test_wall_leaves_the_analytic_volume(mesh, wall, inner):
    """Box, ball and bottle-like cylinder: outer minus inner volume within 2 %."""
    volume, _ = _hollow_volume(mesh, wall)
    assert volume == pytest.approx(mesh.volume - inner, rel=0.02)


def test_a_cavity_of_one_part_in_the_skin_of_two():
    """A glass box with a label on one side and an inner surface: outer minus inner volume."""
    outer, inner = trimesh.creation.box((2, 2, 2)), trimesh.creation.box((1, 1, 1))
    label = (outer.vertices[outer.faces][:, :, 0] == 1).all(axis=1)
    inner.invert()
    glass = trimesh.util.concatenate(
        [trimesh.Trimesh(outer.vertices, outer.faces[~label], process=False), inner]
    )
    patch = trimesh.Trimesh(outer.vertices, outer.faces[label], process=False)
    surface, _ = repair([Part("glass", glass), Part("label", patch)])
    solids = Solids.of(surface, 2, thinnest=1e-6)
    where = np.array([[0, 0, 0], [0, 0, 0.75], [0.9, 0, 0], [1.1, 0, 0]], float)
    assert solids.label(where).tolist() == [-1, 0, 1, -1]


def test_thin_body_stays_solid():
    """A plate thinner than two walls has no cavity, and nothing grows outside of it."""
    plate = trimesh.creation.box((1, 1, 0.1))
    volume, solids = _hollow_volume(plate, 0.08)
    assert volume == pytest.approx(plate.volume, rel=1e-6)
    assert len(solids.surface.faces) == 12


def test_thickened_sheet_is_a_plate():
    """Area times thickness, closed, whatever the sheet's winding."""
    x, y = np.meshgrid(np.linspace(0, 1, 5), np.linspace(0, 1, 5))
    i = (np.arange(4)[:, None] * 5 + np.arange(4)).reshape(-1)
    faces = np.concatenate([np.stack([i, i + 1, i + 5], 1), np.stack([i + 1, i + 6, i + 5], 1)])
    sheet = trimesh.Trimesh(np.stack([x, y, 0 * x], -1).reshape(-1, 3), faces, process=False)
    surface, _ = repair([Part("sheet", sheet)])
    plate = thickened(surface, np.ones(len(surface.faces), bool), 0.02)
    assert np.abs(component_volumes(plate)).sum() == pytest.approx(0.02)
    assert Solids.of(plate, 1, thinnest=1e-6).shells


# Radius and height [m] of a bottle's outline, from the middle of its base to that of its mouth.
BOTTLE = np.array([[0, 0], [0.04, 0], [0.04, 0.18], [0.015, 0.24], [0.015, 0.3], [0, 0.3]])


def _inset(outline, wall):
    """Outline of the body that lies ``wall`` inside: every edge moved, then intersected."""
    along = np.diff(outline, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    inward = np.stack([-along[:, 1], along[:, 0]], axis=1)
    reach = (inward * (outline[:-1] + wall * inward)).sum(axis=1)
    corners = [np.linalg.solve(inward[i : i + 2], reach[i : i + 2]) for i in range(len(along) - 1)]
    ends = [[0, wall], *corners, [0, outline[-1, 1] - wall]]
    return np.array(ends)


def _turned_volume(outline):
    """Volume [m^3] of the body of revolution: a cone's frustum under every edge."""
    (r, s), (z, t) = (np.stack([outline[:-1, k], outline[1:, k]]) for k in (0, 1))
    return float((np.pi / 3 * (r * r + r * s + s * s) * (t - z)).sum())


def _cupboard():
    """A closed carcass of 0.8 x 0.4 x 1.8 m with two doors of 2 cm on its front."""
    parts = [Part("carcass", trimesh.creation.box((0.8, 0.4, 1.8)))]
    for side in (-1, 1):
        door = trimesh.creation.box((0.39, 0.02, 1.78))
        door.apply_translation((0.2 * side, -0.21, 0))
        parts.append(Part(f"door {side}", door))
    return Asset("cupboard", tuple(parts))


SHELL = 0.8 * 0.4 * 1.8 - 0.764 * 0.364 * 1.764  # of walls of 18 mm
DOORS = 2 * 0.39 * 0.02 * 1.78


@pytest.mark.parametrize("wall", [0.001, 0.003])
@pytest.mark.slow
def test_bottle_leaves_the_analytic_volume(wall):
    """Base, wall, shoulder and neck of glass: the volume between two bodies of revolution, 2 %."""
    bottle = trimesh.creation.revolve(BOTTLE, sections=128)
    outer, inner = _turned_volume(BOTTLE), _turned_volume(_inset(BOTTLE, wall))
    assert bottle.volume == pytest.approx(outer, rel=1e-3)
    volume, _ = _hollow_volume(bottle, wall)
    assert volume == pytest.approx(outer - inner, rel=0.02)


@pytest.mark.slow
def test_cupboard_with_doors_leaves_the_analytic_volume():
    """Only the carcass is hollowed; its doors, named by nobody, stay solid plates."""
    asset = _cupboard()
    surface, _ = repair(asset.parts)
    solids = hollowed(Solids.of(surface, 3, thinnest=1e-3), {0: 0.018})
    rng = np.random.default_rng(0)
    lo, hi = solids.bounds
    where = lo + (hi - lo) * rng.random((200_000, 3))
    share = np.bincount(solids.label(where) + 1, minlength=4)[1:] / len(where)
    assert share[0] * np.prod(hi - lo) == pytest.approx(SHELL, rel=0.02)
    assert share[1:].sum() * np.prod(hi - lo) == pytest.approx(DOORS, rel=0.03)


@pytest.mark.long
def test_hollow_bottle_converts():
    """The tets of a bottle with a wall of 5 mm: within 2 % of the bodies of revolution."""
    bottle = trimesh.creation.revolve(BOTTLE, sections=32)
    asset = Asset("bottle", (Part("bottle", bottle),))
    mesh, report = tetrahedralize(asset, wall=0.005)
    assert report.ok, report.failed
    glass = _turned_volume(BOTTLE) - _turned_volume(_inset(BOTTLE, 0.005))
    assert mesh.volume == pytest.approx(glass, rel=0.02)


@pytest.mark.long
def test_hollow_cupboard_converts():
    """Tets of the carcass and of its doors, each within 2 %; without a wall all three are named."""
    asset = _cupboard()
    mesh, report = tetrahedralize(asset, part_wall={"carcass": 0.018})
    assert report.ok, report.failed
    volume = dict(zip(mesh.region_names, mesh.region_volumes(), strict=True))
    assert volume["carcass"] == pytest.approx(SHELL, rel=0.02)
    assert volume["door -1"] + volume["door 1"] == pytest.approx(DOORS, rel=0.02)
    _, solid = tetrahedralize(asset, edge_length_rel=0.2)
    assert set(solid.hollow) == set(asset.part_names)
    assert any("filled with tets" in w and "shell" in w for w in solid.warnings)


@pytest.mark.slow
def test_hollow_box_converts():
    """A cupboard of 1 x 1 x 2 m with walls of 5 cm: the tets' volume within 2 % of the formula."""
    box = trimesh.creation.box((1, 1, 2))
    asset = Asset("cupboard", (Part("cupboard", box),))
    mesh, report = tetrahedralize(asset, wall=0.05, epsilon_rel=2e-3)
    assert report.ok, report.failed
    assert mesh.volume == pytest.approx(2 - 0.9 * 0.9 * 1.9, rel=0.02)
    assert not report.hollow
    _, solid = tetrahedralize(asset, edge_length_rel=0.2, epsilon_rel=5e-3)
    assert any("filled with tets" in w for w in solid.warnings)
