"""Exports without the programs: binning laws, files listed, contents that any reader would see."""

import json
import re
from typing import get_args
from xml.etree import ElementTree

import numpy as np
import pytest
from autophyx_tet.converters.mesh.meshdata import read_data, read_mesh
from autophyx_tet.converters.npz import load_npz
from autophyx_tet.converters.programs.export import export_mesh
from autophyx_tet.converters.programs.material_bins import (
    NameStyle,
    bin_materials,
    named_arrays,
    vertex_masses,
)
from autophyx_tet.converters.registry import PROGRAMS
from autophyx_tet.fem.errors import InputError, UsageError
from autophyx_tet.fem.material import ElementMaterial, lame_parameters
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.fem.scene.up import UpAxis, up_vector
from hypothesis import given, settings
from hypothesis import strategies as st


def varying(cells=(6, 3, 3), seed=0, parts=("soft & low", 'stiff "top"')) -> TetMesh:
    """A bar of two parts whose E, nu, rho vary from tet to tet."""
    box = box_mesh((1, 0.2, 0.2), cells)
    rng = np.random.default_rng(seed)
    n = len(box.tets)
    material = ElementMaterial(
        10 ** rng.uniform(4, 9, n), rng.uniform(0.1, 0.45, n), 10 ** rng.uniform(2, 4, n)
    )
    return TetMesh(box.points, box.tets, (box.centroids[:, 2] > 0.1).astype(int), parts, material)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 99), st.integers(1, 80))
def test_binning_keeps_the_mass_and_the_count(seed, bins):
    """At most the wanted number of bins, none empty; sum rho V does not change."""
    mesh = varying(seed=seed)
    binned = bin_materials(mesh, bins=bins)
    assert 1 <= len(binned) <= bins
    assert set(binned.label) == set(range(len(binned)))
    np.testing.assert_allclose(mesh.with_material(binned.material).mass, mesh.mass, rtol=1e-12)


def test_stated_error_is_the_error_and_falls_with_bins():
    """max and mean |d log10 E|, |d nu|, |d log10 rho|, less for every doubling of the bins."""
    mesh = varying()
    assert mesh.material is not None
    means = []
    for bins in (1, 4, 16, 64, 256):
        binned = bin_materials(mesh, bins=bins)
        change = np.abs(np.log10(binned.material.E / mesh.material.E))
        np.testing.assert_allclose(binned.error.largest[0], change.max())
        means.append(sum(binned.error.mean))
    assert (np.diff(means) < 0).all()


def test_few_materials_are_exact():
    """Two materials in 64 bins: two bins, no error, order of no consequence."""
    mesh = varying()
    material = ElementMaterial(
        np.where(mesh.region, 1e9, 1e5), np.where(mesh.region, 0.2, 0.4),
        np.where(mesh.region, 900.0, 100.0),
    )  # fmt: skip
    binned = bin_materials(mesh.with_material(material))
    assert len(binned) == 2
    np.testing.assert_array_equal(binned.material.E, material.E)
    assert binned.error.largest == (0, 0, 0)


def test_round_off_makes_no_new_material():
    """Values that differ in their last bits only, as after a field, are one material."""
    mesh = box_mesh((1, 1, 1), (4, 4, 4))
    E = np.where(mesh.centroids[:, 0] < 0.5, 1.25e10, 6.7e4)
    shaken = E * (1 + 1e-15 * np.random.default_rng(0).normal(size=len(E)))
    material = ElementMaterial(shaken, np.full_like(E, 0.3), np.full_like(E, 600.0))
    binned = bin_materials(mesh.with_material(material))
    assert len(binned) == 2
    np.testing.assert_allclose(binned.E[binned.label], E, rtol=1e-12)


def test_vertex_masses_sum_to_the_mass():
    mesh = varying()
    np.testing.assert_allclose(vertex_masses(mesh).sum(), mesh.mass, rtol=1e-12)


@pytest.mark.parametrize("target", PROGRAMS)
def test_every_target_lists_the_files_it_wrote(target, tmp_path):
    """A path without suffix is a stem; with one of a stranger it is refused."""
    result = export_mesh(varying(), target, tmp_path / "out", bins=8)
    assert sorted(result.files) == sorted(tmp_path.iterdir())
    assert all(file.name.startswith("out") for file in result.files)
    assert (result.bins is not None) == PROGRAMS[target].binned
    with pytest.raises(UsageError, match="is written as"):
        export_mesh(varying(), target, tmp_path / "out.doc")
    with pytest.raises(InputError, match="run `assign` first"):
        export_mesh(varying().with_material(None), target, tmp_path / "bare")


