"""Robots' simulators take our bodies: their mass, their material, and how they rest on a floor."""

import re

import numpy as np
import pytest
from autophyx_tet.converters.programs.export import export_mesh
from autophyx_tet.fem.material import ElementMaterial, lame_parameters
from autophyx_tet.fem.mesh import TetMesh, box_mesh

from .test_external import beam

pytestmark = pytest.mark.external
STIFFNESSES = (1e5, 4e7, 2e9)  # a gel, a thermoplastic polyurethane, a hard plastic


def finger(E, thin=1.0) -> TetMesh:
    """A finger of 100 x 20 x 20 mm; its first layer of cells is ``thin`` times as thick."""
    box = box_mesh((0.1, 0.02, 0.02), (8, 2, 2))
    points = box.points.copy()
    points[np.isclose(points[:, 0], 0.0125), 0] *= thin
    mesh = TetMesh(points, box.tets, box.region, box.region_names)
    return mesh.with_material(ElementMaterial.uniform(len(box.tets), E=E, nu=0.4, rho=1200.0))


def in_mujoco(mesh, folder, *, floor=True):
    """MuJoCo, its model and data of an exported mesh, and the export."""
    mujoco = pytest.importorskip("mujoco")
    done = export_mesh(mesh, "mujoco", folder / "scene")
    model = mujoco.MjModel.from_xml_path(str(done.files[0]))
    if not floor:
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return mujoco, model, data, done


def centre(model, data):
    return model.body_mass @ data.xipos / model.body_mass.sum()


def warned(data) -> int:
    return sum(int(warning.number) for warning in data.warning)


@pytest.mark.blockers
@pytest.mark.parametrize("thin", [1.0, 0.05])
@pytest.mark.parametrize("E", STIFFNESSES)
def test_in_mujoco_a_body_of_any_stiffness_falls_freely(E, thin, tmp_path):
    """196 mm in .2 s, through thin tets too, and MuJoCo warns of nothing."""
    mujoco, model, data, _ = in_mujoco(finger(E, thin), tmp_path, floor=False)
    step, before = model.opt.timestep, centre(model, data)
    steps = round(0.2 / step)
    mujoco.mj_step(model, data, steps)
    mujoco.mj_forward(model, data)
    fallen = (before - centre(model, data))[2]
    time = steps * step
    # Its solver stops at 1e-8 of the residual, which many steps add up.
    assert fallen == pytest.approx(9.81 * step**2 * steps * (steps + 1) / 2, rel=1e-6)
    # Semi-implicit steps fall g h t / 2 too far: h / t of the fall, 1e-3 at .2 ms.
    assert fallen == pytest.approx(9.81 * time**2 / 2, rel=1e-3 * (1 + 1e-6))
    assert warned(data) == 0


@pytest.mark.blockers
@pytest.mark.slow
@pytest.mark.parametrize("E", STIFFNESSES)
def test_in_mujoco_a_body_of_any_stiffness_rests_at_its_weight(E, tmp_path):
    """Contact forces are m g within 1 %, and no point is deeper in the floor than .2 mm of 20."""
    mesh = finger(E)
    mujoco, model, data, _ = in_mujoco(mesh, tmp_path)
    force, carried, depth = np.zeros(6), [], 0.0
    steps = round(0.4 / model.opt.timestep)
    for step in range(steps):
        mujoco.mj_step(model, data)
        depth = max([depth, *(-contact.dist for contact in data.contact)])
        if step >= steps * 3 // 4:
            total = np.zeros(3)
            for k in range(data.ncon):
                mujoco.mj_contactForce(model, data, k, force)
                total += data.contact[k].frame.reshape(3, 3).T @ force[:3]
            carried.append(abs(total[2]))
    assert np.mean(carried) == pytest.approx(mesh.mass * 9.81, rel=0.01)
    assert depth < 0.01 * 0.02
    assert warned(data) == 0


