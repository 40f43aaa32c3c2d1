"""Lattices cut to analytic bodies: volumes, corners, angles, thin things, the same mesh twice."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from autophyx_tet.fem.errors import UsageError
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import box_mesh, signed_volumes
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.statics import solve_static
from autophyx_tet.toolkit.asset.repair import repair
from autophyx_tet.toolkit.asset.solids import Solids, hollowed
from autophyx_tet.toolkit.meshing.convert import tetrahedralize
from autophyx_tet.toolkit.meshing.quality import dihedral_angles
from autophyx_tet.toolkit.meshing.stuffing.lattice import NodeField, SolidField, lattice_around
from autophyx_tet.toolkit.meshing.stuffing.mesher import Guard, cut, stuff, wanted_volumes

from .test_tetrahedralize import asset_of


def stuffed(edge, **meshes):
    """A mesh that keeps all that a lattice promises."""
    mesh, report = tetrahedralize(asset_of(**meshes), mesher="stuffing", edge_length=edge)
    assert report.ok, report.failed
    assert (report.mesher, report.quality.components) == ("stuffing", 1)
    assert report.quality.dihedral_min >= 9
    assert report.quality.dihedral_max <= 166
    return mesh, report


def turned(mesh, seed=0):
    """The same body in a random pose."""
    angles = np.random.default_rng(seed).random(3)
    return mesh.copy().apply_transform(trimesh.transformations.random_rotation_matrix(angles))


def solids_of(body):
    surface, _ = repair(asset_of(body=body).parts)
    return Solids.of(surface, 1, thinnest=1e-6)


def volumes(mesh):
    return dict(zip(mesh.region_names, mesh.region_volumes(), strict=True))


def test_a_box_in_line_is_exact():
    """Its faces are planes of the lattice or cut parallel to them: not a digit is lost."""
    mesh, _ = stuffed(0.1, box=trimesh.creation.box((1, 0.5, 0.3)))
    assert mesh.volume == pytest.approx(0.15, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_a_tilted_box_keeps_its_corners(seed):
    """Unsnapped they are .7 edges off; then each is a node, but for one where angles forbid it."""
    box = turned(trimesh.creation.box((1, 0.6, 0.4)), seed)
    mesh, _ = stuffed(0.08, box=box)
    away = np.linalg.norm(mesh.points[:, None] - box.vertices, axis=-1).min(axis=0)
    assert np.sort(away)[-2] < 1e-5  # single precision
    assert away.max() < 0.08
    assert mesh.volume == pytest.approx(0.24, rel=5e-3)


@pytest.mark.slow
def test_nested_balls_and_touching_cubes():
    """Volumes to .5 % of the polyhedra, the cubes' common wall to the digit."""
    inner, outer = trimesh.creation.icosphere(2, radius=0.5), trimesh.creation.icosphere(2)
    mesh, _ = stuffed(0.15, outer=outer, inner=inner)
    found = {"inner": inner.volume, "outer": outer.volume - inner.volume}
    assert volumes(mesh) == pytest.approx(found, rel=5e-3)
    a, b = trimesh.creation.box((1, 1, 1)), trimesh.creation.box((1, 1, 1))
    mesh, report = stuffed(0.2, left=a, right=b.apply_translation((1, 0, 0)))
    assert volumes(mesh) == pytest.approx({"left": 1, "right": 1}, rel=1e-6)
    assert report.doubled_points == 0


@pytest.mark.slow
@pytest.mark.parametrize("edges", [1.5, 1.0])
def test_a_tilted_rod_keeps_its_volume(edges):
    """As thick as the lattice's edge it loses three quarters when cut, 1 % when matched."""
    rod = turned(trimesh.creation.cylinder(0.025 * edges, 1, sections=48))
    mesh, _ = stuffed(0.05, rod=rod)
    assert mesh.volume == pytest.approx(rod.volume, rel=1e-2)


