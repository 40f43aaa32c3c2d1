"""How far the displacement of a real mesh is from that of a refined one, beside what we say of it.

    python benchmarks/mesh_error.py --json

The pieces of ``real_meshes.py`` and the demo, each under its own weight on its clamped base.
Refined: every tet in eight, the same shape and the same held faces, quadratic tets again. ``error``
is the difference of the quadratic answers, doubled: at a sharp inner corner errors halve with the
edges, so that the rest of the series is as much again. Beside it what a user's run computes: the
``estimate``, by what cubic tets would add, and the number ``said``. ``kept`` of ``meshes`` are
within what is said; ``effectivity`` are the least and the largest ratio of estimate and error,
where that is above a thousandth.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from functools import partial
from pathlib import Path

os.environ.update({f"{name}_NUM_THREADS": "1" for name in ("OMP", "MKL", "OPENBLAS", "NUMEXPR")})

import numpy as np
from real_meshes import NAMES, cache_folder, demo_mesh, real_mesh

# Rest of a geometric series of halved errors: what is missing is twice the first difference.
REST = 2.0
# Children of a quadratic tet: its corners, and the octahedron within, cut along one diagonal.
CHILDREN = [
    [0, 4, 6, 7], [4, 1, 5, 8], [6, 5, 2, 9], [7, 8, 9, 3],
    [4, 6, 7, 8], [4, 5, 6, 8], [6, 7, 8, 9], [5, 6, 9, 8],
]  # fmt: skip


def refined(mesh):
    """Every tet in eight, of the same material: same shape, half the edges."""
    from autophyx_tet.fem.elements.space import make_space
    from autophyx_tet.fem.material import ElementMaterial
    from autophyx_tet.fem.mesh import TetMesh

    space = make_space(mesh, 2)
    tets = space.elements[:, CHILDREN].reshape(-1, 4)
    values = (np.repeat(getattr(mesh.material, name), 8) for name in ("E", "nu", "rho"))
    material = ElementMaterial(*values)
    region = np.repeat(mesh.region, 8)
    fine = TetMesh.oriented(
        space.nodes, tets, region, region_names=mesh.region_names, material=material
    )
    return fine, space


def measure(path: Path) -> dict:
    from autophyx_tet.converters.mesh.meshdata import read_mesh
    from autophyx_tet.fem.elements.assembly import node_supports
    from autophyx_tet.fem.scenarios import Sag
    from autophyx_tet.fem.scene.supports import Supports
    from autophyx_tet.fem.solve.error import find_discretisation_error
    from autophyx_tet.fem.solve.statics import solve_static
    from autophyx_tet.toolkit.asset.document import Sidecar

    start, mesh, sidecar = time.process_time(), read_mesh(path), Sidecar.read(path)
    scene = Sag().scene(mesh, up=sidecar.up if sidecar else "z")
    known = {"gravity_vector": scene.gravity_vector, "traction": ()}
    solve = partial(solve_static, mesh, scene.held, **known)
    coarse = solve(order=2)
    found = find_discretisation_error(coarse, scene.held, solve, **known).relative
    fine, space = refined(mesh)
    held = node_supports(scene.held, space)
    supports = Supports(held.fixed, held.values, held.springs)
    reference = largest(solve_static(fine, supports, order=2, **known).displacement)
    return {
        "mesh": path.stem,
        "tets": len(mesh.tets),
        "estimate": found.value,
        "said": found.bound,
        "error": REST * abs(largest(coarse.displacement) - reference) / reference,
        "cpu_s": time.process_time() - start,
    }


def largest(u: np.ndarray) -> float:
    return float(np.linalg.norm(u, axis=1).max())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cache", type=Path, default=cache_folder(), help="folder of real meshes")
    parser.add_argument("--names", default=",".join(NAMES))
    parser.add_argument("--largest", type=int, default=9_000, help="tets of a mesh to refine")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    paths = [demo_mesh(options.cache)]
    paths += [real_mesh(name, options.cache) for name in options.names.split(",")]
    rows = []
    for path in sorted(paths, key=lambda p: p.stat().st_size):
        if path.stat().st_size > 140 * options.largest:  # bytes of a tet in the file
            continue
        rows.append(measure(path))
        print(rows[-1], file=sys.stderr, flush=True)
    ratio = [row["estimate"] / row["error"] for row in rows if row["error"] > 1e-3]
    kept = sum(row["error"] <= row["said"] for row in rows)
    ends = [min(ratio), max(ratio)]
    result = {"schema": 2, "effectivity": ends, "kept": kept, "meshes": len(rows), "rows": rows}
    print(json.dumps(result) if options.json else result)


if __name__ == "__main__":
    main()
