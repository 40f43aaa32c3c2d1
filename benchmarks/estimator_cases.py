"""Bodies whose error by the mesh is known, for ``estimator.py``: built ones and random ones."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from autophyx_tet.fem.elements.assembly import node_supports
from autophyx_tet.fem.elements.space import make_space
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.fem.scene.loads import Traction, pressure
from autophyx_tet.fem.scene.scene import Scene
from autophyx_tet.fem.scene.supports import Supports

# Children of a quadratic tet, in the order of ``CHILDREN``.
CUT = [
    [0, 4, 6, 7], [4, 1, 5, 8], [6, 5, 2, 9], [7, 8, 9, 3],
    [4, 6, 7, 8], [4, 5, 6, 8], [6, 7, 8, 9], [5, 6, 9, 8],
]  # fmt: skip
# By kind: the first were seen while the estimate was made, the others drawn when it was done, and
# again each time when what those had shown was mended.
SEEDS = {"random": 20261128, "drawn": 20261129, "later": 20261130, "last": 20261201}


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


def made(mesh: TetMesh, E: Any = 1e9, nu: Any = 0.3) -> TetMesh:
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


def bar(
    kind,
    name,
    size,
    cells,
    *,
    load: str = "shear",
    E: Any = 1e9,
    nu: Any = 0.3,
    ends=(0,),
    **shape: Any,
) -> Case:
    """A bar along x, clamped at its ``ends`` (0: x = 0, 1: x = L)."""
    mesh = made(body(size, cells, **shape), E, nu)
    x = [float(mesh.points[:, 0].min()), float(mesh.points[:, 0].max())]
    held = held_at(mesh, *((flat(mesh, 0, x[end]),) for end in ends))
    end, known = flat(mesh, 0, x[1]), dict[str, Any]()
    if load == "gravity":
        known["gravity_vector"] = (0, 0, -9.81)
    elif load == "hanging":
        known["gravity_vector"] = (9.81, 0, 0)
    elif load == "top":
        top = flat(mesh, 2, float(mesh.points[:, 2].max()))
        known["tractions"] = (pressure(mesh, top, 1e3),)
    elif load == "torsion":
        away = mesh.points[end].mean(axis=1) - mesh.points.mean(axis=0)
        known["tractions"] = (Traction(end, 1e3 * np.cross((1, 0, 0), away)),)
    else:
        force = {"shear": (0, 0, -1e3), "pull": (1e3, 0, 0)}[load]
        known["tractions"] = (Traction(end, np.array(force)),)
    return Case(name, kind, Scene(mesh=mesh, supports=held, **known))


def jitter(size, amount, seed) -> Callable:
    """Points moved at random [m], those of a face within it."""

    def warp(p):
        move = np.random.default_rng(seed).uniform(-amount, amount, p.shape)
        outer = (np.abs(p) < 1e-9) | (np.abs(p - size) < 1e-9)
        return p + np.where(outer, 0.0, move)

    return warp


def built_cases() -> Iterator[Case]:
    """Sixty-eight bodies of fifteen kinds."""
    yield from _slender()
    yield from _pads()
    yield from _corners()
    yield from _two_materials()
    yield from _moved()
    yield from _things()


def _slender() -> Iterator[Case]:
    for n, cells in (
        (5, (5, 1, 1)), (10, (10, 1, 1)), (20, (20, 1, 1)), (50, (40, 1, 1)), (50, (20, 1, 1)),
        (5, (10, 2, 2)), (10, (14, 2, 2)), (20, (20, 2, 2)), (4, (8, 3, 3)), (3, (5, 4, 4)),
        (2, (3, 3, 3)), (10, (4, 1, 1)),
    ):  # fmt: skip
        name = f"cantilever 1:{n}, " + " x ".join(map(str, cells))
        yield bar("cantilever", name, (n, 1, 1), cells)
    two = {"load": "top", "ends": (0, 1)}
    for k in (1, 2):
        yield bar("plate", f"plate {k} thick, tip", (1, 1, 0.05), (6, 6, k))
        yield bar("plate", f"plate {k} thick, two edges", (1, 1, 0.05), (6, 5, k), **two)
    yield bar("plate", "plate 1:50, its weight", (1, 0.6, 0.02), (8, 5, 1), load="gravity")
    for n in (2, 3):
        yield bar("cube", f"cube of {n}, pressed", (1, 1, 1), (n, n, n), load="top")
    yield bar("torsion", "twisted bar 8", (4, 1, 1), (8, 2, 2), load="torsion")
    yield bar("torsion", "twisted bar 5", (3, 1, 1), (5, 3, 3), load="torsion")
    yield bar("hanging", "hanging bar", (4, 1, 1), (8, 2, 2), load="hanging")
    yield bar("hanging", "hanging bar of nu .49", (2, 1, 1), (4, 3, 3), load="hanging", nu=0.49)
    both = {"load": "gravity", "ends": (0, 1)}
    yield bar("hanging", "sagging between walls", (8, 1, 1), (12, 2, 2), **both)
    for name, size, cells in (
        ("bar", (6, 1, 1), (8, 2, 2)),
        ("short bar", (2, 1, 1), (4, 3, 3)),
        ("plate", (1, 0.4, 0.05), (8, 4, 1)),
    ):
        mesh = made(body(size, cells))
        held = held_at(mesh, (flat(mesh, 0, 0.0),), (flat(mesh, 0, size[0]),))
        top = flat(mesh, 2, size[2], lambda x, y, z, L=size[0]: x < 0.5 * L)
        scene = Scene(mesh=mesh, supports=held, tractions=(pressure(mesh, top, 1e3),))
        yield Case(f"{name} between walls, loaded aside", "two supports", scene)
    one, more = jitter((5, 1, 1), 0.15, 1), jitter((5, 1, 1), 0.11, 3)
    yield bar("bad elements", "jittered", (5, 1, 1), (10, 2, 2), warp=one)
    yield bar("bad elements", "jittered more", (5, 1, 1), (7, 3, 3), warp=more)
    yield bar("bad elements", "flat cells", (1, 1, 0.05), (3, 3, 3))
    yield bar("bad elements", "needles", (5, 1, 1), (2, 4, 4))


def _pads() -> Iterator[Case]:
    for nu in (0.45, 0.49, 0.499):
        mesh = made(body((1, 1, 0.4), (4, 4, 2)), 1e6, nu)
        bottom, top = flat(mesh, 2, 0.0), flat(mesh, 2, 0.4)
        held = held_at(mesh, (bottom,), (top, (0, 1, 2), np.array((0, 0, -0.02))))
        yield Case(f"pad of nu {nu}, pressed", "pad", Scene(mesh=mesh, supports=held))
        middle = flat(mesh, 2, 0.4, lambda x, y, z: np.maximum(abs(x - 0.5), abs(y - 0.5)) < 0.25)
        load = Traction(middle, np.array((0, 0, -1e3)))
        scene = Scene(mesh=mesh, supports=held_at(mesh, (bottom,)), tractions=(load,))
        yield Case(f"pad of nu {nu}, loaded", "pad", scene)
    yield bar("pad", "cantilever of nu .499", (5, 1, 1), (8, 2, 2), nu=0.499)


def _corners() -> Iterator[Case]:
    for n, k in ((4, 1), (6, 1), (6, 2)):
        mesh = made(body((1, 1, 0.2), (n, n, k), lambda x, y, z: (x < 0.5) | (y < 0.5)))
        load = Traction(flat(mesh, 0, 1.0), np.array((0, -1e3, 0)))
        held = held_at(mesh, (flat(mesh, 1, 1.0),))
        scene = Scene(mesh=mesh, supports=held, tractions=(load,))
        yield Case(f"bracket of {n} x {n} x {k}", "bracket", scene)

    def hole(p):  # squares around the middle become circles near it
        q = p[:, :2] - 0.5
        ring, away = np.abs(q).max(axis=1), np.linalg.norm(q, axis=1)
        s = np.clip((0.5 - ring) / 0.375, 0, 1)
        scale = 1 - s + s * ring / np.maximum(away, 1e-9)
        return np.hstack([0.5 + q * scale[:, None], p[:, 2:]])

    def holed(x, y, z):
        return np.maximum(abs(x - 0.5), abs(y - 0.5)) > 0.125

    for number, load in ((8, "pull"), (12, "shear")):
        shape = {"keep": holed, "warp": hole, "load": load}
        name = f"plate with a hole, {number} cells"
        yield bar("hole", name, (1, 1, 0.1), (8, 8, 1), **shape)

    def notched(x, y, z):
        return (abs(x - 1.5) > 0.26) | (z < 0.5)

    for number, cells in ((2, (6, 1, 2)), (3, (12, 2 - 1, 4))):
        shape = {"keep": notched, "load": "pull"}
        yield bar("notch", f"notched bar {number}", (3, 0.5, 1), cells, **shape)
    mesh = made(body((1, 1, 1), (3, 3, 3)))
    forces = np.zeros_like(mesh.points)
    forces[np.linalg.norm(mesh.points - (1, 1, 1), axis=1).argmin()] = (0, 0, -1e4)
    held = held_at(mesh, (flat(mesh, 2, 0.0),))
    scene = Scene(mesh=mesh, supports=held, forces=forces)
    yield Case("a force at a point", "point load", scene)


def _two_materials() -> Iterator[Case]:
    for k in (1, 10, 1e3, 1e5):
        layers = {"E": lambda x, y, z, k=k: np.where(z < 0.5, 1e9, 1e9 / k)}
        halves = {"E": lambda x, y, z, k=k: np.where(x < 2, 1e9, 1e9 / k), "load": "pull"}
        for name, how in (("sandwich", layers), ("in series", halves)):
            title = f"{name}, contrast {k:g}"
            yield bar("two materials", title, (4, 1, 1), (8, 2, 2), **how)


def _moved() -> Iterator[Case]:
    for name, size, cells, axes, by in (
        ("pulled", (4, 1, 1), (8, 2, 2), (0, 1, 2), (0.01, 0, 0)),
        ("sheared", (5, 1, 1), (10, 2, 2), (0, 1, 2), (0, 0, 0.05)),
        ("sheared, of a cell", (5, 1, 1), (5, 1, 1), (0, 1, 2), (0, 0, 0.05)),
        ("a block, sheared", (1, 1, 1), (3, 3, 3), (0, 1, 2), (0, 0.02, 0)),
        ("guided", (5, 1, 1), (6, 1, 1), (2,), (0.05,)),
        ("a pad of one cell", (1, 1, 0.25), (4, 4, 1), (0, 1, 2), (0, 0, -0.01)),
    ):
        mesh, along = made(body(size, cells)), 2 if "pad" in name else 0
        end = (flat(mesh, along, size[along]), axes, np.array(by))
        held = held_at(mesh, (flat(mesh, along, 0.0),), end)
        yield Case(f"moved: {name}", "moved", Scene(mesh=mesh, supports=held))


def _things() -> Iterator[Case]:
    def chair(x, y, z):
        legs = (z < 0.4) & (abs(x - 0.25) > 0.15) & (abs(y - 0.25) > 0.15)
        return ((z > 0.4) & (z < 0.5)) | ((z > 0.5) & (y > 0.4)) | legs

    def table(x, y, z):
        return (z > 0.6) | ((abs(x - 0.5) < 0.13) & (abs(y - 0.5) < 0.13)) | (z < 0.1)

    def frame(x, y, z):
        return (x < 0.2) | (x > 0.8) | (z > 0.8)

    def channel(x, y, z):
        return (z < 0.25) | (y < 0.25) | (y > 0.75)

    def tee(x, y, z):
        return (z > 0.75) | (abs(y - 0.5) < 0.17)

    for keep, size, cells, base in (
        (chair, (0.5, 0.5, 0.9), (5, 5, 9), 2),
        (table, (1, 1, 0.7), (4, 4, 7), 2),
        (frame, (1, 0.2, 1), (5, 1, 5), 2),
        (channel, (3, 1, 1), (6, 4, 4), 0),
        (tee, (2, 1, 1), (5, 3, 4), 0),
    ):
        mesh = made(body(size, cells, keep), 2e9, 0.35)
        held = held_at(mesh, (flat(mesh, base, 0.0),))
        scene = Scene(mesh=mesh, supports=held, gravity_vector=(0, 2.0, -9.81))
        yield Case(keep.__name__, "thing", scene)

    def bent(p):
        a, r = np.pi / 2 * p[:, 0] / 4, 1.5 + p[:, 2]
        return np.column_stack([r * np.sin(a), p[:, 1], r * np.cos(a)])

    def waist(p):
        thin = 0.4 + 0.6 * (2 * p[:, :1] - 1) ** 2
        return np.hstack([p[:, :1], 0.5 + (p[:, 1:] - 0.5) * thin])

    for name, size, cells, warp in (
        ("hook", (4, 1, 1), (8, 2, 2), bent),
        ("waist", (1, 1, 1), (6, 3, 3), waist),
        ("thin hook", (4, 1, 0.2), (10, 3, 1), bent),
    ):
        mesh = made(body(size, cells, None, warp), 2e9, 0.35)
        held = held_at(mesh, (flat(mesh, 0, float(mesh.points[:, 0].min())),))
        scene = Scene(mesh=mesh, supports=held, gravity_vector=(1.0, 2.0, -9.81))
        yield Case(name, "thing", scene)


def random_cases(kind: str, count: int = 24) -> Iterator[Case]:
    """Boxes with a part cut away, of one or two materials, held on parts of faces, any load."""
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

        def E(x, y, z, axis=axis, k=k, size=size):
            return np.where((x, y, z)[axis] < size[axis] / 2, 1e9, 1e9 / k)

        warp = jitter(size, 0.15 * (size / cells).min(), number) if rng.random() < 0.4 else None
        mesh = made(body(size, cells, keep, warp), E if two else 1e9, nu)
        along = int(rng.integers(3))
        start = float(mesh.points[:, along].min())
        other, part = (along + 1) % 3, rng.random() < 0.4

        def half(x, y, z, axis=other, size=size):
            return (x, y, z)[axis] < size[axis] / 2

        base = flat(mesh, along, start, half if part else None)
        base = base if len(base) else flat(mesh, along, start)
        held, known = held_at(mesh, (base,)), dict[str, Any]()
        end = flat(mesh, along, float(mesh.points[:, along].max()))
        load = rng.integers(3)
        if load == 0:
            known["gravity_vector"] = tuple(rng.normal(size=3) * 10)
        elif load == 1:
            known["tractions"] = (Traction(end, rng.normal(size=3) * 1e3),)
        else:
            by = rng.normal(size=3) * 1e-2 * size.min()
            held = held.with_fixed(np.unique(end), (0, 1, 2), by)
        yield Case(f"{kind} {number}", kind, Scene(mesh=mesh, supports=held, **known))


def refined(scene: Scene) -> Scene:
    """The same body, every tet cut in eight, with the same faces held and loaded."""
    mesh = scene.mesh
    space = make_space(mesh, 2)
    old = mesh.material
    material = ElementMaterial(*(np.repeat(getattr(old, name), 8) for name in ("E", "nu", "rho")))
    fine = TetMesh.oriented(space.nodes, space.elements[:, CUT].reshape(-1, 4), material=material)
    number = {tuple(e): space.points + i for i, e in enumerate(space.edges.tolist())}
    loads = []
    for load in scene.tractions:
        corners = load.faces
        ab, bc, ca = (
            np.array([number[tuple(e)] for e in np.sort(corners[:, side], axis=1).tolist()])
            for side in ([0, 1], [1, 2], [2, 0])
        )
        a, b, c = corners.T
        four = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        value = np.tile(np.broadcast_to(load.value, corners.shape), (4, 1))
        loads.append(Traction(np.concatenate([np.column_stack(f) for f in four]), value))
    forces = scene.forces
    if forces is not None:
        forces = np.vstack([forces, np.zeros((len(space.edges), 3))])
    held = node_supports(scene.held, space)
    return replace(scene, mesh=fine, supports=held, tractions=tuple(loads), forces=forces)