def test_a_tilted_plate_keeps_its_volume():
    """As thick as the lattice's edge, in one piece."""
    mesh, _ = stuffed(0.05, plate=turned(trimesh.creation.box((0.6, 0.6, 0.05))))
    assert mesh.volume == pytest.approx(0.6 * 0.6 * 0.05, rel=1e-2)


def _tip(mesh, turn):
    """Deflection [m] of the free end of a bar of 1 x .1 x .1 m, clamped at the other, quadratic."""
    place = mesh.points @ turn
    mesh = mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=1e7, nu=0.3, rho=1000.0))
    held = Supports.clamp(len(place), place[:, 0] < place[:, 0].min() + 1e-3)
    found = solve_static(mesh, held, gravity_vector=turn @ (0, 0, -9.81), order=2)
    end = place[:, 0] > place[:, 0].max() - 1e-3
    return (found.displacement[: len(place)] @ turn)[end, 2].mean()


@pytest.fixture(scope="module")
def tip_of_tets_in_line():
    return _tip(box_mesh((1, 0.1, 0.1), (40, 4, 4)), np.eye(3))


@pytest.mark.slow
@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(i, marks=pytest.mark.slow) for i in range(1, 20))]
)
def test_a_tilted_bar_bends_as_it_should(seed, tip_of_tets_in_line):
    """Two and a half edges thick, in any pose: the tip within 3 % of a box of tets in line.

    With its sharp edges cut off it bends a third more.
    """
    angles = np.random.default_rng(seed).random(3)
    turn = trimesh.transformations.random_rotation_matrix(angles)[:3, :3]
    bar = trimesh.creation.box((1, 0.1, 0.1))
    mesh, _ = stuffed(0.04, bar=trimesh.Trimesh(bar.vertices @ turn.T, bar.faces))
    assert _tip(mesh, turn) == pytest.approx(tip_of_tets_in_line, rel=0.03)


@pytest.mark.slow
def test_what_two_bodies_of_a_part_share_is_counted_once():
    """Two bars .04 into each other, as one part: 1.96 long, and not 2."""
    bars = [trimesh.creation.box((1, 0.2, 0.2)).apply_translation((x, 0, 0)) for x in (0, 0.96)]
    mesh, _ = stuffed(0.05, bar=turned(trimesh.util.concatenate(bars)))
    assert mesh.volume == pytest.approx(1.96 * 0.04, rel=0.01)


@pytest.mark.slow
def test_the_same_input_gives_the_same_mesh():
    """To the bit, sharp edges and all."""
    box = turned(trimesh.creation.box((1, 0.6, 0.4)))
    first, second = (stuffed(0.1, box=box)[0] for _ in range(2))
    assert (first.points == second.points).all()
    assert (first.tets == second.tets).all()


@pytest.mark.slow
def test_a_lattice_has_50_000_tets_where_no_edge_is_given():
    mesh, _ = stuffed(None, ball=trimesh.creation.icosphere(2))
    assert len(mesh.tets) == pytest.approx(50_000, rel=0.1)


def test_budget_of_tets_is_kept_by_a_lattice():
    mesh, _ = tetrahedralize(
        asset_of(ball=trimesh.creation.icosphere(2)), mesher="stuffing", max_tets=3000
    )
    assert 1000 < len(mesh.tets) <= 3000


def test_wrong_meshers_and_edges_are_usage_errors():
    cube = asset_of(cube=trimesh.creation.box((1, 1, 1)))
    for options, words in (
        ({"mesher": "stufing"}, "did you mean 'stuffing'"),
        ({"mesher": "stuffing", "edge_length": 1e-4}, "--edge-length"),
    ):
        with pytest.raises(UsageError, match=words):
            tetrahedralize(cube, **options)


def _guarded(seed):
    """A ball's lattice and random moves of its surface nodes, all wanted at once."""
    rng = np.random.default_rng(seed)
    solids = solids_of(trimesh.creation.icosphere(2))
    field = SolidField(solids, origin=solids.bounds[0], edge=0.25)
    lattice = lattice_around(field.bounds)
    mesh = cut(lattice, NodeField(field, lattice.nodes()), np.zeros(1))
    nodes = np.flatnonzero(~mesh.free)
    return Guard(mesh), nodes, mesh.points[nodes] + rng.normal(0, 0.25, (len(nodes), 3))