@pytest.mark.blockers
@pytest.mark.parametrize("E", STIFFNESSES)
def test_in_mujoco_a_spin_is_braked_by_no_more_than_is_said(E, tmp_path):
    """Angular momentum of 10 rad/s over 2 radians: what an implicit step eats is in the note."""
    mujoco, model, data, done = in_mujoco(finger(E), tmp_path, floor=False)
    soft = model.nv > 6
    if soft:
        away = data.xipos[1:] - centre(model, data)
        data.qvel[:] = np.cross([0, 10.0, 0], away).ravel()
    else:
        data.qvel[4] = 10.0

    def spin():
        mujoco.mj_forward(model, data)
        mujoco.mj_subtreeVel(model, data)
        return data.subtree_angmom[0, 1]

    before = spin()
    mujoco.mj_step(model, data, round(0.2 / model.opt.timestep))
    (note,) = done.notes
    said = float(re.search(r"loses about (\S+) %", note)[1]) / 100 if soft else 0.0  # pyright: ignore
    assert abs(spin() / before - 1) < 2 * said * 1.2 + 1e-3  # a figure of one digit; 2 radians


@pytest.mark.blockers
def test_what_mujoco_cannot_move_softly_is_one_rigid_body_and_said_so(tmp_path):
    """Mass, centre and inertia of a box in two halves, lead on wood, as by the text book."""
    box = box_mesh((0.1, 0.02, 0.04), (8, 2, 2))
    heavy = box.centroids[:, 0] > 0.05
    rho = np.where(heavy, 11000.0, 500.0)
    material = ElementMaterial(np.where(heavy, 1.6e10, 1e10), np.full(len(rho), 0.3), rho)
    mesh = TetMesh(box.points, box.tets, heavy.astype(int), ("wood", "lead"), material)
    _, model, _, done = in_mujoco(mesh, tmp_path)
    (note,) = done.notes
    assert "one rigid body" in note
    assert model.nv == 6
    assert model.body_mass.sum() == pytest.approx(mesh.mass, rel=1e-12)
    masses = np.array([500.0, 11000.0]) * 0.05 * 0.02 * 0.04
    middles = np.array([0.025, 0.075])
    x = masses @ middles / masses.sum()
    np.testing.assert_allclose(model.body_ipos[1], (x, 0.01, 0.02), atol=1e-12)
    along = masses @ (0.05**2 / 12 + (middles - x) ** 2)
    wide, high = masses.sum() * 0.02**2 / 12, masses.sum() * 0.04**2 / 12
    found = np.sort(model.body_inertia[1])
    np.testing.assert_allclose(found, np.sort([wide + high, along + high, along + wide]), rtol=1e-9)


def test_mujoco_compiles_the_flexes_with_the_right_mass(tmp_path):
    """One flex a bin, all tets, 3 degrees of freedom a vertex, total mass = sum rho V."""
    mujoco = pytest.importorskip("mujoco")
    mesh = beam((8, 2, 2))
    (scene,) = export_mesh(mesh, "mujoco", tmp_path / "scene").files
    model = mujoco.MjModel.from_xml_path(str(scene))
    assert (model.nflex, model.nflexelem) == (2, len(mesh.tets))
    assert model.nv == 3 * len(mesh.points)
    assert model.body_mass.sum() == pytest.approx(mesh.mass, rel=1e-12)
    data = mujoco.MjData(model)
    for _ in range(10):
        mujoco.mj_step(model, data)
    assert np.isfinite(data.qpos).all()


def test_in_mujoco_the_body_falls_and_rests_at_its_weight(tmp_path):
    """From its own contact forces: once it rests, they are m g; it stands at its own height."""
    mujoco = pytest.importorskip("mujoco")
    box = box_mesh((0.2, 0.2, 0.2), (2, 2, 2))
    mesh = box.with_material(ElementMaterial.uniform(len(box.tets), E=1e5, nu=0.3, rho=500.0))
    (scene,) = export_mesh(mesh, "mujoco", tmp_path / "scene").files
    model = mujoco.MjModel.from_xml_path(str(scene))
    model.dof_damping[:] = 0.3  # [N s/m] at every vertex, so that it comes to rest
    data = mujoco.MjData(model)
    means, force = [], np.zeros(6)
    for step in range(3000):
        mujoco.mj_step(model, data)
        if step >= 2000:
            total = np.zeros(3)
            for k in range(data.ncon):
                mujoco.mj_contactForce(model, data, k, force)
                total += data.contact[k].frame.reshape(3, 3).T @ force[:3]
            means.append(abs(total[2]))
    assert np.mean(means) == pytest.approx(mesh.mass * 9.81, rel=0.01)  # it still trembles a little
    # Rest of a column pressed by itself: rho g h^2 / 2 E = 1 mm.
    top = data.qpos[2::3][box.points[:, 2] == 0.2].mean()
    assert -0.005 < top < 0


