"""What is told of the error of a quadratic answer, beside the error itself.

    python benchmarks/estimator.py [--json] [--kind plate] [--refine] [--cost]
    python benchmarks/estimator.py --references FILE [--part 0/2]   # about 10 CPU minutes

Bodies of the kinds in ``CASES`` and 24 drawn at random (``random_cases``), at rest and ringing, by
the methods of ``simulate``. *Effectivity* is an estimate over the true error: in the norm of
energy, of the largest displacement, of the supports' forces, of the first frequency, and of the
stress around its largest (rms). It is judged where the true error is above a ten-thousandth and
known to a tenth.

References (benchmarks/data/estimator.json) are quadratic answers on meshes cut in eight twice: 64
times the tets, of the same faces, supports and loads. What a third cut would add follows from the
two before by a geometric series, whose ratio lies between that of a smooth answer, 1/16, and of the
sharpest corner, 1/2; ``doubt`` is .3 of what was added so. No cubic element is in them.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

os.environ.update({f"{name}_NUM_THREADS": "1" for name in ("OMP", "MKL", "OPENBLAS", "NUMEXPR")})

import numpy as np
from autophyx_tet.fem.elements.assembly import discretise, node_supports
from autophyx_tet.fem.elements.elastic import displacement_gradients, linear_stress, von_mises
from autophyx_tet.fem.elements.space import make_space
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.fem.scene.loads import Traction, pressure
from autophyx_tet.fem.scene.scene import Scene
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.error import find_discretisation_error
from autophyx_tet.fem.solve.mesh_error import CHILDREN, find_exponents, smooth_patch
from autophyx_tet.fem.solve.method import METHODS
from autophyx_tet.fem.solve.statics import solve_static

DATA = Path(__file__).parent / "data" / "estimator.json"
QUANTITIES = ("energy", "displacement", "reaction", "frequency", "stress")
# Children of a quadratic tet, in the order of ``CHILDREN``.
CUT = [
    [0, 4, 6, 7], [4, 1, 5, 8], [6, 5, 2, 9], [7, 8, 9, 3],
    [4, 6, 7, 8], [4, 5, 6, 8], [6, 7, 8, 9], [5, 6, 9, 8],
]  # fmt: skip
JUDGED, DOUBT = 1e-4, 0.1
MOST_RINGING = 110  # tets of a body whose frequency has a reference: its factor takes seconds


@dataclass(frozen=True)
class Case:
    """A scene with a name and a kind."""

    name: str
    kind: str
    scene: Scene


def body(size, cells, keep: Callable | None = None, warp: Callable | None = None) -> TetMesh:
    """Box of cells of which ``keep`` of the centres stay, and whose points are ``warp``ed."""
    mesh = box_mesh(size, cells)
    tets = mesh.tets
    if keep is not None:
        cell = np.repeat(mesh.centroids.reshape(-1, 6, 3).mean(axis=1), 6, axis=0)
        tets = tets[keep(*cell.T)]
    used, tets = np.unique(tets, return_inverse=True)
    points = mesh.points[used]
    return TetMesh.oriented(points if warp is None else warp(points), tets.reshape(-1, 4))


def made(mesh: TetMesh, E=1e9, nu=0.3) -> TetMesh:
    """The mesh with moduli, numbers or functions of the centres of tets."""
    at = mesh.centroids.T
    values = (np.broadcast_to(v(*at) if callable(v) else v, len(mesh.tets)) for v in (E, nu, 1e3))
    return mesh.with_material(ElementMaterial(*values))


def flat(mesh: TetMesh, axis: int, value: float, where: Callable | None = None) -> np.ndarray:
    """Boundary faces in the plane at ``value`` along ``axis``, where their centres are."""
    faces = mesh.boundary.faces
    x = mesh.points[faces]
    inside = (np.abs(x[..., axis] - value) < 1e-6).all(axis=1)
    return faces[inside if where is None else inside & where(*x.mean(axis=1).T)]


def held_at(mesh: TetMesh, *places: tuple) -> Supports:
    """Supports on faces: (faces), (faces, axes) or (faces, axes, values [m])."""
    held = Supports.none(len(mesh.points))
    for faces, *rest in places:
        held = held.with_fixed(np.unique(faces), *(rest or [(0, 1, 2)]))
    return held


def bar(kind, name, size, cells, *, load="shear", E=1e9, nu=0.3, ends=(0,), **shape) -> Case:
    """A bar along x, clamped at its ``ends`` (0: x = 0, 1: x = L)."""
    mesh = made(body(size, cells, **shape), E, nu)
    x = [float(mesh.points[:, 0].min()), float(mesh.points[:, 0].max())]
    top = float(mesh.points[:, 2].max())
    held = held_at(mesh, *((flat(mesh, 0, x[end]),) for end in ends))
    end, known = flat(mesh, 0, x[1]), {}
    if load == "gravity":
        known["gravity_vector"] = (0, 0, -9.81)
    elif load == "hanging":
        known["gravity_vector"] = (9.81, 0, 0)
    elif load == "top":
        known["tractions"] = (pressure(mesh, flat(mesh, 2, top), 1e3),)
    elif load == "torsion":
        middle = mesh.points.mean(axis=0)
        away = mesh.points[end].mean(axis=1) - middle
        turn = np.cross((1, 0, 0), away)
        known["tractions"] = (Traction(end, 1e3 * turn),)
    else:
        force = {"shear": (0, 0, -1e3), "pull": (1e3, 0, 0)}[load]
        known["tractions"] = (Traction(end, np.array(force)),)
    return Case(name, kind, Scene(mesh=mesh, supports=held, **known))


def jitter(size, amount, seed):
    """Points moved at random [m], those of a face within it."""
    def warp(p):
        move = np.random.default_rng(seed).uniform(-amount, amount, p.shape)
        outer = (np.abs(p) < 1e-9) | (np.abs(p - size) < 1e-9)
        return p + np.where(outer, 0.0, move)
    return warp


def built_cases() -> Iterator[Case]:
    """Sixty-eight bodies of fourteen kinds."""
    for n, cells in ((5, (5, 1, 1)), (10, (10, 1, 1)), (20, (20, 1, 1)), (50, (40, 1, 1)),
                     (50, (20, 1, 1)), (5, (10, 2, 2)), (10, (14, 2, 2)), (20, (20, 2, 2)),
                     (4, (8, 3, 3)), (3, (5, 4, 4)), (2, (3, 3, 3)), (10, (4, 1, 1))):
        name = f"cantilever 1:{n}, " + " x ".join(map(str, cells))
        yield bar("cantilever", name, (n, 1, 1), cells)
    for k in (1, 2):
        yield bar("plate", f"plate {k} thick, tip", (1, 1, 0.05), (6, 6, k))
        yield bar("plate", f"plate {k} thick, two edges", (1, 1, 0.05), (6, 5, k), load="top",
                  ends=(0, 1))
    yield bar("plate", "plate 1:50, its weight", (1, 0.6, 0.02), (8, 5, 1), load="gravity")
    for nu in (0.45, 0.49, 0.499):
        for moved in (True, False):
            mesh = made(body((1, 1, 0.4), (4, 4, 2)), 1e6, nu)
            bottom, top = flat(mesh, 2, 0.0), flat(mesh, 2, 0.4)
            name = f"pad of nu {nu}, {'pressed' if moved else 'loaded'}"
            if moved:
                held = held_at(mesh, (bottom,), (top, (0, 1, 2), (0, 0, -0.02)))
                yield Case(name, "pad", Scene(mesh=mesh, supports=held))
            else:
                part = flat(mesh, 2, 0.4, lambda x, y, z: np.maximum(abs(x - 0.5), abs(y - 0.5)) < 0.25)
                load = Traction(part, np.array((0, 0, -1e3)))
                yield Case(name, "pad", Scene(mesh=mesh, supports=held_at(mesh, (bottom,)), tractions=(load,)))
    yield bar("pad", "cantilever of nu .499", (5, 1, 1), (8, 2, 2), nu=0.499)
    for n, k in ((4, 1), (6, 1), (6, 2)):
        mesh = made(body((1, 1, 0.2), (n, n, k), lambda x, y, z: (x < 0.5) | (y < 0.5)))
        load = Traction(flat(mesh, 0, 1.0), np.array((0, -1e3, 0)))
        held = held_at(mesh, (flat(mesh, 1, 1.0),))
        yield Case(f"bracket of {n} x {n} x {k}", "bracket", Scene(mesh=mesh, supports=held, tractions=(load,)))
    for n in (2, 3):
        def hole(p):  # squares around the middle become circles near it
            q = p[:, :2] - 0.5
            ring = np.abs(q).max(axis=1)
            round_ = np.linalg.norm(q, axis=1)
            s = np.clip((0.5 - ring) / 0.375, 0, 1)[:, None]
            out = p.copy()
            out[:, :2] = 0.5 + q * (1 - s + s * (ring / np.maximum(round_, 1e-9))[:, None])
            return out
        keep = lambda x, y, z: np.maximum(abs(x - 0.5), abs(y - 0.5)) > 0.125
        yield bar("hole", f"plate with a hole, {4 * n} cells", (1, 1, 0.1), (4 * n, 4 * n, 1) if n == 2 else (8, 8, 1),
                  load="pull" if n == 2 else "shear", keep=keep, warp=hole)
    for n in (2, 3):
        keep = lambda x, y, z: (abs(x - 1.5) > 0.26) | (z < 0.5)
        yield bar("notch", f"notched bar {n}", (3, 0.5, 1), (6 if n == 2 else 12, 1, 2 if n == 2 else 4), load="pull", keep=keep)
    for contrast in (1, 10, 1e3, 1e5):
        yield bar("two materials", f"sandwich, contrast {contrast:g}", (4, 1, 1), (8, 2, 2),
                  E=lambda x, y, z, k=contrast: np.where(z < 0.5, 1e9, 1e9 / k))
        yield bar("two materials", f"in series, contrast {contrast:g}", (4, 1, 1), (8, 2, 2), load="pull",
                  E=lambda x, y, z, k=contrast: np.where(x < 2, 1e9, 1e9 / k))
    for n in (2, 3):
        yield bar("cube", f"cube of {n}, pressed", (1, 1, 1), (n, n, n), load="top")
    yield bar("torsion", "twisted bar 8", (4, 1, 1), (8, 2, 2), load="torsion")
    yield bar("torsion", "twisted bar 5", (3, 1, 1), (5, 3, 3), load="torsion")
    yield bar("hanging", "hanging bar", (4, 1, 1), (8, 2, 2), load="hanging")
    yield bar("hanging", "hanging bar of nu .49", (2, 1, 1), (4, 3, 3), load="hanging", nu=0.49)
    yield bar("hanging", "sagging between walls", (8, 1, 1), (12, 2, 2), load="gravity", ends=(0, 1))
    for name, size, cells, axes, by in (
        ("pulled", (4, 1, 1), (8, 2, 2), (0, 1, 2), (0.01, 0, 0)),
        ("sheared", (5, 1, 1), (10, 2, 2), (0, 1, 2), (0, 0, 0.05)),
        ("sheared, of a cell", (5, 1, 1), (5, 1, 1), (0, 1, 2), (0, 0, 0.05)),
        ("a block, sheared", (1, 1, 1), (3, 3, 3), (0, 1, 2), (0, 0.02, 0)),
        ("guided", (5, 1, 1), (6, 1, 1), (2,), (0.05,)),
        ("a pad of one cell", (1, 1, 0.25), (4, 4, 1), (0, 1, 2), (0, 0, -0.01)),
    ):
        mesh, along = made(body(size, cells)), 2 if "pad" in name else 0
        held = held_at(mesh, (flat(mesh, along, 0.0),), (flat(mesh, along, size[along]), axes, by))
        yield Case(f"moved: {name}", "moved", Scene(mesh=mesh, supports=held))
    for name, size, cells in (("bar", (6, 1, 1), (8, 2, 2)), ("short bar", (2, 1, 1), (4, 3, 3)),
                              ("plate", (1, 0.4, 0.05), (8, 4, 1))):
        mesh = made(body(size, cells))
        held = held_at(mesh, (flat(mesh, 0, 0.0),), (flat(mesh, 0, size[0]),))
        top = flat(mesh, 2, size[2], lambda x, y, z, L=size[0]: x < 0.5 * L)
        scene = Scene(mesh=mesh, supports=held, tractions=(pressure(mesh, top, 1e3),))
        yield Case(f"{name} between walls, loaded aside", "two supports", scene)
    yield bar("bad elements", "jittered", (5, 1, 1), (10, 2, 2), warp=jitter((5, 1, 1), 0.15, 1))
    yield bar("bad elements", "jittered more", (5, 1, 1), (7, 3, 3), warp=jitter((5, 1, 1), 0.11, 3))
    yield bar("bad elements", "flat cells", (1, 1, 0.05), (3, 3, 3))
    yield bar("bad elements", "needles", (5, 1, 1), (2, 4, 4))
    # Things: of boxes, and bent
    chair = lambda x, y, z: ((z > 0.4) & (z < 0.5)) | ((z > 0.5) & (y > 0.4)) | (
        (z < 0.4) & (abs(x - 0.25) > 0.15) & (abs(y - 0.25) > 0.15))
    table = lambda x, y, z: (z > 0.6) | ((abs(x - 0.5) < 0.13) & (abs(y - 0.5) < 0.13)) | (z < 0.1)
    frame = lambda x, y, z: (x < 0.2) | (x > 0.8) | (z > 0.8)
    channel = lambda x, y, z: (z < 0.25) | (y < 0.25) | (y > 0.75)
    tee = lambda x, y, z: (z > 0.75) | (abs(y - 0.5) < 0.17)
    for name, size, cells, keep, base in (
        ("chair", (0.5, 0.5, 0.9), (5, 5, 9), chair, 2), ("table", (1, 1, 0.7), (4, 4, 7), table, 2),
        ("frame", (1, 0.2, 1), (5, 1, 5), frame, 2), ("channel", (3, 1, 1), (6, 4, 4), channel, 0),
        ("tee", (2, 1, 1), (5, 3, 4), tee, 0),
    ):
        mesh = made(body(size, cells, keep), 2e9, 0.35)
        held = held_at(mesh, (flat(mesh, base, 0.0),))
        yield Case(name, "thing", Scene(mesh=mesh, supports=held, gravity_vector=(0, 2.0, -9.81)))
    def bent(p):
        a, r = np.pi / 2 * p[:, 0] / 4, 1.5 + p[:, 2]
        return np.column_stack([r * np.sin(a), p[:, 1], r * np.cos(a)])
    def waist(p):
        thin = 0.4 + 0.6 * (2 * p[:, :1] - 1) ** 2
        return np.hstack([p[:, :1], 0.5 + (p[:, 1:] - 0.5) * thin])
    for name, size, cells, warp in (("hook", (4, 1, 1), (8, 2, 2), bent), ("waist", (1, 1, 1), (6, 3, 3), waist),
                                    ("thin hook", (4, 1, 0.2), (10, 3, 1), bent)):
        mesh = made(body(size, cells, None, warp), 2e9, 0.35)
        low = mesh.points[:, 0].min()
        held = held_at(mesh, (flat(mesh, 0, float(low)),))
        yield Case(name, "thing", Scene(mesh=mesh, supports=held, gravity_vector=(1.0, 2.0, -9.81)))
    mesh = made(body((1, 1, 1), (3, 3, 3)))
    forces = np.zeros_like(mesh.points)
    forces[np.linalg.norm(mesh.points - (1, 1, 1), axis=1).argmin()] = (0, 0, -1e4)
    held = held_at(mesh, (flat(mesh, 2, 0.0),))
    yield Case("a force at a point", "point load", Scene(mesh=mesh, supports=held, forces=forces))


# By kind: the first were seen while the estimate was made, the others drawn when it was done.
SEEDS = {"random": 20261128, "drawn": 20261129}


def random_cases(kind: str, count: int = 24) -> Iterator[Case]:
    """Boxes with a part cut away, of one or two materials, held on parts of faces, loaded at will."""
    rng = np.random.default_rng(SEEDS[kind])
    for number in range(count):
        cells = rng.integers(1, 7, 3)
        while not 8 <= np.prod(cells) <= 45:
            cells = rng.integers(1, 7, 3)
        size = cells * rng.uniform(0.3, 1.0, 3) * 10 ** rng.uniform(-0.3, 0.3)
        corner, side = rng.uniform(0.35, 0.75, 3), rng.choice([-1, 1], 3)
        cut = rng.random() < 0.5
        def keep(x, y, z, size=size, corner=corner, side=side, cut=cut):
            q = np.stack([x, y, z], axis=1) / size - 0.5
            return ~((side * q > corner - 0.5).all(axis=1) & cut)
        nu, k = rng.choice([0.0, 0.2, 0.3, 0.45, 0.49]), 10 ** rng.uniform(0, 3)
        axis, two = int(rng.integers(3)), rng.random() < 0.3
        E = lambda x, y, z, a=axis, k=k, s=size: np.where((x, y, z)[a] < s[a] / 2, 1e9, 1e9 / k)
        warp = jitter(size, 0.15 * (size / cells).min(), number) if rng.random() < 0.4 else None
        mesh = made(body(size, cells, keep, warp), E if two else 1e9, nu)
        along = int(rng.integers(3))
        start = float(mesh.points[:, along].min())
        other, part = (along + 1) % 3, rng.random() < 0.4
        half = lambda x, y, z, o=other, s=size: (x, y, z)[o] < s[o] / 2
        base = flat(mesh, along, start, half if part else None)
        base = base if len(base) else flat(mesh, along, start)
        held, known = held_at(mesh, (base,)), {}
        end = flat(mesh, along, float(mesh.points[:, along].max()))
        load = rng.integers(3)
        if load == 0:
            known["gravity_vector"] = tuple(rng.normal(size=3) * 10)
        elif load == 1:
            known["tractions"] = (Traction(end, rng.normal(size=3) * 1e3),)
        else:
            held = held.with_fixed(np.unique(end), (0, 1, 2), rng.normal(size=3) * 1e-2 * size.min())
        yield Case(f"{kind} {number}", kind, Scene(mesh=mesh, supports=held, **known))


def refined(scene: Scene) -> Scene:
    """The same body, every tet cut in eight, with the same faces held and loaded."""
    mesh = scene.mesh
    space = make_space(mesh, 2)
    old = mesh.material
    material = ElementMaterial(*(np.repeat(getattr(old, name), 8) for name in ("E", "nu", "rho")))
    fine = TetMesh.oriented(space.nodes, space.elements[:, CUT].reshape(-1, 4), material=material)
    held = node_supports(scene.held, space)
    number = {tuple(e): space.points + i for i, e in enumerate(space.edges.tolist())}
    loads = []
    for load in scene.tractions:
        a, b, c = load.faces.T.tolist()
        middle = lambda p, q: [number[min(e), max(e)] for e in zip(p, q, strict=True)]
        ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
        faces = np.concatenate([np.transpose(f) for f in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
        loads.append(Traction(faces, np.tile(np.broadcast_to(load.value, load.faces.shape), (4, 1))))
    forces = scene.forces
    if forces is not None:
        forces = np.vstack([forces, np.zeros((len(space.edges), 3))])
    return replace(scene, mesh=fine, supports=held, tractions=tuple(loads), forces=forces)


def answer(scene: Scene, *, ringing: bool) -> dict:
    """What the errors are of: twice the potential, displacement, forces of places, frequency."""
    loads = {"gravity_vector": scene.gravity_vector, "traction": scene.tractions, "forces": scene.forces}
    rest = solve_static(scene.mesh, scene.held, order=2, **loads)
    held = node_supports(scene.held, rest.space)
    work = float((rest.reaction * np.where(held.fixed, held.values, 0.0)).sum())
    found = {
        "rest": rest,
        "potential": 2 * work - 2 * rest.energy,
        "moved": rest.node_displacement,
        "places": np.array([np.where(p, rest.reaction, 0.0).sum(axis=0) for p in held.places]),
        "stress": rest.stress,
    }
    if ringing:
        fixed = replace(scene, supports=replace(scene.held, values=0 * scene.held.values), modes=1)
        found["modes"] = METHODS["modal"].solve(fixed, order=2)
    return found


def reference(case: Case) -> dict:
    """True relative errors of the quadratic answer, and how well they are known."""
    scenes = [case.scene, (once := refined(case.scene)), refined(once)]
    ringing = len(case.scene.mesh.tets) <= MOST_RINGING
    coarse, middle, fine = (answer(scene, ringing=ringing) for scene in scenes)
    steps = [a["potential"] - b["potential"] for a, b in ((coarse, middle), (middle, fine))]
    ratio = float(np.clip(steps[1] / steps[0], 1 / 16, 1 / 2))
    rest, left = coarse["rest"], ratio / (1 - ratio)
    beyond = steps[1] * left
    out = {"energy": float(np.sqrt((sum(steps) + beyond) / (2 * rest.energy)))}
    doubt = {"energy": 0.3 * beyond / (sum(steps) + beyond)}

    def note(name: str, change: np.ndarray, last: np.ndarray, size: float) -> None:
        full, more = float(np.linalg.norm(change + left * last)), float(np.linalg.norm(left * last))
        out[name], doubt[name] = full / size, 0.3 * more / full if full else np.inf

    u, n = np.linalg.norm(rest.node_displacement, axis=1), len(rest.node_displacement)
    node, held = int(u.argmax()), node_supports(case.scene.held, rest.space)
    if not (held.fixed[node].any() and held.values[node].any()):
        at = [np.linalg.norm(a["moved"][node]) for a in (coarse, middle, fine)]
        note("displacement", np.array(at[2] - at[0]), np.array(at[2] - at[1]), float(u.max()))
    size = np.linalg.norm(coarse["places"], axis=1)
    off = np.linalg.norm((fine["places"] - coarse["places"]) + left * (fine["places"] - middle["places"]), axis=1)
    if len(size) > 1:
        worst = int(np.where(size > 0.01 * size.max(), off / size, 0).argmax())
        note("reaction", fine["places"][worst] - coarse["places"][worst],
             fine["places"][worst] - middle["places"][worst], size[worst])
    if ringing:
        f = [float(a["modes"].frequencies[0]) for a in (coarse, middle, fine)]
        note("frequency", np.array(f[2] - f[0]), np.array(f[2] - f[1]), f[0])
    exponents = find_exponents(rest.mesh, rest.space, held.fixed, case.scene.forces)
    patch = smooth_patch(rest, exponents)
    if patch is not None:
        around, top = patch
        grid = discretise(rest.mesh, 2)
        here = linear_stress(displacement_gradients(grid, rest.node_displacement, CHILDREN), rest.mesh.material)
        once_, twice = (a["stress"].reshape(len(rest.mesh.tets), 8, -1, 3, 3).mean(axis=2) for a in (middle, fine))
        change, last = (twice - here)[around], (twice - once_)[around]
        full = np.sqrt((von_mises(change + left * last) ** 2).mean())
        out["stress"] = float(full / von_mises(here[top]).max())
        doubt["stress"] = float(0.3 * left * np.sqrt((von_mises(last) ** 2).mean()) / full)
    return {"tets": len(rest.mesh.tets), "true": out, "doubt": doubt}


def told(case: Case, *, ringing: bool) -> tuple[dict, tuple]:
    """What ``simulate`` tells: errors by quantity, singular places."""
    rest = METHODS["statics"].solve(case.scene, law="linear")
    error = rest.discretisation_error
    found = {"displacement": error.value} | {
        name: getattr(error, name) for name in ("energy", "reaction", "stress")}
    if ringing:
        still = replace(case.scene.held, values=0 * case.scene.held.values)
        found["frequency"] = METHODS["modal"].solve(replace(case.scene, supports=still, modes=4), order=2).error
    return found, error.places


def cost(tets: tuple[int, ...] = (6, 8, 10)) -> list[dict]:
    """CPU seconds of the estimate and of the quadratic solve, on bodies that are new to both."""
    rows = []
    for shape, cells in [((5, 1, 1), (5 * k, k, k)) for k in tets] + [
        ((1, 1, 0.03), (40, 40, 1)), ((1, 1, 1), (11, 11, 11))]:
        for turn in range(2):  # the first loads the kernels
            case = bar("cost", "", shape, cells if turn else (4, 2, 1), load="gravity")
            scene, start = case.scene, time.process_time()
            loads = {"gravity_vector": scene.gravity_vector, "traction": (), "forces": None}
            rest = solve_static(scene.mesh, scene.held, order=2, **loads)
            middle = time.process_time()
            find_discretisation_error(rest, scene.held, None, **loads)
            end = time.process_time()
        rows.append({"tets": len(scene.mesh.tets), "solve": middle - start, "estimate": end - middle,
                     "share": (end - middle) / (middle - start)})
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--references", type=Path, help="make them, into a file")
    parser.add_argument("--part", default="0/1", help="K/N: every N-th case from the K-th")
    parser.add_argument("--kind", default="")
    parser.add_argument("--cost", action="store_true", help="CPU seconds alone")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    if options.cost:
        return print(json.dumps(cost(), indent=1))
    first, every = map(int, options.part.split("/"))
    cases = [*built_cases(), *random_cases("random"), *random_cases("drawn")]
    cases = [c for c in cases if options.kind in c.kind][first::every]
    if options.references:
        known = json.loads(options.references.read_text()) if options.references.exists() else {}
        for case in cases:
            if case.name not in known:
                start = time.process_time()
                known[case.name] = reference(case)
                print(case.name, time.process_time() - start, known[case.name], file=sys.stderr, flush=True)
                options.references.write_text(json.dumps(known, indent=0))
        return None
    known, rows = json.loads(DATA.read_text())["cases"], []
    for case in (c for c in cases if c.name in known):
        true, doubt = known[case.name]["true"], known[case.name]["doubt"]
        found, places = told(case, ringing="frequency" in true)
        row = {"case": case.name, "kind": case.kind, "singular": bool(places)}
        for name in QUANTITIES:
            if true.get(name, 0) > JUDGED and doubt[name] < DOUBT:
                row[name] = found[name] / true[name]
        rows.append(row)
        print(row, file=sys.stderr, flush=True)
    bounds = {"energy": (0.7, 1.3)}
    summary = {}
    for name in QUANTITIES:
        ratio = np.array([row[name] for row in rows if name in row])
        low, high = bounds.get(name, (0.5, 2.0))
        inside = float(((ratio >= low) & (ratio <= high)).mean()) if len(ratio) else np.nan
        summary[name] = {"cases": len(ratio), "within": inside, "least": float(ratio.min()),
                         "median": float(np.median(ratio)), "most": float(ratio.max())}
    print(json.dumps({"schema": 1, "summary": summary, "rows": rows if options.json else len(rows)}, indent=1))


if __name__ == "__main__":
    main()
