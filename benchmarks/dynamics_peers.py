"""The swinging beam of ``dynamics.py`` in other simulators: MuJoCo's flexes, Newton's VBD.

Every peer is a function of the mesh that returns ``step``, which advances by one step, ``tip``,
the mean height of the free end's nodes above rest [m], and its own ``dt`` [s], the one that the
peer's guide recommends for such bodies. It raises ImportError where the peer is not installed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

GRAVITY = 9.81


class Peer(NamedTuple):
    """A simulator at work."""

    step: Callable[[], object]
    tip: Callable[[], float]
    dt: float


def mujoco(mesh) -> Peer:
    """One flex a material; their vertices are bodies with three slides, none at x = 0."""
    import mujoco as mj

    model = mj.MjModel.from_xml_string(_mjcf(mesh))
    data = mj.MjData(model)
    mj.mj_forward(model, data)
    ids = [model.body(f"v{i}").id for i in _tip_nodes(mesh)]
    rest = data.xpos[ids, 2].mean()
    return Peer(
        lambda: mj.mj_step(model, data),
        lambda: float(data.xpos[ids, 2].mean() - rest),
        model.opt.timestep,
    )


def _mjcf(mesh) -> str:
    from autophyx_tet.fem.elements.forces import lumped_mass
    from autophyx_tet.fem.elements.space import make_space

    mass = lumped_mass(mesh, make_space(mesh, 1))
    slides = "".join(f'<joint type="slide" axis="{axis}"/>' for axis in ("1 0 0", "0 1 0", "0 0 1"))
    bodies = [
        f'<body name="v{i}" pos="{x} {y} {z}"><inertial pos="0 0 0" mass="{mass[i]}" '
        f'diaginertia="1e-9 1e-9 1e-9"/>{slides if x > 0 else ""}</body>'
        for i, (x, y, z) in enumerate(mesh.points.tolist())
    ]
    flexes = []
    for E, nu in np.unique(np.stack([mesh.material.E, mesh.material.nu], axis=1), axis=0).tolist():
        nodes, tets = np.unique(mesh.tets[mesh.material.E == E], return_inverse=True)
        flexes.append(
            f'<flex name="E{E:g}" dim="3" body="{" ".join(f"v{i}" for i in nodes)}" '
            f'element="{" ".join(map(str, tets.ravel().tolist()))}">'
            f'<elasticity young="{E}" poisson="{nu}"/>'
            '<contact selfcollide="none" contype="0" conaffinity="0"/></flex>'
        )
    return (
        f'<mujoco><option gravity="0 0 {-GRAVITY}" integrator="discrete" timestep="0.002"/>'
        f"<worldbody>{''.join(bodies)}</worldbody>"
        f"<deformable>{''.join(flexes)}</deformable></mujoco>"
    )


def newton(mesh, iterations: int = 10) -> Peer:
    """Vertex block descent with 10 sweeps a step of 1/600 s."""
    import newton as nt
    import warp as wp

    builder = nt.ModelBuilder(gravity=(0.0, 0.0, -GRAVITY))
    for E in np.unique(mesh.material.E):
        _add_soft(builder, mesh, wp, E)
    builder.color()
    model = builder.finalize(device="cpu")
    solver = nt.solvers.SolverVBD(model, iterations=iterations)
    states, control = [model.state(), model.state()], model.control()
    nodes, dt = _tip_nodes(mesh), 1 / 600
    rest = mesh.points[nodes, 2].mean()

    def step() -> None:
        states[0].clear_forces()
        solver.step(states[0], states[1], control, None, dt)
        states.reverse()

    def tip() -> float:
        q = states[0].particle_q
        assert q is not None
        return float(q.numpy()[nodes, 2].mean() - rest)

    return Peer(step, tip, dt)


def _add_soft(builder, mesh, wp, E: float) -> None:
    """Particles once, with our lumped masses, then the tets of one stiffness."""
    from autophyx_tet.fem.elements.forces import lumped_mass
    from autophyx_tet.fem.elements.space import make_space

    if not builder.particle_count:
        mass = np.where(mesh.points[:, 0] == 0, 0.0, lumped_mass(mesh, make_space(mesh, 1)))
        for x, m in zip(mesh.points.tolist(), mass.tolist(), strict=True):
            builder.add_particle(wp.vec3(*x), wp.vec3(0.0, 0.0, 0.0), m)
    lam, mu = mesh.material.lame
    for t in np.flatnonzero(mesh.material.E == E):
        builder.add_tetrahedron(*mesh.tets[t].tolist(), float(mu[t]), float(lam[t]), 0.0)


def _tip_nodes(mesh) -> np.ndarray:
    return np.flatnonzero(np.isclose(mesh.points[:, 0], mesh.points[:, 0].max()))


PEERS = {"mujoco": mujoco, "newton": newton}
