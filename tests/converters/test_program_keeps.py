"""What an export says it keeps is in its files; what is given beside it, it names as lost."""

import re
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from autophyx_tet.converters.mesh.meshdata import lost_words, read_data
from autophyx_tet.converters.npz import load_npz
from autophyx_tet.converters.programs.export import export_mesh
from autophyx_tet.converters.programs.material_bins import bin_materials
from autophyx_tet.converters.registry import MATERIAL, PROGRAMS, Keeps
from autophyx_tet.fem.errors import UsageError
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.table import load_grains

BOX = box_mesh((1, 1, 1), (3, 2, 2))
N = len(BOX.tets)
NAMES = {Keeps.E: "E", Keeps.NU: "nu", Keeps.RHO: "rho"}
CASES = [(name, form) for name in PROGRAMS for form in PROGRAMS[name].formats]


def varying() -> ElementMaterial:
    """E, nu, rho of their own for every tet."""
    rng = np.random.default_rng(0)
    return ElementMaterial(
        10 ** rng.uniform(4, 9, N), rng.uniform(0.1, 0.45, N), 10 ** rng.uniform(2, 4, N)
    )


def exported(name, form, folder, mesh, **options):
    """Export to the main file of a format, in a folder of its own."""
    folder = folder / f"{name}{form.suffixes[0]}-{len([*folder.iterdir()])}"
    folder.mkdir()
    return export_mesh(mesh, name, folder / f"out{form.suffixes[0]}", **options)


def values_in(files) -> dict[str, np.ndarray]:
    """E, nu, rho a tet as a reader finds them: arrays, primvars or factors of one modulus."""
    main = files[0]
    if main.suffix == ".usda":
        found = re.findall(r"primvars:(\w+) = \[(.*?)\]", main.read_text())
        return {name: np.array(row.split(","), dtype=float) for name, row in found}
    if main.suffix == ".scn":
        force = ElementTree.parse(main).getroot().find(".//TetrahedronFEMForceField")
        assert force is not None
        factors = np.array(force.attrib["localStiffnessFactor"].split(), dtype=float)
        return {"E": factors * float(force.attrib["youngModulus"])}
    if main.suffix == ".npz":
        arrays = {name: values.astype(float) for name, values in load_npz(main).items()}
        lam, mu = arrays["k_lambda"], arrays["k_mu"]
        return {"E": mu * (3 * lam + 2 * mu) / (lam + mu), "nu": lam / (2 * (lam + mu))}
    material = read_data(main).mesh.material
    assert material is not None
    return {name: getattr(material, name) for name in NAMES.values()}


def test_every_value_that_is_kept_is_in_the_files(tmp_path):
    """E, nu, rho of every tet, exactly or to float32; what is lumped or averaged is told."""
    mesh = BOX.with_material(varying())
    for name, form in CASES:
        done = exported(name, form, tmp_path, mesh, bins=4)
        assert not set(done.lost) & form.keeps
        assert set(done.lost) == MATERIAL - form.keeps - form.binned - form.lumped, name
        for item in MATERIAL & form.keeps:
            expected = getattr(mesh.material, NAMES[item])
            np.testing.assert_allclose(values_in(done.files)[NAMES[item]], expected, rtol=1e-5)


