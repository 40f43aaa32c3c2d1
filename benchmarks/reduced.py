"""Reduced bodies beside the full one and beside peers' ways: error against time, and real pieces.

    python benchmarks/reduced.py [--bodies bar slab bonsai] [--order 1] [--real] [--made]

Every body sags under its weight and is then let go with a push ("wobble": all frames, in the norm
of mass). Full body: the elements that are reduced (quadratic where linear ones lock, or --order),
neo-Hookean, BDF2, 1/60 s. Times are CPU seconds of one thread. The bonsai is that of ``make demo``
with softened moduli (.3-200 MPa), so that it bends; the real pieces keep theirs, without grain,
under 9.81 m/s^2 downwards.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from autophyx_tet.converters.mesh.mesh_file import read_mesh
from autophyx_tet.fem.device import one_thread
from autophyx_tet.fem.discrete.constraints import node_supports
from autophyx_tet.fem.discrete.mass import lumped_mass
from autophyx_tet.fem.discrete.space import make_space
from autophyx_tet.fem.errors import AutophyxError
from autophyx_tet.fem.laws.law import Law
from autophyx_tet.fem.reduced.elasticity import ReducedElasticity
from autophyx_tet.fem.reduced.error import motion_error
from autophyx_tet.fem.reduced.model import ReducedModel, Subspace
from autophyx_tet.fem.reduced.reduction import MOST_UNKNOWNS, reduce_body, relative_error
from autophyx_tet.fem.reduced.rest import reduced_frequencies, reduced_rest
from autophyx_tet.fem.reduced.step import ReducedDynamics
from autophyx_tet.fem.scene.box import box_mesh
from autophyx_tet.fem.scene.material import ElementMaterial
from autophyx_tet.fem.scene.mesh import TetMesh
from autophyx_tet.fem.scene.support_finder import find_supports
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.discretisation_error import motion_elements
from autophyx_tet.fem.solve.dynamics import TOLERANCE, Dynamics
from autophyx_tet.fem.solve.modal import natural_modes
from autophyx_tet.fem.solve.nonlinear import solve_nonlinear
from autophyx_tet.fem.solve.schemes import Scheme
from real_meshes import NAMES, cache_folder, demo_mesh, real_mesh
from reduced_peers import Reduced, equal_weights, modal_path, peers, timed

DT = 1 / 60
# Of the full body's steps that others are compared with: the usual 1e-4 moves a real chair by .3 %.
EXACT = 1e-7
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
    frequency: float
    step: float


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
    axis = "xyz".index(sidecar["up"])
    held = find_supports(mesh, axis).supports
    push = 1e-3 * np.eye(3)[(axis + 1) % 3]
    return Body(name, mesh, held, -9.81 * np.eye(3)[axis], push, 20)


BODIES = {"bar": bar, "slab": slab, "bonsai": bonsai}


def solved_in_full(body: Body) -> Full:
    options = {"supports": body.held, "order": body.order}
    velocity = body.velocity
    first = natural_modes(body.mesh, 1, lumped=True, **options).frequencies[0]
    mass = lumped_mass(body.mesh, make_space(body.mesh, body.order))
    weight = mass[:, None] * body.gravity
    rest = solve_nonlinear(body.mesh, body.held, forces=weight, order=body.order).node_displacement
    known = {"gravity_vector": body.gravity, "velocity": velocity, "self_contact": False}
    usual, exact = (
        Dynamics(body.mesh, scheme=Scheme.BDF2, tolerance=tolerance, **known, **options)
        for tolerance in (TOLERANCE, EXACT)
    )
    started = time.process_time()
    for _ in range(body.frames):
        usual.step(DT)
    step = (time.process_time() - started) / body.frames
    return Full(rest, np.stack([exact.step(DT).u for _ in range(body.frames)]), float(first), step)


def measure(body: Body, full: Full, made: Reduced) -> dict:
    """Errors and times of one model; what fails is a row too."""
    model, law = made.model, made.options
    row = {"body": body.name, "model": made.label, "dofs": model.dofs, "cells": len(model.cells)}
    row |= {"made_s": round(made.made, 2)}
    elasticity = ReducedElasticity(model, **law)
    row["frequency"] = float(reduced_frequencies(elasticity)[0] / full.frequency - 1)
    load = model.weight(body.gravity)
    velocity = model.coordinates(body.velocity)
    try:
        rest = model.displacement(reduced_rest(elasticity, load).u)
        row["sag"] = relative_error(model, rest, full.rest)
        path, seconds = timed(lambda: followed(model, elasticity, load, velocity, body, law))
        row["step_ms"] = round(seconds / body.frames * 1e3, 3)
        found = np.stack([model.displacement(q) for q in path])
        row["wobble"] = relative_error(model, found, full.frames)
        row |= estimate(body, model, load, velocity, **law)
    except AutophyxError as error:
        row["failure"] = str(error)
    return row


def followed(model, elasticity, load, velocity, body: Body, law: dict) -> list[np.ndarray]:
    """Coordinates of every frame; of a linear law those of each vibration for itself."""
    if law:
        stiffness = elasticity.tangent(np.zeros(model.dofs))
        return modal_path(stiffness, load, velocity, DT, body.frames)
    moving = ReducedDynamics(model, load=load, velocity=velocity)
    return [moving.advance(DT).u for _ in range(body.frames)]


def estimate(body: Body, model: ReducedModel, load, velocity, law=Law.NEO_HOOKEAN) -> dict:
    """What a motion says of its own error, and the CPU seconds of that, every frame."""
    moving = ReducedDynamics(model, load=load, velocity=velocity, law=law)
    states = [moving.state, *(moving.step(DT) for _ in range(body.frames))]
    known = {"load": model.mass[:, None] * body.gravity, "velocity": body.velocity, "law": law}
    known["order"] = body.order
    found, seconds = timed(lambda: motion_error(body.mesh, body.held, states, **known))
    share = None if found is None else found.share
    return {"estimated": share, "estimate_ms": round(seconds / body.frames * 1e3, 3)}


def models(body: Body):
    """Ours, and the peers' ways."""
    known = (body.mesh, body.held)
    ours = {
        "vector, 34 coordinates": {"kind": Subspace.VECTOR},
        "vector, 49 coordinates": {"kind": Subspace.VECTOR, "derived": 36},
        "modal skinning, 10 handles": {"kind": Subspace.SKINNING},
        "modal skinning, 16 handles": {"kind": Subspace.SKINNING, "handles": 16},
    }
    for label, options in ours.items():
        options |= {"gravity_vector": body.gravity, "order": body.order}
        model, seconds = timed(lambda o=options: reduce_body(*known, **o))
        yield Reduced(label, model, seconds)
        if label.endswith("10 handles"):
            yield Reduced("our 10 handles, 500 equal weights", equal_weights(*known, model), 0.0)
    yield from peers(body.name, *known, body.order)


