"""Reduced bodies beside the full one and beside peers' ways: error against time, and real pieces.

    python benchmarks/reduced.py [--bodies bar slab bonsai] [--order 1] [--real] [--made] [--steps]

Every body sags under its weight and is then let go with a push ("wobble": all frames, in the norm
of mass). Full body: the elements that are reduced (quadratic where linear ones lock, or --order),
neo-Hookean, BDF2, 1/60 s. Times are CPU seconds of one thread. The bonsai is that of ``make demo``
with softened moduli (.3-200 MPa), so that it bends; the real pieces keep theirs, without grain,
under 9.81 m/s^2 downwards.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from autophyx_tet.fem.device import one_thread
from autophyx_tet.fem.errors import AutophyxError
from autophyx_tet.fem.laws.law import Law
from autophyx_tet.fem.reduced.basis import MOST_UNKNOWNS, reduce_body, relative_error
from autophyx_tet.fem.reduced.elasticity import ReducedElasticity, reduced_frequencies, reduced_rest
from autophyx_tet.fem.reduced.model import ReducedModel, Subspace
from autophyx_tet.fem.reduced.motion import Following, ReducedDynamics, error_of, missed_motion
from autophyx_tet.fem.scene.scene import Scene
from autophyx_tet.fem.solve.error import motion_elements
from real_meshes import NAMES
from reduced_bodies import BODIES, DT, Body, Full, documented, real, solved_in_full
from reduced_peers import Reduced, equal_weights, modal_path, peers, timed


def measure(body: Body, full: Full, made: Reduced) -> dict:
    """Errors and times of one model; what fails is a row too."""
    model, law = made.model, made.options
    row = {"body": body.name, "model": made.label, "dofs": model.dofs, "cells": len(model.cells)}
    row |= {"made_s": round(made.made, 2)}
    elasticity = ReducedElasticity(model, **law)
    row["frequency"] = float(reduced_frequencies(elasticity)[0] / float(full.frequency) - 1)
    load = model.weight(body.gravity)
    velocity = model.coordinates(body.velocity)
    try:
        rest = model.displacement(reduced_rest(elasticity, load).u)
        row["sag"] = relative_error(model, rest, full.rest)
        path, seconds = timed(lambda: followed(model, elasticity, load, velocity, body, law))
        row["step_ms"] = round(seconds / body.frames * 1e3, 3)
        found = np.stack([model.displacement(q) for q in path])
        row["wobble"] = relative_error(model, found, full.frames)
        if made.told:
            row |= estimate(body, model, load, velocity)
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


def estimate(body: Body, model: ReducedModel, load, velocity) -> dict:
    """What a motion says of its own error, and the CPU seconds of that, every frame."""
    moving = ReducedDynamics(model, load=load, velocity=velocity)
    states = [moving.state, *(moving.step(DT) for _ in range(body.frames))]
    known = {
        "load": model.mass[:, None] * body.gravity,
        "velocity": body.velocity,
        "law": Law.NEO_HOOKEAN,
    }
    known["order"] = body.order
    missed, seconds = timed(lambda: missed_motion(body.mesh, body.held, states, **known))
    share = None if missed is None else error_of(missed, states, model.mass).share
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
        if label == "vector, 34 coordinates":
            again, more = timed(lambda m=model: followed_again(body, m))
            yield Reduced("what 34 missed joined", again, seconds + more)
        if label.endswith("10 handles"):
            yield Reduced("our 10 handles, 500 equal weights", equal_weights(*known, model), 0.0)
    yield from peers(body.name, *known, body.order)


def followed_again(body: Body, model: ReducedModel) -> ReducedModel:
    """The model with what it missed of the body's motion, let go with its push."""
    known = {"gravity_vector": body.gravity, "velocity": body.push, "self_contact": False}
    lasting = {"duration": DT * body.frames, "frames": body.frames}
    scene = Scene(mesh=body.mesh, supports=body.held, **known, **lasting)
    return Following(dt=DT, frames=body.frames).of(scene, model).model


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
        | {"step_ms": round(float(full.step) * 1e3, 3), "sag": 0.0, "wobble": 0.0, "frequency": 0.0}
    ]
    print(rows[-1], flush=True)
    if real_piece:
        model = reduce_body(body.mesh, body.held, gravity_vector=body.gravity, order=body.order)
        seconds = made_in(body, body.order)
        every = [Reduced("vector", model, seconds, told=True)]
    else:
        every = models(body)
    for made in every:
        print(f"{body.name}: {made.label}, {made.made:.1f} CPU s to make", flush=True)
        rows.append(measure(body, full, made))
        print(rows[-1], flush=True)
    return rows


def made_in(body: Body, order: int | None, times: int = 3) -> float:
    """Least CPU seconds of so many makings of the vector model."""
    known = {"supports": body.held, "gravity_vector": body.gravity, "order": order}
    return min(timed(lambda: reduce_body(body.mesh, **known))[1] for _ in range(times))


def steps_of(body: Body, order: int | None, times: int = 5) -> dict:
    """Steps in a CPU second, the most of so many runs, of 34 and 120 coordinates."""
    known = {"supports": body.held, "gravity_vector": body.gravity, "order": order}
    row: dict = {"body": body.name}
    for kind in Subspace:
        model = reduce_body(body.mesh, kind=kind, **known)
        found = replace(body, order=model.order)
        load, velocity = model.weight(found.gravity), model.coordinates(found.velocity)
        seconds = min(
            timed(lambda m=model, f=load, v=velocity: followed(m, None, f, v, body, {}))[1]
            for _ in range(times)
        )
        said = f"{kind}, {model.dofs} coordinates, {len(model.cells)} cells"
        row[said] = round(body.frames / seconds)
    return row


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
            ax.axvline(own["full"]["step_ms"], color="gray", ls=":", label="full body")
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
        path.write_text(documented(rows))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bodies", nargs="*", default=list(BODIES))
    parser.add_argument("--real", nargs="*", help="names of real pieces; none named: all twelve")
    parser.add_argument("--order", type=int, help="of the elements; by default as motions take")
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--picture", type=Path)
    parser.add_argument("--made", action="store_true", help="only how long the making takes")
    parser.add_argument("--steps", action="store_true", help="only the steps in a CPU second")
    options = parser.parse_args()
    if options.steps:
        with one_thread():
            for name in options.bodies:
                print(steps_of(BODIES[name](), options.order), flush=True)
        return
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