def test_a_grain_is_in_the_files_or_told(tmp_path):
    """The nine constants and the axes of a wooden part stand in the files, or it is named lost."""
    oak = load_grains()["white oak (along grain)"].constants(1.2e10)
    axes = np.array([[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    region = (BOX.centroids[:, 0] > 0.5).astype(int)
    plain = ElementMaterial.uniform(N, E=1.2e10, nu=0.3, rho=700)
    material = plain.with_grain(region == 0, oak, axes)
    mesh = TetMesh(BOX.points, BOX.tets, region, ("leg", "seat"), material)
    for name, form in CASES:
        done = exported(name, form, tmp_path, mesh)
        keeps = Keeps.GRAIN in form.keeps | form.binned
        assert (Keeps.GRAIN in done.lost) != keeps, name
        said = lost_words(done.lost, mesh)
        assert ("the grain of leg" in said) != keeps, name
        if keeps:
            for value in (*oak, 0.6, 0.8):
                near = np.isclose(numbers_in(done.files), value, rtol=1e-11)
                assert near.any(), f"{name}: {value}"
    assert {name for name, form in CASES if Keeps.GRAIN in form.keeps | form.binned} == {
        "gmsh", "calculix", "fenics"
    }  # fmt: skip


def test_bins_part_by_the_grain():
    """Two directions never share a bin, however few; E along the grain is that of the bin."""
    oak = load_grains()["white oak (along grain)"].constants(1.0)
    material, left = varying(), BOX.centroids[:, 0] < 0.5
    for own, axes in ((left, np.eye(3)), (~left, np.roll(np.eye(3), 1, axis=0))):
        material = material.with_grain(own, oak.times(material.E[own]), axes)
    found = bin_materials(BOX.with_material(material), bins=4, grain=True)
    assert len(found) <= 4
    assert not set(found.label[left]) & set(found.label[~left])
    assert found.grain is not None
    np.testing.assert_allclose(found.grain.constants[:, 0], found.E, rtol=1e-12)
    np.testing.assert_allclose(found.grain.constants[:, 1] / found.E, oak.E_R, rtol=1e-9)
    np.testing.assert_array_equal(found.grain.axes[found.label], material.axes)
    with pytest.raises(UsageError, match="--bins 1: the grain runs in 2 ways"):
        bin_materials(BOX.with_material(material), bins=1, grain=True)


def numbers_in(files) -> np.ndarray:
    """All numbers of the text files."""
    texts = [file.read_text() for file in files if file.suffix != ".py"]
    words = re.findall(r"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?", " ".join(texts))
    return np.array(words, dtype=float)


def test_few_values_are_exact_in_their_bins(tmp_path):
    """Two materials: what is binned stands in the files as it is; what is not, is told as lost."""
    pairs = {Keeps.E: (1.2345e7, 7.6543e9), Keeps.NU: (0.2125, 0.3725), Keeps.RHO: (1234.5, 987.25)}
    columns = [np.where(np.arange(N) % 2, *pair) for pair in pairs.values()]
    mesh = BOX.with_material(ElementMaterial(*columns))
    for name, form in [case for case in CASES if case[1].binned]:
        done = exported(name, form, tmp_path, mesh)
        assert done.error is not None
        assert done.error.largest == (0, 0, 0)
        for item in MATERIAL & form.binned:
            for value in pairs[item]:
                near = np.isclose(numbers_in(done.files), value, rtol=1e-12)
                assert near.any(), f"{name}: {item} {value}"
        assert set(done.lost) == MATERIAL - form.keeps - form.binned - form.lumped, name


def test_uniform_values_are_never_lost(tmp_path):
    """One material and one region: every program says all of it, and warns of nothing."""
    mesh = BOX.with_material(ElementMaterial.uniform(N, E=1e6, nu=0.3, rho=1e3))
    for name, form in CASES:
        assert exported(name, form, tmp_path, mesh).lost == (), name
        shaken = ElementMaterial(np.full(N, 1e6), np.full(N, 0.3), 1e3 * (1 + 1e-15 * np.arange(N)))
        assert exported(name, form, tmp_path, mesh.with_material(shaken)).lost == (), name


def regions_in(files) -> dict[str, np.ndarray]:
    """Ids of the tets of every region by its name."""
    for file in files:
        if file.suffix in (".msh", ".vtk"):
            mesh = read_data(file).mesh
            return {n: np.flatnonzero(mesh.region == i) for i, n in enumerate(mesh.region_names)}
    sets = re.findall(r"\*\* region \d+: '(.*)'\n\*ELSET.*\n((?:[\d, ]+\n)+)", files[0].read_text())
    return {name: np.array(re.findall(r"\d+", ids), dtype=int) - 1 for name, ids in sets}


def test_regions_are_in_the_files_or_told(tmp_path):
    region = (BOX.centroids[:, 0] > 0.5).astype(int)
    uniform = ElementMaterial.uniform(N, E=1e6, nu=0.3, rho=1e3)
    mesh = TetMesh(BOX.points, BOX.tets, region, ("leg", "seat"), uniform)
    for name, form in CASES:
        done = exported(name, form, tmp_path, mesh)
        assert done.lost == (() if Keeps.REGIONS in form.keeps else (Keeps.REGIONS,)), name
        if Keeps.REGIONS in form.keeps:
            found = regions_in(done.files)
            assert list(found) == ["leg", "seat"], name
            np.testing.assert_array_equal(found["seat"], np.flatnonzero(region), err_msg=name)


def held_in(file) -> dict[tuple[int, int], float]:
    """Prescribed displacement [m] by point and component, from a deck or a SOFA scene."""
    if file.suffix == ".scn":
        body = ElementTree.parse(file).getroot().find("Node")
        assert body is not None
        return {
            (int(i), axis): 0.0
            for held in body
            if held.tag.endswith("FixedProjectiveConstraint")
            for i in held.attrib["indices"].split()
            for axis, said in enumerate(held.attrib.get("fixedDirections", "1 1 1").split())
            if said == "1"
        }
    block = file.read_text().partition("*BOUNDARY\n")[2].partition("*")[0]
    rows = [line.split(", ") for line in block.splitlines()]
    return {(int(i) - 1, int(axis) - 1): float(value) for i, axis, _, value in rows}


def test_supports_are_in_the_scene_or_told(tmp_path):
    """Clamped points, rollers, a prescribed displacement and springs, one kind at a time."""
    mesh = BOX.with_material(ElementMaterial.uniform(N, E=1e6, nu=0.3, rho=1e3))
    none = Supports.none(len(BOX.points))
    kinds = {
        Keeps.HELD: none.with_fixed([0, 3], (0, 1, 2)),
        Keeps.ROLLERS: none.with_fixed([1, 2], 2).with_fixed([2, 5], 0),
        Keeps.PRESCRIBED: none.with_fixed([4], (0, 1, 2), 0.125),
        Keeps.SPRINGS: none.with_springs([5], 1e3),
    }
    for name, form in CASES:
        for item, supports in kinds.items():
            done = exported(name, form, tmp_path, mesh, supports=supports, order=1)
            given = {item} | ({Keeps.HELD} if item is Keeps.PRESCRIBED else set())
            assert set(done.lost) == given - form.keeps, f"{name}: {item}"
            if item in form.keeps:
                points, axes = np.nonzero(supports.fixed)
                expected = {
                    (int(i), int(a)): supports.values[i, a]
                    for i, a in zip(points, axes, strict=True)
                }
                assert held_in(done.files[0]) == expected, f"{name}: {item}"


def springs_in(file) -> dict[tuple[int, int], float]:
    """Stiffness [N/m] of the springs of a deck by point and component."""
    found = re.findall(
        r"TYPE=SPRING1.*\n((?:\d+, \d+\n)+)\*SPRING.*\n(\d)\n(.*)\n", file.read_text()
    )
    return {
        (int(row.split(", ")[1]) - 1, int(axis) - 1): float(k)
        for rows, axis, k in found
        for row in rows.splitlines()
    }


def test_springs_and_quadratic_elements_are_in_the_deck(tmp_path):
    """Every spring with its axis and stiffness; ten nodes a tet, edges in VTK's order."""
    mesh = BOX.with_material(ElementMaterial.uniform(N, E=1e6, nu=0.3, rho=1e3))
    held = Supports.none(len(BOX.points)).with_springs([3, 5], (0.0, 2e3, 7e2))
    held = held.with_springs([5], (0.0, 0.0, 1e2))
    (deck,) = export_mesh(mesh, "calculix", tmp_path / "deck", supports=held, order=2).files
    assert springs_in(deck) == {(3, 1): 2e3, (5, 1): 2e3, (3, 2): 7e2, (5, 2): 8e2}
    text = deck.read_text()
    table = text.partition("NSET=NALL\n")[2].partition("*")[0].splitlines()
    nodes = np.array([row.split(",")[1:] for row in table], dtype=float)
    rows = text.partition("TYPE=C3D10, ELSET=BIN1\n")[2].partition("*")[0].splitlines()
    tets = np.array([row.split(",")[1:] for row in rows], dtype=int) - 1
    ends = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]  # of nodes 5 to 10, CalculiX's manual
    middles = np.stack([nodes[tets[:, list(pair)]].mean(axis=1) for pair in ends], axis=1)
    np.testing.assert_allclose(nodes[tets[:, 4:]], middles, atol=1e-12)
    for name, form in CASES:
        lost = exported(name, form, tmp_path, mesh, order=2).lost
        assert (Keeps.QUADRATIC in lost) == (Keeps.QUADRATIC not in form.keeps), name


def test_a_deck_says_of_which_regions_its_materials_are(tmp_path):
    region = np.arange(N) % 2
    mesh = replace(BOX, region=region.astype(np.int32), region_names=("lid", "gehäuse"))
    mesh = mesh.with_material(
        ElementMaterial(10.0 ** (9 + region), 0.3 + 0 * region, 1e3 + 0.0 * region)
    )
    (deck,) = export_mesh(mesh, "calculix", tmp_path / "deck").files
    said = re.findall(r"\*\* material \d: (.*)\n\*MATERIAL.*\n\*ELASTIC\n(\S+),", deck.read_text())
    assert {name: float(E) for name, E in said} == {"'lid'": 1e9, "'geh?use'": 1e10}


def test_usd_binds_a_material_to_the_body_itself(tmp_path):
    """A reader that looks at no subset finds a deformable body with the mean of its materials."""
    for kinds in (1, 2):
        kind = np.arange(N) % kinds
        mesh = BOX.with_material(
            ElementMaterial(10.0 ** (4 + kind), 0.3 + 0 * kind, 500.0 + 400 * kind)
        )
        (stage,) = export_mesh(mesh, "usd", tmp_path / str(kinds)).files
        text = stage.read_text()
        body = text.partition("GeomSubset")[0]
        assert "PhysicsDeformableBodyAPI" in body
        assert "PhysicsVolumeDeformableSimAPI" in body
        name = re.findall(r"material:binding = </World/Materials/(\w+)>", body)
        assert len(name) == 1
        density = re.findall(rf'"{name[0]}".*?physics:density = (\S+)', text, re.DOTALL)
        np.testing.assert_allclose(float(density[0]), mesh.mass / mesh.volume, rtol=1e-12)