def rows_of(body: Body, real_piece: bool, order: int | None) -> list[dict]:
    order, _ = motion_elements(body.mesh, body.held, order, most=MOST_UNKNOWNS)
    body = replace(body, order=order)
    full = solved_in_full(body)
    size = float(np.ptp(body.mesh.bounds, axis=0).max())
    sag = float(np.linalg.norm(full.rest, axis=1).max()) / size
    rows = [
        {
            "body": body.name,
            "model": "full",
            "tets": len(body.mesh.tets),
            "order": order,
            "sag_share": sag,
        }
        | {"step_ms": round(full.step * 1e3, 3), "sag": 0.0, "wobble": 0.0, "frequency": 0.0}
    ]
    print(rows[-1], flush=True)
    if real_piece:
        model, seconds = timed(
            lambda: reduce_body(body.mesh, body.held, gravity_vector=body.gravity, order=body.order)
        )
        every = [Reduced("vector", model, seconds)]
    else:
        every = models(body)
    for made in every:
        rows.append(measure(body, full, made))
        print(rows[-1], flush=True)
    return rows


def made_in(body: Body, order: int | None, times: int = 3) -> float:
    """Least CPU seconds of so many makings of the vector model."""
    known = {"supports": body.held, "gravity_vector": body.gravity, "order": order}
    return min(timed(lambda: reduce_body(body.mesh, **known))[1] for _ in range(times))


def draw(rows: list[dict], path: Path) -> None:
    """Error of the motion against the CPU time of a step, a panel a body."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, len(BODIES), figsize=(10.2, 4.1), sharey=True)
    labels = list(dict.fromkeys(row["model"] for row in rows if row["body"] in BODIES))[1:]
    for ax, name in zip(axes, BODIES, strict=True):
        own = {row["model"]: row for row in rows if row["body"] == name and "wobble" in row}
        for k, label in enumerate(labels):
            row = own.get(label, {"step_ms": np.nan, "wobble": np.nan})
            style = {"color": f"C{k}", "label": label, "ms": 7}
            ax.plot(row["step_ms"], 100 * row["wobble"], "os^DvPX*hd"[k], **style)
        if "full" in own:
            ax.axvline(own["full"]["step_ms"], color="gray", ls=":")
        ax.set(xscale="log", yscale="log", title=name, xlabel="CPU time of a step [ms]")
        ax.grid(alpha=0.3)
    axes[0].set_ylabel("error of the motion [%]")
    known = axes[0].get_legend_handles_labels()
    figure.legend(*known, loc="lower center", ncol=3, fontsize=8, frameon=False)
    figure.tight_layout(rect=(0, 0.2, 1, 1))
    figure.savefig(path, dpi=110)


def keep(rows: list[dict], path: Path | None) -> None:
    """Write what is known so far."""
    if path:
        path.write_text(json.dumps(rows, indent=1) + "\n")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bodies", nargs="*", default=list(BODIES))
    parser.add_argument("--real", nargs="*", help="names of real pieces; none named: all twelve")
    parser.add_argument("--order", type=int, help="of the elements; by default as motions take")
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--picture", type=Path)
    parser.add_argument("--made", action="store_true", help="only how long the making takes")
    options = parser.parse_args()
    if options.made:
        with one_thread():
            print({name: made_in(BODIES[name](), options.order) for name in options.bodies})
        return
    rows: list[dict] = []
    with one_thread():
        for name in options.bodies:
            rows += rows_of(BODIES[name](), False, options.order)
            keep(rows, options.output)
        for name in [] if options.real is None else options.real or NAMES:
            try:
                rows += rows_of(real(name), True, options.order)
            except AutophyxError as error:
                rows.append({"body": name, "failure": str(error)})
                print(rows[-1], flush=True)
            keep(rows, options.output)
    if options.picture:
        draw(rows, options.picture)


if __name__ == "__main__":
    main()
