"""What is told of the error of a quadratic answer, beside the error itself.

    python benchmarks/estimator.py [--json] [--kind plate]
    python benchmarks/estimator.py --refine 5 [--kind plate]
    python benchmarks/estimator.py --cost
    python benchmarks/estimator.py --references FILE [--part 0/2]   # about 10 CPU minutes

Bodies of fifteen kinds, and 96 random ones of which 72 were drawn after the estimate was fixed
(``estimator_cases.py``), at rest and ringing, by the methods of ``simulate``. *Effectivity* is an
estimate over the true error: in the norm of energy, of the largest displacement, of the forces of
the supports, of the first frequency, and of the stress around its largest (rms). It is judged where
the true error is above a ten-thousandth and known to a tenth.

References (benchmarks/data/estimator.json) are quadratic answers on meshes cut in eight twice: 64
times the tets, of the same faces, supports and loads. What further cuts would add follows from the
two before by a geometric series, whose ratio lies between that of a smooth answer, 1/16, and of the
sharpest corner, 1/2; ``doubt`` is .3 of what was added so. No cubic element is in them.

``--refine`` asks for that many percent and compares what it calls done; ``--cost`` are CPU seconds
of the estimate and of the quadratic solve, on bodies that are new to both.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from dataclasses import replace
from pathlib import Path

os.environ.update({f"{name}_NUM_THREADS": "1" for name in ("OMP", "MKL", "OPENBLAS", "NUMEXPR")})

import numpy as np
from autophyx_tet.fem.elements.assembly import discretise, node_supports
from autophyx_tet.fem.elements.elastic import displacement_gradients, linear_stress, von_mises
from autophyx_tet.fem.scene.scene import Scene
from autophyx_tet.fem.solve.error import find_discretisation_error, refine_scene
from autophyx_tet.fem.solve.mesh_error import CHILDREN, find_exponents, smooth_patch
from autophyx_tet.fem.solve.method import METHODS
from autophyx_tet.fem.solve.statics import solve_static
from estimator_cases import SEEDS, Case, bar, built_cases, random_cases, refined

DATA = Path(__file__).parent / "data" / "estimator.json"
# Effectivities that are wanted.
WANTED = {
    "energy": (0.7, 1.3),
    "displacement": (0.5, 2.0),
    "reaction": (0.5, 2.0),
    "frequency": (0.5, 2.0),
    "stress": (0.5, 2.0),
}
JUDGED, DOUBT = 1e-4, 0.1
MOST_RINGING = 110  # tets of a body whose frequency has a reference: its factor takes seconds
MODES = 4


def loads_of(scene: Scene) -> dict:
    return {
        "gravity_vector": scene.gravity_vector,
        "traction": scene.tractions,
        "forces": scene.forces,
    }


def modes_of(scene: Scene, count: int):
    """Vibrations of the body as it is held, at rest."""
    still = replace(scene.held, values=0 * scene.held.values)
    return METHODS["modal"].solve(replace(scene, supports=still, modes=count), order=2)


def answer(scene: Scene, *, ringing: bool) -> dict:
    """What the errors are of: twice the potential, displacement, forces of places, frequency."""
    rest = solve_static(scene.mesh, scene.held, order=2, **loads_of(scene))
    held = node_supports(scene.held, rest.space)
    work = float((rest.reaction * np.where(held.fixed, held.values, 0.0)).sum())
    return {
        "rest": rest,
        "potential": 2 * work - 2 * rest.energy,
        "places": np.array([np.where(p, rest.reaction, 0.0).sum(axis=0) for p in held.places]),
        "frequency": float(modes_of(scene, 1).frequencies[0]) if ringing else np.nan,
    }


def reference(case: Case) -> dict:
    """True relative errors of the quadratic answer, and how well they are known."""
    scenes = [case.scene, (once := refined(case.scene)), refined(once)]
    ringing = len(case.scene.mesh.tets) <= MOST_RINGING
    coarse, middle, fine = (answer(scene, ringing=ringing) for scene in scenes)
    steps = [a["potential"] - b["potential"] for a, b in ((coarse, middle), (middle, fine))]
    ratio = float(np.clip(steps[1] / steps[0], 1 / 16, 1 / 2))
    rest, left = coarse["rest"], ratio / (1 - ratio)
    beyond = steps[1] * left
    true = {"energy": float(np.sqrt((sum(steps) + beyond) / (2 * rest.energy)))}
    doubt = {"energy": 0.3 * beyond / (sum(steps) + beyond)}

    def note(name: str, change: np.ndarray, last: np.ndarray, size: float) -> None:
        full = float(np.linalg.norm(change + left * last))
        more = float(np.linalg.norm(left * last))
        true[name], doubt[name] = full / size, 0.3 * more / full if full else np.inf

    sizes = np.linalg.norm(rest.node_displacement, axis=1)
    node, held = int(sizes.argmax()), node_supports(case.scene.held, rest.space)
    if not (held.fixed[node].any() and held.values[node].any()):
        answers = (coarse, middle, fine)
        at = [np.array([np.linalg.norm(a["rest"].node_displacement[node])]) for a in answers]
        note("displacement", at[2] - at[0], at[2] - at[1], float(sizes.max()))
    if len(held.places) > 1:
        size = np.linalg.norm(coarse["places"], axis=1)
        change, last = fine["places"] - coarse["places"], fine["places"] - middle["places"]
        off = np.linalg.norm(change + left * last, axis=1) / size
        worst = int(np.where(size > 0.01 * size.max(), off, 0).argmax())
        note("reaction", change[worst], last[worst], size[worst])
    if ringing:
        f = np.array([[a["frequency"]] for a in (coarse, middle, fine)])
        note("frequency", f[2] - f[0], f[2] - f[1], f[0, 0])
    exponents = find_exponents(rest.mesh, rest.space, held.fixed, case.scene.forces)
    if (patch := smooth_patch(rest, exponents)) is not None:
        around, top = patch
        H = displacement_gradients(discretise(rest.mesh, 2), rest.node_displacement, CHILDREN)
        here = linear_stress(H, rest.mesh.material)
        shape = (len(here), 8, -1, 3, 3)  # means over the children of every tet
        first, second = (a["rest"].stress.reshape(shape).mean(axis=2) for a in (middle, fine))
        change, last = (second - here)[around], (second - first)[around]
        full = float(np.sqrt((von_mises(change + left * last) ** 2).mean()))
        true["stress"] = full / float(von_mises(here[top]).max())
        doubt["stress"] = 0.3 * left * float(np.sqrt((von_mises(last) ** 2).mean())) / full
    return {"tets": len(rest.mesh.tets), "true": true, "doubt": doubt}


def effectivities(case: Case, known: dict) -> dict:
    """What ``simulate`` tells over the true errors of ``known``, where these are judged."""
    error = METHODS["statics"].solve(case.scene, law="linear").discretisation_error
    told = {"displacement": error.value}
    told |= {name: getattr(error, name) for name in ("energy", "reaction", "stress")}
    true, doubt = known["true"], known["doubt"]
    if "frequency" in true:
        told["frequency"] = modes_of(case.scene, MODES).error
    row = {"case": case.name, "kind": case.kind, "singular": sorted({p.kind for p in error.places})}
    judged = [n for n in WANTED if true.get(n, 0) > JUDGED and doubt[n] < DOUBT]
    return row | {name: float(told[name] / true[name]) for name in judged}


def refinement(case: Case, known: dict, goal: float) -> dict:
    """True error of the displacement that ``--refine`` leaves, and whether it calls that done."""
    coarse = solve_static(case.scene.mesh, case.scene.held, order=2, **loads_of(case.scene))
    done = refine_scene(case.scene, goal)
    fine = solve_static(done.scene.mesh, done.scene.held, order=2, **loads_of(done.scene))
    sizes = np.linalg.norm(coarse.node_displacement, axis=1)
    node = int(sizes.argmax())
    there = np.linalg.norm(fine.space.nodes - coarse.space.nodes[node], axis=1).argmin()
    size = float(np.linalg.norm(fine.node_displacement[there]))
    exact = sizes[node] * (1 + np.sign(size - sizes[node]) * known["true"]["displacement"])
    if size == sizes[node]:
        exact = sizes[node] * (1 + known["true"]["displacement"])
    tets = [len(one.mesh.tets) for one in (coarse, fine)]
    error = abs(size / exact - 1)
    return {
        "case": case.name,
        "done": not done.why,
        "told": done.error,
        "error": error,
        "tets": tets,
    }


def cost() -> list[dict]:
    """CPU seconds of the solve and of the estimate."""
    rows = []
    bars = [((5, 1, 1), (5 * k, k, k)) for k in (6, 8, 10)]
    for shape, cells in [*bars, ((1, 1, 0.03), (40, 40, 1)), ((1, 1, 1), (11, 11, 11))]:
        for turn in range(2):  # the first loads the kernels
            scene = bar("cost", "", shape, cells if turn else (4, 2, 1), load="gravity").scene
            start = time.process_time()
            rest = solve_static(scene.mesh, scene.held, order=2, **loads_of(scene))
            middle = time.process_time()
            find_discretisation_error(rest, scene.held, solve_static, **loads_of(scene))
            solve, estimate = middle - start, time.process_time() - middle
        row = {"tets": len(scene.mesh.tets), "solve": solve, "estimate": estimate}
        rows.append(row | {"share": estimate / solve})
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--references", type=Path, help="make them, into a file")
    parser.add_argument("--part", default="0/1", help="K/N: every N-th case from the K-th")
    parser.add_argument("--kind", default="")
    parser.add_argument("--refine", type=float, help="percent that are asked for")
    parser.add_argument("--cost", action="store_true", help="CPU seconds alone")
    parser.add_argument("--json", action="store_true", help="every case too")
    options = parser.parse_args()
    if options.cost:
        return print(json.dumps(cost(), indent=1))
    first, every = map(int, options.part.split("/"))
    cases = [*built_cases(), *(case for kind in SEEDS for case in random_cases(kind))]
    cases = [case for case in cases if options.kind in case.kind][first::every]
    file = options.references or DATA
    known = json.loads(file.read_text()) if file.exists() else {}
    rows = []
    for case in cases:
        if options.references:
            if case.name not in known:
                known[case.name] = reference(case)
                file.write_text(json.dumps(known, indent=0) + "\n")
        elif options.refine is None:
            rows.append(effectivities(case, known[case.name]))
        elif known[case.name]["doubt"].get("displacement", 1.0) < DOUBT:
            rows.append(refinement(case, known[case.name], options.refine / 100))
        if rows:
            print(rows[-1], file=sys.stderr, flush=True)
    if options.references:
        return None
    if options.refine is not None:
        done = [row for row in rows if row["done"]]
        kept = sum(row["error"] <= options.refine / 100 for row in done)
        summary = {"cases": len(rows), "done": len(done), "kept": int(kept)}
    else:
        summary = {}
        for name, (low, high) in WANTED.items():
            ratio = np.array([row[name] for row in rows if name in row])
            summary[name] = {
                "cases": len(ratio),
                "within": float(((ratio >= low) & (ratio <= high)).mean()),
                "least": float(ratio.min()),
                "median": float(np.median(ratio)),
                "most": float(ratio.max()),
            }
    print(json.dumps({"schema": 1, "summary": summary} | ({"rows": rows} if options.json else {})))


if __name__ == "__main__":
    main()
