"""What a conversion says: which things are likely to be hollow, by the words of their names."""

from dataclasses import replace

import numpy as np
import trimesh
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.predictors.asset import Asset, Part
from autophyx_tet.toolkit.cli.terminal import warn
from autophyx_tet.toolkit.meshing.convert import tetrahedralize
from autophyx_tet.toolkit.meshing.guarantees import ThinPieces
from autophyx_tet.toolkit.meshing.messages import MOST, likely_hollow, said


def hollow(name):
    """Whether a part of that name is likely to be a shell."""
    asset = Asset("thing", (Part(name, trimesh.creation.box()),))
    mesh = TetMesh(np.eye(4, 3), np.array([[3, 0, 1, 2]]), np.zeros(1, np.int32), (name,))
    return bool(likely_hollow(asset, mesh, {}))


def test_words_of_hollow_things_are_whole_words():
    """An object is no box, a staircase no case; plurals, camelCase and two words count."""
    rows = {
        "staircase": False,
        "two_objects": False,
        "robin": False,
        "jarrah plank": False,
        "tankard": False,
        "hullabaloo": False,
        "Box_01": True,
        "bottles": True,
        "lowerCabinet": True,
        "medicoscopia_bottle2": True,
        "lamp shade": True,
        "Lampshade": True,
        "suit-case": True,
    }
    for name, wanted in rows.items():
        assert hollow(name) is wanted, name


def test_a_vessel_with_walls_of_its_own_is_not_told_of():
    """A pot that is modelled as one fills little of its hull; a block called pot is told."""
    block = box_mesh((1, 1, 1), (10, 10, 10))
    x, y, z = block.centroids.T
    walls = (z < 0.1) | (np.abs(x - 0.5) > 0.4) | (np.abs(y - 0.5) > 0.4)
    asset = Asset("thing", (Part("pot", trimesh.creation.box()),))
    for tets, told in ((block.tets, ("pot",)), (block.tets[walls], ())):
        mesh = TetMesh(block.points, tets, np.zeros(len(tets), np.int32), ("pot",))
        assert likely_hollow(asset, mesh, {}) == told


def test_a_conversion_has_at_most_five_warnings():
    """What a lattice blurs is one of them, and what is left out: nothing goes unsaid."""
    asset = Asset("ball", (Part("ball", trimesh.creation.icosphere(subdivisions=2)),))
    _, report = tetrahedralize(asset, mesher="stuffing", edge_length_rel=0.1)
    assert said(report) == ()
    worse = replace(
        report,
        floaters=3,
        floating=0.001,
        sheets=("flag",),
        thin=ThinPieces(2, ("foil",), 1e-3, 1e-3),
        lost=("pin",),
        hollow=("pot",),
        losses=replace(report.losses, capped=0.3, swallowed=("egg",)),
        distances=replace(report.distances, sheet_share=0.02, missed_share=0.03),
        thin_parts=(("leg", 0.4),),
        closed_gaps=(("rack", 0.2),),
    )
    told = said(worse)
    assert len(told) == MOST
    for words in ("flag", "foil", "pin", "3 loose pieces", "2.0% of the surface"):
        assert sum(words in sentence for sentence in told) == 1
    for words in ("pot", "egg", "leg", "rack", "30% of the volume"):
        assert any(words in sentence for sentence in told)
    (one,) = said(replace(report, sheets=("flag",), lost=("pin",)))
    assert "flag" in one
    assert "pin" in one


def test_what_needs_nothing_done_is_in_the_report_and_not_in_the_terminal(capsys):
    """Small holes that were closed are a detail; what closes a large one is a warning."""
    asset = Asset("ball", (Part("ball", trimesh.creation.icosphere(subdivisions=2)),))
    _, report = tetrahedralize(asset, mesher="stuffing", edge_length_rel=0.1)
    for share, shown in ((0.01, False), (0.1, True)):
        (told,) = said(replace(report, distances=replace(report.distances, bridged_share=share)))
        assert f"{share:.1%} of the boundary" in told
        warn({"warnings": [told]})
        assert ("of the boundary" in capsys.readouterr().err) == shown
