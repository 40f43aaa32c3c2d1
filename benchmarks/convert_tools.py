"""What ``convert_corpus.py`` runs in its processes: our conversion, peers, measuring of either."""

from __future__ import annotations

import argparse
import json
import resource
import sys
import tempfile
from math import ceil
from pathlib import Path

import numpy as np
from convert_table import OURS


def run_tool(args: argparse.Namespace) -> None:
    """One tool on one input; the exit code is its verdict."""
    tool, path, out = args.one[0], Path(args.one[1]), Path(args.one[2])
    if tool == OURS:
        _ours(path, out, args)
    elif tool == "measure":
        _measure(path, out, args)
    else:
        # The time limit of ours, in seconds of the processor too
        seconds = ceil(args.time_limit)
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))
        points, tets = PEERS[tool](path, args)
        if not len(tets):
            sys.exit("no tets and no error")
        np.savez(out / "mesh.npz", points=points, tets=tets)


def _ours(path: Path, out: Path, args: argparse.Namespace) -> None:
    from autophyx_tet.fem.errors import AutophyxError
    from autophyx_tet.fem.note import Note, severity_of
    from autophyx_tet.toolkit.asset.load import load_asset
    from autophyx_tet.toolkit.meshing.convert import tetrahedralize

    try:
        asset = load_asset(path)
        mesh, report = tetrahedralize(
            asset,
            edge_length_rel=args.edge_length_rel,
            epsilon_rel=args.epsilon_rel,
            stop_energy=args.stop_energy,
            time_limit=args.time_limit,
        )
    except AutophyxError as error:
        row = {"guarantees": False, "tets": 0, "reason": str(error)}
        (out / "row.json").write_text(json.dumps(row))
        sys.exit(error.exit_code)
    # As `convert` tells it; that verb's own imports are no part of the conversion
    pieces = report.quality.components
    apart = [Note("messages.apart", pieces=pieces)] if pieces > 1 else []
    told = [*asset.warnings, *report.warnings, *apart]
    shown = [line for line in told if severity_of(line) != "detail"]  # lines in the terminal
    row = {
        "guarantees": report.ok and report.mesher != "particles",  # no mesh of the surface
        "tets": len(mesh.tets),
        "epsilon_rel": report.epsilon / report.diagonal,  # a coarser attempt keeps a wider one
        "min_dihedral_deg": round(report.quality.dihedral_min, 2),
        "hausdorff_to_rel": report.distances.to_input / report.diagonal,
        "hausdorff_from_rel": report.distances.from_input / report.diagonal,
        "lost_volume": report.losses.lost,  # of the file as read, as the next two
        "lost_area": report.losses.lost_area,
        "gained_volume": report.losses.gained,
        "capped_volume": report.losses.capped,  # inside only since holes were closed
        "thin_volume": report.losses.thin,  # left out by name
        "mesher": report.mesher,  # a lattice promises volume and angles, no distance
        "attempts": len(report.attempts),
        "warnings": sum(severity_of(line) != "note" for line in shown),
        "told": shown,
        "volume_off": mesh.volume / report.input_volume - 1,
        "reason": "; ".join(report.failed),
    }
    (out / "row.json").write_text(json.dumps(row))