@pytest.mark.parametrize("seed", range(3))
def test_moves_never_leave_a_bad_tet(seed):
    """However many nodes want to move anywhere: angles stay within 9 to 166 degrees."""
    guard, nodes, targets = _guarded(seed)
    moved = guard.move(nodes, targets)
    angles = dihedral_angles(guard.points, guard.tets)
    assert 0 < len(moved) < len(nodes)
    assert signed_volumes(guard.points, guard.tets).min() > 0
    assert angles.min() >= 9 - 1e-6  # round-off of an arc cosine
    assert angles.max() <= 166 + 1e-6


@pytest.mark.parametrize("lid", [True, False])
def test_far_nodes_are_inside_as_their_neighbours_are(lid):
    """A box in a box, the inner one a hollow: asked node by node and group by group alike.

    Without its lid inside and outside hang together, and every node is asked.
    """
    box = trimesh.creation.box((1, 1, 1))
    box.update_faces(lid | (box.triangles_center[:, 2] < 0.49))
    solids = hollowed(solids_of(box), {0: 0.2})
    (shell,) = solids.shells
    open_ = replace(shell, faces=box.faces, part=np.zeros(len(box.faces), int), points=box.vertices)
    solids = solids if lid else replace(solids, shells=(open_,))
    field = SolidField(solids, origin=solids.bounds[0], edge=0.04)
    lattice = lattice_around(field.bounds)
    (one,), nodes = field.shells, lattice.nodes()
    assert one.shell.rimless == lid
    alone, together = one.value(nodes), one.value(nodes, lattice.together)
    assert np.allclose(alone, together, atol=1e-3)  # winding numbers of far trees are series
    assert np.array_equal(alone > 0, together > 0)
    assert len(np.unique(lattice.together(np.arange(lattice.node_count)))) == 2  # even and odd


@pytest.mark.slow
def test_parts_of_one_shell_are_one_body():
    """A ball of two materials in stripes: each is in pieces, the ball is not."""
    ball = trimesh.creation.icosphere(3)
    stripe = (np.floor(ball.triangles_center[:, 2] / 0.25) % 2).astype(bool)
    halves = {
        name: trimesh.Trimesh(ball.vertices, ball.faces[stripe == which], process=False)
        for name, which in (("dark", True), ("light", False))
    }
    mesh, report = tetrahedralize(asset_of(**halves), mesher="stuffing", max_tets=10_000)
    assert mesh.region_names == ("dark", "light")
    assert report.fallen_apart == ()
    assert report.ok, report.failed


def test_what_another_part_cuts_in_two_has_not_fallen_apart():
    """A wall through a beam, smaller than it: both halves of the beam hang on the wall."""
    beam = trimesh.creation.box((1.0, 0.2, 0.2))
    wall = trimesh.creation.box((0.1, 0.3, 0.3))
    mesh, report = stuffed(0.05, beam=beam, wall=wall)
    assert volumes(mesh) == pytest.approx({"beam": 0.9 * 0.04, "wall": 0.009}, rel=1e-3)
    assert report.fallen_apart == ()


def test_what_is_hidden_in_another_part_stops_no_search():
    """A box that fills its case to the last corner leaves it no volume, and volumes still match."""
    case = trimesh.creation.box((0.5, 0.3, 0.2))
    asset = asset_of(case=case, filling=case.copy(), knob=trimesh.creation.icosphere(2, 0.05))
    solids = Solids.of(repair(asset.parts)[0], 3, thinnest=1e-6)
    field = SolidField(solids, origin=solids.bounds[0], edge=0.05)
    wanted = wanted_volumes(field)
    assert (wanted == 0).any()
    assert np.isfinite(stuff(field).error)