@pytest.mark.parametrize("suffix", [".vtk", ".npz"])
def test_newton_takes_lame_parameters_per_tet(suffix, tmp_path):
    """``TetMesh.create_from_file`` gives back k_mu and k_lambda to float32."""
    newton = pytest.importorskip("newton")
    mesh = beam(varying=True)
    assert mesh.material is not None
    export_mesh(mesh, "newton", tmp_path / f"m{suffix}")
    read = newton.TetMesh.create_from_file(str(tmp_path / f"m{suffix}"))
    lam, mu = lame_parameters(mesh.material.E, mesh.material.nu)
    np.testing.assert_allclose(np.asarray(read.k_mu), mu, rtol=1e-6)
    np.testing.assert_allclose(np.asarray(read.k_lambda), lam, rtol=1e-6)
    np.testing.assert_array_equal(np.asarray(read.tet_indices), mesh.tets.ravel())


def test_in_newton_the_body_falls_and_rests_at_its_weight(tmp_path):
    """On its floor of springs: once it rests, their forces are m g; it stands at its own height.

    Explicit steps of a tenth of a wave's way through a tet; the forces are read from how deep the
    points stand in the floor, stiffness times depth.
    """
    newton, wp = pytest.importorskip("newton"), pytest.importorskip("warp")
    box = box_mesh((0.2, 0.2, 0.2), (2, 2, 2))
    mesh = box.with_material(ElementMaterial.uniform(len(box.tets), E=1e5, nu=0.3, rho=500.0))
    (file,) = export_mesh(mesh, "newton", tmp_path / "m.npz").files
    read, stiffness, radius = newton.TetMesh.create_from_file(str(file)), 1e4, 0.005  # N/m, m
    with wp.ScopedDevice("cpu"):
        builder = newton.ModelBuilder()
        floor = newton.ModelBuilder.ShapeConfig(ke=stiffness, kd=10.0, kf=10.0)
        builder.add_ground_plane(cfg=floor)
        builder.add_soft_mesh(
            vertices=read.vertices, indices=read.tet_indices, k_mu=read.k_mu,
            k_lambda=read.k_lambda, density=0.0, k_damp=20.0, particle_radius=radius,
            pos=wp.vec3(0, 0, 0.05), rot=wp.quat_identity(), scale=1.0, vel=wp.vec3(),
        )  # fmt: skip
        builder.particle_mass[:] = read.custom_attributes["vertex_mass"][0].tolist()
        model = builder.finalize()
        model.soft_contact_ke, model.soft_contact_kd, model.soft_contact_kf = stiffness, 10.0, 10.0
        model.particle_grid = None  # points of one body do not push each other
        assert model.particle_mass.numpy().sum() == pytest.approx(mesh.mass, rel=1e-6)
        now, then, control = model.state(), model.state(), model.control()
        pipeline = newton.CollisionPipeline(model)
        contacts, solver = pipeline.contacts(), newton.solvers.SolverSemiImplicit(model)
        heights = []
        for step in range(10_000):
            now.clear_forces()
            pipeline.collide(now, contacts)
            solver.step(now, then, control, contacts, 2e-4)
            now, then = then, now
            if step > 7500 and step % 25 == 0:
                heights.append(now.particle_q.numpy()[:, 2].copy())
    depth = np.maximum(radius - np.array(heights), 0)
    assert stiffness * depth.sum(axis=1).mean() == pytest.approx(mesh.mass * 9.81, rel=0.01)
    # Rest of a column pressed by itself: rho g h^2 / 2 E = 1 mm; its foot stands in the springs.
    top, foot = (np.mean(heights, axis=0)[box.points[:, 2] == z].mean() for z in (0.2, 0.0))
    assert 0.195 < top - foot < 0.2
    assert foot == pytest.approx(radius - mesh.mass * 9.81 / stiffness / 9, abs=2e-4)