def test_unknown_target_and_names():
    with pytest.raises(UsageError, match="unknown program 'ansys': known are gmsh, calculix"):
        export_mesh(varying(), "ansys", "x")
    with pytest.raises(InputError, match="unknown names"):
        named_arrays(varying(), "mine")


def test_names_on_export(tmp_path):
    """The same numbers under the names of other programs; regions keep theirs."""
    mesh = varying()
    assert mesh.material is not None
    expected = {
        "symbols": ("E", "nu", "rho"),
        "usd": ("youngsModulus", "poissonsRatio", "density"),
        "vomp": ("youngs_modulus", "poisson_ratio", "density"),
        "pixie": ("E", "nu", "density"),
        "newton": ("k_mu", "k_lambda", "rho"),
    }
    assert set(expected) == set(get_args(NameStyle))
    for names, arrays in expected.items():
        export_mesh(mesh, "gmsh", tmp_path / names, names=names)
        data = read_data(tmp_path / f"{names}.msh")
        assert data.mesh.region_names == mesh.region_names
        found = data.cell_data
        if names == "symbols":
            assert data.mesh.material is not None
            found = {name: getattr(data.mesh.material, name) for name in arrays}
        assert tuple(found) == arrays
        np.testing.assert_array_equal(found[arrays[2]], mesh.material.rho, err_msg=names)


@pytest.mark.parametrize("suffix", [".vtk", ".npz"])
def test_newton_gets_lame_parameters(suffix, tmp_path):
    """k_mu = E / 2 (1 + nu), k_lambda = E nu / ((1 + nu)(1 - 2 nu)); no array named density."""
    mesh = varying()
    assert mesh.material is not None
    lam, mu = lame_parameters(mesh.material.E, mesh.material.nu)
    export_mesh(mesh, "newton", tmp_path / f"m{suffix}")
    if suffix == ".vtk":
        data = read_data(tmp_path / "m.vtk")
        found = {**data.cell_data, **data.point_data}
        assert "density" not in found
    else:
        found = load_npz(tmp_path / "m.npz")
    np.testing.assert_allclose(found["k_mu"], mu, rtol=1e-6)
    np.testing.assert_allclose(found["k_lambda"], lam, rtol=1e-6)
    np.testing.assert_allclose(found["vertex_mass"].sum(), mesh.mass, rtol=1e-12)


def test_sofa_scene_is_xml_with_one_factor_a_tet(tmp_path):
    """E_e = youngModulus x factor_e; masses sum to the mass; the lowest points are held."""
    mesh = varying()
    assert mesh.material is not None
    scene, mesh_file = export_mesh(mesh, "sofa", tmp_path / "a & b").files
    root = ElementTree.parse(scene).getroot()
    force = root.find(".//TetrahedronFEMForceField")
    assert force is not None
    factors = np.array(force.attrib["localStiffnessFactor"].split(), dtype=float)
    np.testing.assert_allclose(
        factors * float(force.attrib["youngModulus"]), mesh.material.E, rtol=1e-12
    )
    mass = root.find(".//DiagonalMass")
    assert mass is not None
    np.testing.assert_allclose(sum(map(float, mass.attrib["vertexMass"].split())), mesh.mass)
    loader = root.find(".//MeshGmshLoader")
    assert loader is not None
    assert loader.attrib["filename"] == mesh_file.name
    held = root.find(".//FixedProjectiveConstraint")
    assert held is not None
    lowest = mesh.points[np.array(held.attrib["indices"].split(), dtype=int)]
    assert (lowest[:, 2] < 0.02 * 0.2).all()


def test_fenics_table_has_a_row_a_group(tmp_path):
    """Physical groups of the .msh are the rows of the JSON; the loader is Python."""
    mesh_file, table, loader = export_mesh(varying(), "fenics", tmp_path / "m", bins=5).files
    rows = json.loads(table.read_text())["bins"]
    groups = read_mesh(mesh_file)
    assert len(groups.region_names) == len(rows) == 5
    compile(loader.read_text(), loader.name, "exec")
    mass = sum(rows[str(i + 1)]["rho"] * v for i, v in enumerate(groups.region_volumes()))
    np.testing.assert_allclose(mass, varying().mass)


