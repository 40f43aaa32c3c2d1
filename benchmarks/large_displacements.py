"""Large displacements: the command with its defaults beside CalculiX with NLGEOM, same nodes.

    python benchmarks/large_displacements.py --json

A cantilever (P L^2 / E I = 1.4), clamped plates (q a^4 / E t^4 = 200 and 1000) and a shallow arch
beyond its limit load. Ours is ``simulate`` as a process of its own, with its checks; CalculiX has
quadratic tets (C3D10), its default solver and a pressure that follows its faces. It has no arc
length: its arch is pressed down by a prescribed displacement, whose reaction has the limit as its
top and the load once more where it has snapped. CPU seconds are of whole processes.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

os.environ.update({f"{name}_NUM_THREADS": "1" for name in ("OMP", "MKL", "OPENBLAS", "NUMEXPR")})

import numpy as np

# Faces of a C3D10 by its corners, in the order of CalculiX's P1 to P4.
FACES = np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])
ARCH_LOAD = 25.0  # N


class Body(NamedTuple):
    """A mesh, its ``fixed`` points, what the command is told, and the step of CalculiX."""

    name: str
    mesh: object
    fixed: np.ndarray
    words: list[str]
    step: str
    load: str


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    rows = []
    for body in (cantilever(), plate(200), plate(1000), arch()):
        with tempfile.TemporaryDirectory() as folder:
            rows.append(compared(body, Path(folder)))
        print(json.dumps(rows[-1]), file=sys.stderr)
    print(json.dumps(rows, indent=1) if options.json else "\n".join(map(str, rows)))


def cantilever() -> Body:
    """1 m long and 10 mm thick, with a dead force across its end."""
    from autophyx_tet.fem import box_mesh

    length, side, E = 1.0, 0.01, 2e11
    mesh = _of(box_mesh((length, side, side), (60, 2, 2)), E, 0.3)
    force = 1.4 * E * side**4 / 12 / length**2
    tip = np.flatnonzero(mesh.points[:, 0] == length)
    words = ["--fix", "plane:x<0", "--load", f"plane:x>{length}=0,0,{-force!r}"]
    return Body(
        "cantilever", mesh, mesh.points[:, 0] == 0, words, "0.1,1.", _dead(mesh, tip, force)
    )


def plate(load: float) -> Body:
    """1 m wide and 10 mm thick, clamped all around, under a pressure of ``load`` E t^4 / a^4."""
    from autophyx_tet.fem import box_mesh

    thick, E = 0.01, 7e10
    mesh = _of(box_mesh((1, 1, thick), (20, 20, 1)), E, 0.3)
    x, q = mesh.points, load * E * thick**4
    sides = ["plane:x<0", "plane:x>1", "plane:y<0", "plane:y>1"]
    words = [word for side in sides for word in ("--fix", side)]
    words += ["--pressure", f"plane:z>{thick}={q!r}"]
    pressed = "".join(
        f"{tet + 1},P{face + 1},{q:.10g}\n"
        for tet, face in np.argwhere((x[mesh.tets][:, FACES, 2] == thick).all(axis=2))
    )
    edge = (x[:, :2] == 0).any(axis=1) | (x[:, :2] == 1).any(axis=1)
    return Body(f"plate {load}", mesh, edge, words, "0.1,1.", f"*DLOAD\n{pressed}")


def arch() -> Body:
    """1 m wide and 30 mm high, pressed in the middle beyond its limit load."""
    from autophyx_tet.fem import box_mesh

    height, thick = 0.03, 0.01
    flat = box_mesh((1.0, 0.02, thick), (40, 1, 2))
    lift = 4 * height * flat.points[:, 0] * (1 - flat.points[:, 0])
    mesh = _of(flat, 2e9, 0.3, points=flat.points + np.outer(lift, [0, 0, 1]))
    x = mesh.points
    middle = np.isclose(x[:, 0], 0.5) & (x[:, 2] > height + thick - 1e-6)
    place = f"box:0.4999,0,{height + thick - 1e-4},0.5001,1,1"
    words = ["--fix", "plane:x<0", "--fix", "plane:x>1", "--load", f"{place}=0,0,{-ARCH_LOAD}"]
    load = "*BOUNDARY\n" + "".join(f"{i + 1},3,3,-0.055\n" for i in np.flatnonzero(middle))
    fixed = (x[:, 0] == 0) | (x[:, 0] == 1)
    return Body("arch", mesh, fixed, words, "0.02,1.,1e-6,0.02", load)


def _of(mesh, E: float, nu: float, points: np.ndarray | None = None):
    from autophyx_tet.fem import ElementMaterial
    from autophyx_tet.fem.mesh import TetMesh

    made = TetMesh.oriented(mesh.points if points is None else points, mesh.tets)
    return made.with_material(ElementMaterial.uniform(len(mesh.tets), E=E, nu=nu, rho=1000.0))


def _dead(mesh, points: np.ndarray, force: float) -> str:
    """A force down, spread evenly over the face of these points, as nodal forces."""
    from autophyx_tet.fem.elements.forces import traction_force
    from autophyx_tet.fem.elements.space import make_space
    from autophyx_tet.fem.scene.loads import spread_force

    faces = mesh.boundary.faces
    faces = faces[np.isin(faces, points).all(axis=1)]
    each = traction_force(mesh, make_space(mesh, 2), spread_force(mesh, faces, (0, 0, -force)))
    nodes = np.flatnonzero(each[:, 2])
    return "*CLOAD\n" + "".join(f"{i + 1},3,{each[i, 2]:.12g}\n" for i in nodes)


def compared(body: Body, folder: Path) -> dict:
    """Largest displacement [m] by both, their ratio, and CPU seconds."""
    from autophyx_tet.converters.mesh.meshdata import write_mesh

    path = folder / "body.msh"
    write_mesh(path, body.mesh)
    command = [sys.executable, "-m", "autophyx_tet", "simulate", str(path), *body.words]
    out, ours_cpu = _run([*command, "--gravity", "0", "-o", "rest.vtu", "--json"], folder)
    answer = json.loads(out)["sag"]
    table, peer_cpu = calculix(body, folder)
    row = {"body": body.name, "dof": int(3 * table.nodes), "law": answer["law"]}
    ours, peer = answer["max_displacement"], table.largest
    if body.name == "arch":
        limit = answer["load_factor"] * ARCH_LOAD
        row |= {"limit_N": limit, "calculix_limit_N": table.limit}
        row |= {"limit_ratio": limit / table.limit}
    row |= {"displacement_m": ours, "calculix_m": peer, "ratio": ours / peer}
    return row | {"cpu_s": ours_cpu, "calculix_cpu_s": peer_cpu, "cpu_ratio": ours_cpu / peer_cpu}


class Table(NamedTuple):
    """CalculiX's ``largest`` displacement [m] and, of an arch, its ``limit`` [N]."""

    nodes: int
    largest: float
    limit: float = np.nan


