"""MuJoCo: an MJCF scene of flexes, one a bin, that share a body with three slides a vertex.

What is too stiff for a step that one can afford is a rigid body: its flexes share one free joint.

MuJoCo's ``discrete`` integrator is implicit in the elasticity and stable at any step, but it takes
M + h^2 K at the old places. A body that spins by ``w`` is widened by w^2 h^2 / 2 in a step, that
pulls with E w^2 h^2 / 2, and the implicit pull brakes the spin: measured, by w h (2 + 3 (h / s)^2)
a radian, where s is the time in which sound runs the body's radius of gyration. So the step is s
as far as that can be afforded. The linear solve of a step is by conjugate gradients: their number
grows with the step over the longest explicit one, and where they run out, the body loses momentum.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...fem.material import wave_speed
from ...fem.mesh import TetMesh, largest_explicit_step, material_of
from ...fem.note import Note
from ...fem.scene.up import up_vector
from ..files import writing
from ..registry import Format, Keeps, Program
from .export import SceneOptions
from .material_bins import Bins, vertex_masses

_MANY = 5000  # vertices; beyond, MuJoCo's own mass matrix and contact search become slow
_TINY = 1e-9  # kg m^2: a point mass has no inertia, but MuJoCo wants one
_RADIUS = 1e-3  # of the box's diagonal: contact margin around each vertex
_LONGEST = 2e-4  # s: the integrator falls g h T / 2 too far, 1e-3 of a fall of .2 s
_SHORTEST = 1e-4  # s: a shorter one takes minutes for a second of a mesh of a few thousand points
_CROSSED = 2.0  # gyration radii that sound may run in a step: a spin is braked by 14 w h a radian
# Conjugate gradients reach 1e-8 within sqrt(cond) / 2 log(2e8) iterations, sqrt(cond) being at most
# 2 steps over the longest explicit one; beyond a thousand of those, rounding is near 1e-8 itself.
_ITERATIONS, _THINNEST = 20, 1000
_SPIN = 10.0  # rad/s, of which the note tells


class Motion(NamedTuple):
    """How MuJoCo is to move a body.

    ``step`` [s], most ``iterations`` of its solver, ``sound`` [s] through the radius of gyration,
    ``longest`` step [s] of explicit dynamics.
    """

    step: float
    iterations: int
    sound: float
    longest: float

    @property
    def stiff(self) -> bool:
        """Whether its own sound outruns the step."""
        return self.step > _CROSSED * self.sound

    @property
    def rigid(self) -> bool:
        """Whether MuJoCo would move it wrong as a soft body, at any step that can be afforded."""
        return self.stiff or self.step > _THINNEST * self.longest


def motion_of(mesh: TetMesh) -> Motion:
    """Step and solver for a body, from its E, nu, rho, its size and its thinnest tet."""
    material = material_of(mesh)
    masses = vertex_masses(mesh)
    away = mesh.points - masses @ mesh.points / mesh.mass
    gyration = np.sqrt(masses @ (away**2).sum(axis=1) / mesh.mass)
    squares = wave_speed(material.E, material.nu, material.rho) ** 2
    sound = float(gyration / np.sqrt(np.average(squares, weights=material.rho * mesh.volumes)))
    step = float(f"{np.clip(sound, _SHORTEST, _LONGEST):.2g}")
    longest = largest_explicit_step(mesh)
    return Motion(step, max(100, int(np.ceil(_ITERATIONS * step / longest))), sound, longest)


def _notes(mesh: TetMesh, options: SceneOptions) -> Iterator[str]:
    """Say with which step and solver MuJoCo moves the body, and what that does to its motion."""
    motion = motion_of(mesh)
    E, step = material_of(mesh).E.max(), motion.step
    if motion.rigid:
        why = (
            Note(
                "mujoco.pa_mujocos",
                e=E,
                step=1e3 * step,
                step_2=(motion.step / _CROSSED / motion.sound) ** 2,
            )
            if motion.stiff
            else Note("mujoco.thinnest_tets", step=1e3 * step)
        )
        yield Note("mujoco.written_mujoco_rigid", longest=1e3 * _LONGEST, why=why)
        return
    loss = _SPIN * step * (2 + 3 * (step / motion.sound) ** 2)
    yield Note(
        "mujoco.written_mujoco",
        step=1e3 * step,
        iterations=motion.iterations,
        step_2=step / 2e-3,
        spin=_SPIN,
        loss=100 * loss,
        pi=0.1 / (2 * np.pi * step),
    )
    if (many := len(np.unique(mesh.tets))) > _MANY:
        yield Note("mujoco.vertices_give", many=many, many_2=3 * many)


def _write(path: Path, mesh: TetMesh, bins: Bins, options: SceneOptions) -> list[Path]:
    """Write a body that falls on the ground plane below it; masses are lumped to the vertices."""
    used = np.unique(mesh.tets)
    number = np.full(len(mesh.points), -1)
    number[used] = np.arange(len(used))
    motion = motion_of(mesh)
    with writing(path) as target, target.open("w", encoding="utf-8", newline="\n") as file:
        file.write('<mujoco model="autophyx_tet">\n')
        file.writelines(_world(mesh, motion, options))
        file.writelines(_rigid_body(mesh) if motion.rigid else _soft_body(mesh, used))
        file.write("  </worldbody>\n  <deformable>\n")
        for bin_id in range(len(bins)):
            file.writelines(_flex(mesh, number, bins, bin_id, motion))
        file.write("  </deformable>\n</mujoco>\n")
    return [path]


MUJOCO = Program(
    (
        Format(
            "MJCF scene",
            (".xml",),
            write=_write,
            binned=frozenset({Keeps.E, Keeps.NU}),
            lumped=frozenset({Keeps.RHO}),
        ),
    ),
    notes=_notes,
)


def _world(mesh: TetMesh, motion: Motion, options: SceneOptions) -> Iterator[str]:
    upwards = up_vector(options.up)
    gravity = -options.gravity * upwards
    ground = (float((mesh.bounds @ upwards).min()) - 2 * _RADIUS * _diagonal(mesh)) * upwards
    solver = "" if motion.rigid else f' iterations="{motion.iterations}"'
    yield (
        f'  <option gravity="{_row(gravity)}" integrator="discrete" '
        f'timestep="{_step(motion)!r}"{solver}/>\n'
    )
    yield f'  <statistic extent="{_diagonal(mesh)!r}" center="{_row(mesh.bounds.mean(axis=0))}"/>\n'
    yield "  <worldbody>\n"
    yield (
        f'    <geom name="ground" type="plane" size="0 0 1" pos="{_row(ground)}" '
        f'zaxis="{_row(upwards)}"/>\n'
    )


def _soft_body(mesh: TetMesh, used: np.ndarray) -> Iterator[str]:
    masses = vertex_masses(mesh)[used].tolist()
    for i, (place, mass) in enumerate(zip(mesh.points[used], masses, strict=True)):
        yield f'    <body name="v{i}" pos="{_row(place)}">'
        yield f'<inertial pos="0 0 0" mass="{mass!r}" diaginertia="{_TINY} {_TINY} {_TINY}"/>'
        for slide in ("1 0 0", "0 1 0", "0 0 1"):
            yield f'<joint type="slide" axis="{slide}"/>'
        yield "</body>\n"


def _rigid_body(mesh: TetMesh) -> Iterator[str]:
    """Mass, centre and inertia of the tets, each of them exact: its points have a twentieth."""
    mass = material_of(mesh).rho * mesh.volumes
    centre = mass @ mesh.centroids / mass.sum()
    corners = mesh.points[mesh.tets] - centre
    total = corners.sum(axis=1)
    second = np.einsum("t,tci,tcj->ij", mass, corners, corners)
    second = (second + np.einsum("t,ti,tj->ij", mass, total, total)) / 20
    xx, yy, zz = np.diag(np.trace(second) * np.eye(3) - second)
    full = np.array([xx, yy, zz, -second[0, 1], -second[0, 2], -second[1, 2]])
    yield f'    <body name="body"><freejoint/><inertial pos="{_row(centre)}" '
    yield f'mass="{float(mass.sum())!r}" fullinertia="{_row(full)}"/></body>\n'


def _flex(
    mesh: TetMesh, number: np.ndarray, bins: Bins, bin_id: int, motion: Motion
) -> Iterator[str]:
    """One material: its vertices are the shared bodies, numbered anew inside the flex."""
    tets = mesh.tets[bins.label == bin_id]
    points, elements = np.unique(tets, return_inverse=True)
    yield f'    <flex name="bin{bin_id + 1}" dim="3" radius="{_RADIUS * _diagonal(mesh)!r}"\n'
    if motion.rigid:
        yield f'      body="body" vertex="{_row(mesh.points[points].ravel())}"\n'
    else:
        yield f'      body="{" ".join(f"v{i}" for i in number[points])}"\n'
    yield f'      element="{" ".join(map(str, elements.ravel().tolist()))}">\n'
    if not motion.rigid:
        E, nu = float(bins.E[bin_id]), float(bins.nu[bin_id])
        yield f'      <elasticity young="{E!r}" poisson="{nu!r}"/>\n'
    # MuJoCo wants a contact's time to be two steps or more; it sinks with that time squared.
    yield (
        f'      <contact selfcollide="none" solref="{4 * _step(motion):.6g} 1" '
        f'solimp="0.99 0.999 {_RADIUS * _diagonal(mesh)!r}" priority="1"/>\n    </flex>\n'
    )


def _step(motion: Motion) -> float:
    return _LONGEST if motion.rigid else motion.step


def _diagonal(mesh: TetMesh) -> float:
    return float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))


def _row(values: np.ndarray) -> str:
    return " ".join(repr(value) for value in values.tolist())