def test_calculix_deck_holds_every_tet_once(tmp_path):
    (deck,) = export_mesh(varying(), "calculix", tmp_path / "m").files
    blocks = deck.read_text().split("*")
    count = sum(len(b.splitlines()) - 1 for b in blocks if b.startswith("ELEMENT, TYPE=C3D"))
    assert count == len(varying().tets)
    assert "DLOAD\nEALL, GRAV, 9.81, 0., 0., -1." in deck.read_text()


def test_calculix_numbers_fit_their_field(tmp_path):
    """No number is longer than the 20 characters that CalculiX reads: 1.2e-05 would become 1.2."""
    box = box_mesh((1, 1, 1), (1, 1, 1), lo=(1e-5 / 3, -1e-5 / 3, 1e-7 / 7))
    points = box.points + 1e-17
    E = np.full(len(box.tets), 1e10 / 3)
    mesh = TetMesh(points, box.tets, box.region, material=ElementMaterial(E, E * 1e-11, E * 1e-7))
    (deck,) = export_mesh(mesh, "calculix", tmp_path / "deck").files
    lines = [row for row in deck.read_text().splitlines()[2:] if not row.startswith("*")]
    numbers = [word.strip() for row in lines for word in row.split(",")]
    assert max(map(len, numbers)) <= 20
    assert any("e-06" in number for number in numbers)


@pytest.mark.parametrize("up", get_args(UpAxis))
def test_usd_has_y_or_z_up(tmp_path, up):
    """A stage knows no other: heights along its up axis are those along the mesh's."""
    mesh = varying()
    (stage,) = export_mesh(mesh, "usd", tmp_path / "m", up=up).files
    text = stage.read_text()
    axis = re.search(r'upAxis = "([YZ])"', text).group(1)
    rows = re.search(r"point3f\[\] points = \[(.*?)\]", text).group(1)
    points = np.array(re.findall(r"-?[\d.]+(?:e-?\d+)?", rows), dtype=float).reshape(-1, 3)
    assert points[:, "XYZ".index(axis)] == pytest.approx(mesh.points @ up_vector(up))
    turned = np.linalg.det(points[mesh.tets[:, 1:]] - points[mesh.tets[:, :1]])
    assert (turned > 0).all()  # no mirror


@pytest.mark.slow
@pytest.mark.blockers
@pytest.mark.parametrize("up", get_args(UpAxis))
def test_gravity_and_ground_of_a_scene_are_against_up(tmp_path, up):
    """SOFA, CalculiX and MuJoCo: gravity points down, what is held is lowest, so is the ground."""
    mesh, down = varying(), -up_vector(up)
    low = (mesh.points @ -down).min()
    (scene, _) = export_mesh(mesh, "sofa", tmp_path / "m", up=up).files
    root = ElementTree.parse(scene).getroot()
    assert np.array(root.get("gravity").split(), float) == pytest.approx(9.81 * down)
    held = root.find(".//FixedProjectiveConstraint").get("indices").split()
    heights = mesh.points[np.array(held, int)] @ -down - low
    assert heights == pytest.approx(0, abs=0.02 * np.ptp(mesh.points @ down))  # BASE_SHARE
    (deck,) = export_mesh(mesh, "calculix", tmp_path / "m", up=up).files
    load = re.search(r"EALL, GRAV, (.*)", deck.read_text()).group(1).split(",")
    assert np.array(load, float) == pytest.approx([9.81, *down])
    (world,) = export_mesh(mesh, "mujoco", tmp_path / "m", up=up).files
    root = ElementTree.parse(world).getroot()
    assert np.array(root.find("option").get("gravity").split(), float) == pytest.approx(9.81 * down)
    ground = root.find(".//geom[@name='ground']")
    assert np.array(ground.get("zaxis").split(), float) == pytest.approx(-down)
    place = np.array(ground.get("pos").split(), float) @ -down
    assert low - 0.01 < place < low  # the contact margins of ground and body, 2e-3 of the diagonal