def calculix(body: Body, folder: Path) -> tuple[Table, float]:
    """CalculiX on the same nodes."""
    from autophyx_tet.fem.elements.assembly import node_supports
    from autophyx_tet.fem.elements.space import make_space
    from autophyx_tet.fem.scene.supports import Supports

    mesh, space = body.mesh, make_space(body.mesh, 2)
    held = node_supports(Supports.clamp(len(mesh.points), body.fixed), space).fixed[:, 0]
    material = mesh.material
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{i},{x:.12e},{y:.12e},{z:.12e}" for i, (x, y, z) in enumerate(space.nodes, 1)]
    lines += [f"*NSET, NSET=POINTS, GENERATE\n1,{space.points},1"]
    lines += ["*ELEMENT, TYPE=C3D10, ELSET=BODY"]
    lines += [f"{i},{','.join(map(str, row + 1))}" for i, row in enumerate(space.elements, 1)]
    lines += ["*MATERIAL, NAME=M", "*ELASTIC", f"{material.E[0]:.10g},{material.nu[0]:.10g}"]
    lines += ["*SOLID SECTION, ELSET=BODY, MATERIAL=M", "*BOUNDARY"]
    lines += [f"{i + 1},1,3" for i in np.flatnonzero(held)]
    lines += ["*STEP, NLGEOM, INC=1000", "*STATIC", body.step, body.load.rstrip()]
    moved = [int(line.split(",")[0]) for line in body.load.splitlines()[1:]]
    if body.name == "arch":
        lines += ["*NSET, NSET=PRESSED", *map(str, moved), "*NODE PRINT, NSET=PRESSED", "RF"]
    lines += ["*NODE PRINT, NSET=POINTS", "U", "*END STEP", ""]
    (folder / "deck.inp").write_text("\n".join(lines))
    _, spent = _run(["ccx", "deck"], folder)
    blocks: dict[str, list[np.ndarray]] = {"displacements": [], "forces": []}
    rows: list[list[float]] = []
    for line in (folder / "deck.dat").read_text().splitlines():
        cells = line.split()
        if cells and cells[0] in blocks:
            rows = []
            blocks[cells[0]].append(rows)  # type: ignore  (filled below)
        elif len(cells) == 4:
            rows.append([float(cell) for cell in cells[1:]])
    largest = np.array([np.linalg.norm(u, axis=1).max() for u in blocks["displacements"]])
    if body.name != "arch":
        return Table(len(space.nodes), float(largest[-1])), spent
    forces = np.array([-np.sum(f, axis=0)[2] for f in blocks["forces"]])
    top = int(np.argmax(forces[:-1] > forces[1:]))
    # Top of the parabola through three points; and where it carries the load again
    around = slice(top - 1, top + 2)
    fit = np.polynomial.Polynomial.fit(largest[around], forces[around], 2)
    (at,) = fit.deriv().roots()
    after = slice(int(np.argmin(forces[top:])) + top, None)
    rest = float(np.interp(ARCH_LOAD, forces[after], largest[after]))
    return Table(len(space.nodes), rest, float(fit(at))), spent


def _run(command: list[str], folder: Path) -> tuple[str, float]:
    """Output of a process and its CPU seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        raise RuntimeError(f"{command[0]} ended with {done.returncode}: {done.stderr[-500:]}")
    return done.stdout, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


if __name__ == "__main__":
    main()
