"""How much is said: a line for a group of pieces, and how sure a volume is."""

import re

import autophyx_tet as apx
import numpy as np
import pytest
import trimesh
from autophyx_tet.predictors.asset import Asset, Part
from autophyx_tet.toolkit.meshing.convert import tetrahedralize

from .test_losses import panels, prepared

MOST_LINES = 5


def converted(parts, *, tets=20_000):
    """What a lattice makes of parts, with all it promises."""
    mesh, report = tetrahedralize(Asset("scene", tuple(parts)), mesher="stuffing", max_tets=tets)
    assert report.ok, report.failed
    return mesh, report


def chess_piece(place, radius):
    """A turned body on an open disc of felt."""
    profile = np.array([[0, 0], [1, 0], [0.9, 0.3], [0.4, 0.6], [0.5, 1.6], [0, 2.2]])
    body = trimesh.creation.revolve(radius * profile, sections=12)
    felt = trimesh.creation.revolve(radius * np.array([[0, -0.05], [1.1, -0.05]]), sections=12)
    for mesh in (body, felt):
        mesh.apply_translation((*place, 0))
    return body, felt


@pytest.mark.long
def test_thirty_two_chess_pieces_are_told_of_in_a_few_lines():
    """Each stands on a disc without volume: one line for all 32 of them."""
    parts = []
    for i in range(32):
        body, felt = chess_piece((i % 8, i // 8), 0.3 + 0.1 * (i // 16))
        parts += [Part(f"piece {i}", body), Part(f"felt {i}", felt)]
    _, report = converted(parts, tets=60_000)
    assert len(report.warnings) <= MOST_LINES
    about_felt = [told for told in report.warnings if "felt" in told]
    assert len(about_felt) == 1
    assert "27 more" in about_felt[0]


@pytest.mark.slow
def test_a_car_of_panels_is_told_of_in_a_few_lines():
    """Twelve open panels, one body."""
    sides = panels(([0, 0, 0], [4, 1.6, 0.8]), ([1, 0.1, 0.8], [3, 1.5, 1.4]))
    _, report = converted(Part(f"panel {i}", side) for i, side in enumerate(sides))
    assert len(report.warnings) <= MOST_LINES


@pytest.mark.slow
def test_a_scene_of_loose_pieces_is_told_of_in_a_few_lines():
    """32 boxes, half of them without a lid."""
    parts = []
    for i in range(32):
        box = trimesh.creation.box((0.6, 0.6, 0.8))
        if i % 2:
            box.update_faces(box.triangles_center[:, 2] < 0.39)
        box.apply_translation((i % 8, i // 8, 0))
        parts.append(Part(f"crate {i}", box))
    _, report = converted(parts, tets=60_000)
    assert len(report.warnings) <= MOST_LINES


def test_what_a_lid_adds_is_told_as_an_interval():
    """An open box is its whole volume with a lid, and less for certain: where most of it is seen.

    The middle of the opening sees half of all directions closed, the bottom's nearly all.
    """
    box = trimesh.creation.box((1, 1, 1))
    closed = prepared(Part("box", box.copy()))
    assert (closed.losses.capped, closed.losses.gained) == (0, 0)
    box.update_faces(box.triangles_center[:, 2] < 0.49)
    capped = prepared(Part("box", box)).losses
    assert 0.1 < capped.capped < 0.6
    assert capped.volume == pytest.approx(1 - capped.capped, abs=0.03)  # two sets of 1,000 samples


@pytest.mark.slow
def test_a_warning_names_both_ends_of_that_interval():
    """A box without a lid: what the file encloses for certain, and what the mesh does."""
    box = trimesh.creation.box((1, 1, 1))
    box.update_faces(box.triangles_center[:, 2] < 0.49)
    _, report = converted([Part("box", box)], tets=5_000)
    (told,) = (told for told in report.warnings if "for certain" in told)
    least, most = (float(number) for number in re.findall(r"([0-9.]+) m\^3", told))
    assert least == pytest.approx(report.losses.volume, abs=0.03)
    assert most == pytest.approx(1.0, abs=0.01)


@pytest.mark.slow
def test_what_a_run_s_mesh_lacks_is_known_to_whoever_simulates_it_again(tmp_path):
    """Of a thin plate above a cube in a coarse lattice `simulate` says what `run` said."""
    cube = trimesh.creation.box((1, 1, 1))
    plate = trimesh.creation.box((1, 1, 0.1)).apply_translation((0, 0, 0.8))
    trimesh.util.concatenate([cube, plate]).export(tmp_path / "lid.obj")
    options = apx.ConvertOptions(mesher="stuffing", edge_length=0.2, up="z")
    ran = apx.run(tmp_path / "lid.obj", ["oak"], output=tmp_path / "out", convert_options=options)
    lacks = ran.conversion.report.differences
    assert any("thinner than the lattice's edge" in one for one in lacks)
    again = apx.simulate(tmp_path / "out" / "mesh.msh").verdicts()
    assert all(one in again[0].sentence for one in lacks)
    assert again[0] == ran.cases[0].simulation.verdicts()[0]