def _measure(path: Path, out: Path, args: argparse.Namespace) -> None:
    """Hold a peer's mesh against the same guarantees."""
    from autophyx_tet.converters.npz import load_npz
    from autophyx_tet.fem.mesh import TetMesh
    from autophyx_tet.toolkit.asset.load import load_asset
    from autophyx_tet.toolkit.meshing import guarantees as conversion
    from autophyx_tet.toolkit.meshing.convert import Preparation
    from autophyx_tet.toolkit.meshing.quality import quality

    mesh = load_npz(out / "mesh.npz")
    asset = load_asset(path)
    diagonal = float(np.linalg.norm(asset.size))
    epsilon = args.epsilon_rel * diagonal
    rng = np.random.default_rng(0)
    thinnest = conversion.ENVELOPE_SHARE * epsilon
    way = Preparation.of(asset, thinnest=thinnest, thicken=None, walls={})
    ready = way.prepared(epsilon=epsilon, rng=rng)
    volume = conversion.input_volume(ready.solids, len(asset.parts), rng=rng)
    body = TetMesh.oriented(mesh["points"], mesh["tets"])
    # The bodies are centred as ours are; distances are taken from all triangles as read.
    body = TetMesh(body.points - asset.bounds.mean(axis=0), body.tets, body.region)
    gaps = conversion.measure_distances(
        body, ready.solids, epsilon=epsilon, rng=rng, reference=ready.reference
    )
    measured = quality(body)
    kept = conversion.guarantees(body, measured, volume, gaps, epsilon)
    lost = conversion.Guarantee(conversion.LEFT_OUT, ready.losses.lost, conversion.MOST_LOST)
    kept = (*kept, lost)
    row = {
        "guarantees": all(g.ok for g in kept),
        "tets": len(body.tets),
        "min_dihedral_deg": round(measured.dihedral_min, 2),
        "hausdorff_to_rel": gaps.to_input / diagonal,
        "hausdorff_from_rel": gaps.from_input / diagonal,
        "lost_volume": ready.losses.lost,
        "volume_off": body.volume / volume.total - 1,
        "reason": "; ".join(
            f"{g.name}: {g.value:.3g} > {g.threshold:.3g}" for g in kept if not g.ok
        ),
    }
    (out / "row.json").write_text(json.dumps(row))


def _surface(path: Path):
    import trimesh

    mesh = trimesh.load(path, force="mesh")
    return np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int32)


def _pytetwild(path: Path, args: argparse.Namespace):
    import pytetwild
    from autophyx_tet.toolkit.meshing.guarantees import ENVELOPE_SHARE

    return pytetwild.tetrahedralize(
        *_surface(path),
        edge_length_fac=args.edge_length_rel,
        epsilon=ENVELOPE_SHARE * args.epsilon_rel,
        stop_energy=args.stop_energy,
        vtk_ordering=True,
    )


def _tetgen(path: Path, args: argparse.Namespace):
    import tetgen

    points, faces = _surface(path)
    edge = args.edge_length_rel * float(np.linalg.norm(np.ptp(points, axis=0)))
    generator = tetgen.TetGen(points, faces)
    made = generator.tetrahedralize(order=1, mindihedral=10, minratio=1.5, maxvolume=edge**3 / 6)
    return made[0], made[1]


def _gmsh(path: Path, args: argparse.Namespace):
    import gmsh

    points, _ = _surface(path)
    with tempfile.NamedTemporaryFile(suffix=".stl") as file:
        import trimesh

        trimesh.load(path, force="mesh").export(file.name, file_type="stl_ascii")
        gmsh.initialize()
        gmsh.option.setNumber("General.Terminal", 0)
        edge = args.edge_length_rel * float(np.linalg.norm(np.ptp(points, axis=0)))
        gmsh.option.setNumber("Mesh.MeshSizeMax", edge)
        gmsh.merge(file.name)
        loop = gmsh.model.geo.addSurfaceLoop([tag for _, tag in gmsh.model.getEntities(2)])
        gmsh.model.geo.addVolume([loop])
        gmsh.model.geo.synchronize()
        gmsh.model.mesh.generate(3)
        tags, coordinates, _ = gmsh.model.mesh.getNodes()
        _, nodes = gmsh.model.mesh.getElementsByType(4)
    order = np.argsort(tags)
    tets = order[np.searchsorted(tags[order], nodes)].reshape(-1, 4)
    return coordinates.reshape(-1, 3), tets


PEERS = {"pytetwild": _pytetwild, "tetgen": _tetgen, "gmsh": _gmsh}
