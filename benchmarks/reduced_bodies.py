"""Bodies that `reduced.py` and `springs.py` reduce, and the full ones' motion, kept once solved."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import shlex
import sys
import time
from dataclasses import dataclass, replace

import numpy as np
from autophyx_tet.converters.mesh.meshdata import read_mesh
from autophyx_tet.converters.npz import load_npz
from autophyx_tet.fem.elements.assembly import node_supports
from autophyx_tet.fem.elements.forces import lumped_mass
from autophyx_tet.fem.elements.space import make_space
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.fem.scene.supports import Supports, find_supports
from autophyx_tet.fem.scene.up import up_vector
from autophyx_tet.fem.solve.dynamics import TOLERANCE, Dynamics
from autophyx_tet.fem.solve.modal import natural_modes
from autophyx_tet.fem.solve.nonlinear import solve_nonlinear
from autophyx_tet.fem.solve.schemes import Scheme
from real_meshes import cache_folder, demo_mesh, real_mesh

DT = 1 / 60
# Of the full body's steps that others are compared with: the usual 1e-4 moves a real chair by .3 %.
EXACT = 1e-7
# First frames of the full body whose steps are timed, at the usual tolerance.
TIMED = 10
# Seconds between two lines of progress.
AGAIN = 20.0
SOFT = {"foliage": 3e5, "trunk": 1e7, "soil": 2e6, "pot": 2e8}


@dataclass(frozen=True)
class Body:
    """What is reduced: mesh, supports, weight (3,) [m/s^2], push (3,) [m/s], frames, elements."""

    name: str
    mesh: TetMesh
    held: Supports
    gravity: np.ndarray
    push: np.ndarray
    frames: int
    order: int = 1

    @property
    def velocity(self) -> np.ndarray:
        """Of the nodes at the start [m/s]."""
        held = node_supports(self.held, make_space(self.mesh, self.order))
        return np.where(held.fixed, 0.0, self.push)


@dataclass(frozen=True)
class Full:
    """The full body's answers: rest, frames, first frequency, CPU seconds of a step."""

    rest: np.ndarray
    frames: np.ndarray
    frequency: np.ndarray
    step: np.ndarray


def clamped(mesh: TetMesh) -> Supports:
    return Supports.clamp(len(mesh.points), mesh.points[:, 0] < 1e-9)


def bar() -> Body:
    mesh = box_mesh((1.0, 0.12, 0.12), (24, 4, 4))
    E = np.where(mesh.centroids[:, 0] < 0.5, 1e6, 1e5)
    mesh = mesh.with_material(ElementMaterial(E, np.full_like(E, 0.35), np.full_like(E, 1000.0)))
    return Body("bar", mesh, clamped(mesh), np.array([0, 0, -1.0]), np.array([0, 0.35, 0]), 120)


def slab() -> Body:
    mesh = box_mesh((0.4, 0.3, 0.06), (12, 9, 3))
    mesh = mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=5e4, nu=0.45, rho=500.0))
    weight = np.array([0, 0, -9.81 * 0.15])
    return Body("slab", mesh, clamped(mesh), weight, np.array([0, 0, 0.5]), 120)


def bonsai() -> Body:
    mesh = read_mesh(demo_mesh(cache_folder()))
    part = np.array(mesh.region_names)[mesh.region]
    material = mesh.material
    rho = np.where(part == "foliage", 300.0, material.rho)
    E = np.array([SOFT[name] for name in part])
    mesh = mesh.with_material(ElementMaterial(E, material.nu, rho))
    low = mesh.points[:, 1] < mesh.bounds[0][1] + 1e-3 * np.ptp(mesh.bounds[:, 1])
    held = Supports.clamp(len(mesh.points), low)
    return Body("bonsai", mesh, held, np.array([0, -9.81, 0]), np.array([0.5, 0, 0]), 60)


def real(name: str) -> Body:
    """A piece as it stands, without the grain of wood, pushed sideways at 1 mm/s."""
    mesh = read_mesh(real_mesh(name, cache_folder()))
    mesh = mesh.with_material(replace(mesh.material, tensor=None))
    sidecar = json.loads(real_mesh(name, cache_folder()).with_suffix(".msh.json").read_text())
    up = up_vector(sidecar["up"])
    held = find_supports(mesh, sidecar["up"]).supports
    return Body(name, mesh, held, -9.81 * up, 1e-3 * np.roll(up, 1), 20)


BODIES = {"bar": bar, "slab": slab, "bonsai": bonsai}


def solved_in_full(body: Body) -> Full:
    """Answers of the full body: those of an earlier call, where they are kept."""
    name = body.name.replace("/", "-")
    path = cache_folder() / f"full-{name}-{fingerprint(body)}.npz"
    if not path.exists():
        np.savez(path, **vars(solved(body)))
    return Full(**load_npz(path))


def fingerprint(body: Body) -> str:
    """Hash of all that the motion of the full body follows from, the code apart."""
    mesh, material = body.mesh, body.mesh.material
    given = [mesh.points, mesh.tets, material.E, material.nu, material.rho, body.held.fixed]
    found = hashlib.sha256()
    for array in [*given, body.gravity, body.push, np.array([body.frames, body.order])]:
        found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()[:12]


def solved(body: Body) -> Full:
    """Rest and motion of the full body, with the time of a step at the usual tolerance."""
    options = {"supports": body.held, "order": body.order}
    first = natural_modes(body.mesh, 1, lumped=True, **options).frequencies[0]
    mass = lumped_mass(body.mesh, make_space(body.mesh, body.order))
    weight = mass[:, None] * body.gravity
    rest = solve_nonlinear(body.mesh, body.held, forces=weight, order=body.order).node_displacement
    known = {"gravity_vector": body.gravity, "velocity": body.velocity, "self_contact": False}
    usual, exact = (
        Dynamics(body.mesh, scheme=Scheme.BDF2, tolerance=tolerance, **known, **options)
        for tolerance in (TOLERANCE, EXACT)
    )
    started = time.process_time()
    for _ in range(TIMED):
        usual.step(DT)
    step = np.array((time.process_time() - started) / TIMED)
    print(f"{body.name}: {step:.3g} CPU s a step of the full body", flush=True)
    frames, told = [], time.monotonic()
    for frame in range(body.frames):
        frames.append(exact.step(DT).u)
        if time.monotonic() - told > AGAIN:
            told = time.monotonic()
            print(f"{body.name}: {frame + 1} of {body.frames} frames of the full body", flush=True)
    return Full(rest, np.stack(frames), np.array(first), step)


def documented(rows: list[dict]) -> str:
    """``rows`` as JSON, with the command and the machine that they were measured by."""
    machine = {
        "processor": platform.processor() or platform.machine(),
        "cores": os.cpu_count(),
        "load": round(os.getloadavg()[0]),
        "python": platform.python_version(),
        "date": time.strftime("%Y-%m-%d"),
    }
    document = {"command": shlex.join(["python", *sys.argv]), "machine": machine, "rows": rows}
    return json.dumps(document, indent=1) + "\n"
