"""Springs beside finite elements: fits to motions of bar and slab, and twelve real pieces.

    python benchmarks/springs.py [--bodies bar slab] [--real [NAME ...]] [-o FILE]

Bar and slab are those of ``reduced.py``; their motion is by quadratic elements and BDF2 in eight
steps a frame, 30 frames of 1/60 s, so that what is compared with is right itself. Real pieces are
too stiff to be followed by explicit steps: their first frequency stands beside that of elements of
the order that motions take, and the time of one period is said. Reduced bodies of a third of E are
fitted to 30 steps of the full body of the same elements. CPU seconds of one thread, of kernels that
are compiled.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from autophyx_tet.fem.device import one_thread
from autophyx_tet.fem.elements.space import make_space
from autophyx_tet.fem.errors import AutophyxError
from autophyx_tet.fem.identify import ObservedMotion, fit_motion
from autophyx_tet.fem.laws.law import Law
from autophyx_tet.fem.reduced.model import Subspace
from autophyx_tet.fem.reduced.motion import ReducedMethod, reduced_dynamics, start_velocity
from autophyx_tet.fem.scene.scene import Scene
from autophyx_tet.fem.solve.dynamics import Dynamics
from autophyx_tet.fem.solve.error import motion_order
from autophyx_tet.fem.solve.modal import natural_modes
from autophyx_tet.fem.solve.schemes import Scheme
from autophyx_tet.fem.springs.body import COST, SpringBody, spring_body
from autophyx_tet.fem.springs.fit import fit_to_motion
from autophyx_tet.fem.springs.motion import network_frequencies
from real_meshes import NAMES
from reduced_bodies import BODIES, DT, Body, documented, real

FRAMES, STEPS = 30, 8
ANCHORS = (1024, 2048)


def scene_of(body: Body) -> Scene:
    push = np.where(body.held.fixed, 0.0, body.push)
    known = {"supports": body.held, "gravity_vector": tuple(body.gravity), "velocity": push}
    return Scene(mesh=body.mesh, duration=FRAMES * DT, frames=FRAMES, **known)


def followed(scene: Scene) -> np.ndarray:
    """Displacement [m] of the mesh points, (frames + 1, points, 3), by quadratic elements."""
    full = Dynamics(
        scene.mesh,
        supports=scene.held,
        gravity_vector=scene.gravity_vector,
        velocity=scene.velocity,
        scheme=Scheme.BDF2,
        self_contact=False,
        order=2,
    )
    points = len(scene.mesh.points)
    u = [full.step(DT / STEPS).u[:points] for _ in range(FRAMES * STEPS)]
    return np.array([np.zeros((points, 3)), *u[STEPS - 1 :: STEPS]])


def fits(body: Body) -> list[dict]:
    """Fits of networks of several sizes to one motion."""
    scene = scene_of(body)
    wanted, rows = followed(scene), []
    tone = natural_modes(body.mesh, 1, supports=body.held, order=2).frequencies[0]
    for anchors in ANCHORS:
        springs = spring_body(scene, anchors)
        started = time.process_time()
        fit = fit_to_motion(springs, wanted, DT, frequency=float(tone))
        seconds = time.process_time() - started
        rows.append({"body": body.name, "fit_s": round(seconds, 2), **vars(fit), **told(springs)})
        print(rows[-1], flush=True)
    return rows


def reduced_fits(body: Body) -> list[dict]:
    """Fits of reduced bodies, made of a third of E, to a motion of the full body."""
    soft = body.mesh.with_material(replace(body.mesh.material, E=body.mesh.material.E / 3))
    scene, rows = replace(scene_of(body), mesh=soft), []
    order = motion_order(body.mesh)
    known = {"supports": body.held, "gravity_vector": body.gravity, "scheme": Scheme.BDF2}
    velocity = start_velocity(scene, make_space(body.mesh, order))
    full = Dynamics(body.mesh, velocity=velocity, order=order, self_contact=False, **known)
    points = len(body.mesh.points)
    u = [np.zeros((points, 3)), *(full.step(DT).u[:points] for _ in range(FRAMES))]
    for kind in Subspace:
        model = ReducedMethod(kind=kind).model_of(scene, order)
        start = reduced_dynamics(scene, model, law=Law.NEO_HOOKEAN)
        observed = ObservedMotion(
            displacement=np.array(u), dt=DT, load=start.load, velocity=start.now.v
        )
        started = time.process_time()
        fit = fit_motion(model, observed)
        seconds = time.process_time() - started
        row = {"body": body.name, "kind": kind.value, "order": order, "dofs": model.dofs}
        row |= {"fit_s": round(seconds, 2), "E": fit.scale / 3, "error": fit.error}
        row |= {"runs": fit.runs, "frequency_ratio": fit.frequency_ratio}
        rows.append(row)
        print(row, flush=True)
    return rows


def told(springs: SpringBody) -> dict:
    return {
        "layers": [round(float(layers), 1) for layers in springs.network.anchors.layers],
        "notes": springs.notes,
    }


def piece(name: str) -> dict:
    """The first frequency of a real piece as it stands, and what springs say of it."""
    body = real(name)
    started = time.process_time()
    springs = spring_body(scene_of(body))
    made = time.process_time() - started
    stiffness = springs.network.stiffness()
    tone = float(network_frequencies(springs.network, stiffness)[0])
    order = motion_order(body.mesh)
    full = float(natural_modes(body.mesh, 1, supports=body.held, order=order).frequencies[0])
    step = springs.motion(stiffness).longest_step
    row = {"body": name, "tets": len(body.mesh.tets), "made_s": round(made, 2), "order": order}
    row |= {"anchors": len(springs.network.anchors.x), "springs": len(stiffness)}
    row |= {"frequency": full, "ratio": tone / full, "step_s": step}
    period = 2 * COST * len(stiffness) / (step * full)
    return row | {"period_cpu_s": round(period, 1)} | told(springs)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bodies", nargs="*", default=["bar", "slab"])
    parser.add_argument("--real", nargs="*", help="names of real pieces; none named: all twelve")
    parser.add_argument("-o", "--output", type=Path)
    options = parser.parse_args()
    rows: list[dict] = []
    with one_thread():
        for name in options.bodies:
            body = BODIES[name]()
            rows += [*fits(body), *reduced_fits(body)]
        for name in [] if options.real is None else options.real or NAMES:
            try:
                rows.append(piece(name))
            except AutophyxError as error:
                rows.append({"body": name, "failure": str(error)})
            print(rows[-1], flush=True)
    if options.output:
        options.output.write_text(documented(rows))


if __name__ == "__main__":
    main()
