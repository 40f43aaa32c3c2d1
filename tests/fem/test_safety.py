"""Strength: a bar gives way at its material's stress, and what is printed of small numbers."""

import numpy as np
import pytest
from autophyx_tet.fem import BoundaryConditions, ElementMaterial, Scene, TetMesh, box_mesh
from autophyx_tet.fem.safety import part_safety, part_stresses
from autophyx_tet.fem.scene.loads import Traction
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.equilibrium import StaticMethod
from autophyx_tet.fem.solve.statics import solve_static
from autophyx_tet.fem.table import load_strengths, load_table
from autophyx_tet.toolkit.verdict.checks import percent, strength, usual_size

from .bodies import faces_at

ROLLERS = ("plane:x<0:x", "plane:y<0:y", "plane:z<0:z")


def pulled(row, stress, *, E=None):
    """A bar of a row of the table under a uniaxial ``stress`` [Pa]: the same in every tet."""
    mesh = box_mesh((0.2, 0.02, 0.02), (4, 1, 1))
    value = load_table().exact(row).value()
    material = ElementMaterial.uniform(len(mesh.tets), E=E or value.E, nu=value.nu, rho=value.rho)
    mesh = TetMesh(mesh.points, mesh.tets, mesh.region, ("bar",), material)
    said = BoundaryConditions(fix=ROLLERS, pressure=(f"plane:x>0.2={-stress}",))
    scene = said.applied(Scene(mesh=mesh))
    return StaticMethod().solve(scene, law="linear", order=1).static


def test_a_bar_yields_at_its_stress():
    """Uniaxial stress is von Mises' stress: factor = limit / stress, exactly one at the limit."""
    limit = load_strengths()["aluminium 6061-T6"].tension.min
    for share in (0.5, 1.0, 3.1):
        (found,) = part_safety(
            pulled("aluminium 6061-T6", share * limit), {"bar": "aluminium 6061-T6"}
        )
        assert found.factor == pytest.approx(1 / share, rel=1e-6)
    check = strength(found)
    assert check.outcome == "failed"
    assert "past yield strength, 3.1 x" in check.sentence
    assert "bar (aluminium 6061-T6) yields" in check.sentence


def test_what_breaks_is_pulled_apart_before_it_is_crushed():
    """A brittle row: the tensile limit in tension, the compressive one in compression."""
    strengths = load_strengths()
    row = next(name for name, s in strengths.items() if s.kind != "yield" and s.compression)
    known = strengths[row]
    for sign, side, limit in (
        (1, "tension", known.tension.min),
        (-1, "compression", known.compression.min),
    ):
        (found,) = part_safety(pulled(row, sign * 0.5 * limit), {"bar": row})
        assert found.side == side
        assert found.factor == pytest.approx(2.0, rel=1e-6)


def test_what_is_pulled_cracks_and_what_is_pressed_is_crushed():
    """Concrete past either of its strengths: each by its own name."""
    known = load_strengths()["concrete C25"]
    for stress, words in (
        (2 * known.tension.min, "cracks: past tensile strength, 2 x: tension"),
        (-2 * known.compression.min, "is crushed: past compressive strength, 2 x: compression"),
    ):
        (found,) = part_safety(pulled("concrete C25", stress), {"bar": "concrete C25"})
        assert words in strength(found).sentence


def test_no_verdict_where_the_modulus_is_not_the_materials():
    """An apparent E of a hollow part, or no row at all: its stress would be smeared, no factor."""
    aluminium = {"bar": "aluminium 6061-T6"}
    assert part_safety(pulled("aluminium 6061-T6", 1e6, E=1e9), aluminium) == ()
    assert part_safety(pulled("aluminium 6061-T6", 1e6), {}) == ()


@pytest.mark.parametrize("cells", [(12, 1, 1), (16, 2, 2)], ids=str)
def test_a_bent_bar_has_its_largest_stress_at_its_skin(cells):
    """Cantilever under a force at its tip: M c / I at the root; nu = 0: no corner is singular."""
    L, side, force = 1.0, 0.05, 5900.0
    mesh = box_mesh((L, side, side), cells)
    steel = load_table().exact("carbon steel").value()
    material = ElementMaterial.uniform(len(mesh.tets), E=steel.E, nu=0.0, rho=steel.rho)
    mesh = TetMesh(mesh.points, mesh.tets, mesh.region, ("bar",), material)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] < 1e-9)
    down = np.array([0.0, 0.0, -force / side**2])
    result = solve_static(mesh, held, traction=Traction(faces_at(mesh, 0, L), down), order=2)
    (found,) = part_safety(result, {"bar": "carbon steel"})
    (stresses,) = part_stresses(result)
    assert stresses.largest == found.stress  # one number, wherever it is told
    assert found.stress == pytest.approx(6 * force * L / side**3, rel=0.1)
    assert found.place[0] == pytest.approx(0.0, abs=1e-9)


def test_small_shares_are_never_zero_and_large_ones_are_times():
    assert percent(5e-7) == "less than 0.01 %"
    assert percent(0.0123) == "1.2 %"
    assert percent(0.997) == "100 %"
    assert percent(3.25) == "325 %"


def test_a_bracket_of_80_metres_is_asked_for_its_unit():
    mesh = box_mesh((80.0, 10.0, 1.0), (4, 1, 1))
    mesh = mesh.with_material(ElementMaterial.uniform(24, E=1e9, nu=0.3, rho=1000.0))
    check = usual_size(mesh)
    assert check.outcome == "failed"
    assert "likely in another unit. Convert with --units mm" in check.sentence
    small = TetMesh(mesh.points * 1e-5, mesh.tets, mesh.region, material=mesh.material)
    assert "--units m " in usual_size(small).sentence
    for odd in (mesh, small):  # nobody is asked for what was said
        assert usual_size(odd, stated=True).outcome == "passed"
        assert "unit" not in usual_size(odd, stated=True).sentence
    usual = TetMesh(mesh.points * 1e-2, mesh.tets, mesh.region, material=mesh.material)
    assert usual_size(usual).outcome == "passed"
    assert np.isfinite(usual_size(usual).value)
