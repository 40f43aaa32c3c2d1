"""Robots' simulators take our bodies: their mass, their material, and how they rest on a floor."""

import numpy as np
import pytest
from autophyx_tet.converters.programs.export import export_mesh
from autophyx_tet.fem.scene.box import box_mesh
from autophyx_tet.fem.scene.material import ElementMaterial, lame_parameters

from .test_external import beam

pytestmark = pytest.mark.external


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
