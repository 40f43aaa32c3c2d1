"""Sag of the twelve real assets: a lattice against ever finer fTetWild meshes, quadratic elements.

    python benchmarks/lattice_sag.py --rows lattice_sag.jsonl

Every asset is of one material and stands on its ground. One JSON row an asset is appended to
``--rows``; a second run skips what is there. fTetWild's meshes become finer until the sag changes
by less than ``CONVERGED``, at most ``EDGES`` of them; the table says where they did not.
"""

from __future__ import annotations

import argparse
import json
import warnings
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from autophyx_tet.fem.errors import AutophyxError
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.scenarios import sag
from autophyx_tet.predictors.asset import Asset
from autophyx_tet.research.datasets import sweethome3d
from autophyx_tet.toolkit.asset.load import load_asset
from autophyx_tet.toolkit.meshing.convert import tetrahedralize

ASSETS = (
    "KatorLegaz/classic-lamppost", "KatorLegaz/glass-dining-table", "KatorLegaz/concrete-bench",
    "KatorLegaz/bar-stool", "BlendSwap-CC-0/littlePlant", "Scopia/chair3", "Scopia/maceta",
    "BlendSwap-CC-0/silla2", "Scopia/bed1", "KatorLegaz/cafe-chair", "Scopia/farola1",
    "BlendSwap-CC-0/oakChair",
)  # fmt: skip
EDGES = (0.05, 0.035, 0.025)  # of the diagonal
CONVERGED = 0.05  # relative change of the sag from one edge to the next
WITHIN = 0.15  # relative: a lattice agrees
WOOD = {"E": 1e10, "nu": 0.3, "rho": 600.0}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rows", type=Path, default=Path("lattice_sag.jsonl"))
    args = parser.parse_args()
    rows = [json.loads(line) for line in args.rows.open()] if args.rows.exists() else []
    items = {i.key: i for s in sweethome3d.SOURCES for i in sweethome3d.catalog(s)}
    for key in ASSETS:
        if key in {row["asset"] for row in rows}:
            continue
        with TemporaryDirectory() as work:
            path = sweethome3d.extract(items[key], Path(work))
            asset = load_asset(path, size=max(items[key].size))
            rows.append({"asset": key} | compared(asset))
        with args.rows.open("a") as out:
            out.write(json.dumps(rows[-1]) + "\n")
        print(json.dumps(rows[-1]), flush=True)
    print(table(rows))
    print(verdict(rows))


def compared(asset: Asset) -> dict:
    """Sag [m] of a lattice, and of fTetWild's meshes until they agree."""
    lattice, engine = settled(asset, mesher="stuffing"), []
    for edge in EDGES:
        engine.append(settled(asset, mesher="ftetwild", edge_length_rel=edge))
        if settles(engine):
            break
    return {"lattice": lattice, "ftetwild": engine}


def settles(engine: list[dict]) -> bool:
    """Whether the last two meshes sag alike."""
    sags = [one["sag"] for one in engine[-2:]]
    return len(sags) == 2 and None not in sags and abs(sags[0] / sags[1] - 1) < CONVERGED


def settled(asset: Asset, **options) -> dict:
    """Largest displacement [m] of an asset that stands on its ground, as one mesher makes it."""
    try:
        mesh, report = tetrahedralize(asset, **options)
        material = ElementMaterial.uniform(len(mesh.tets), **WOOD)
        result = sag(replace(mesh, material=material), up=asset.up, order=2, law="linear")
    except AutophyxError as error:
        return {"sag": None, "reason": str(error)[:200]}
    return {
        "sag": float(result.max_displacement),
        "tets": len(mesh.tets),
        "pieces": report.quality.components,
        "closed_gaps": max((share for _, share in report.closed_gaps), default=0.0),
    }


def table(rows: list[dict]) -> str:
    """Markdown: an asset a line."""
    lines = [
        "| asset | lattice: tets, sag [m] | fTetWild: tets, sag [m] | ratio |",
        "|---|---|---|---|",
    ]
    for row in rows:
        ours, *theirs = row["lattice"], *row["ftetwild"]
        told = "; ".join(_told(one) for one in theirs)
        last = theirs[-1]["sag"]
        ratio = f"{ours['sag'] / last:.2f}" if ours["sag"] and last else "-"
        lines.append(f"| {row['asset']} | {_told(ours)} | {told} | {ratio} |")
    return "\n".join(lines)


def verdict(rows: list[dict]) -> str:
    """How many lattices agree with fTetWild, and how many have nothing to agree with."""
    known = [row for row in rows if settles(row["ftetwild"])]
    sags = [(row["lattice"]["sag"], row["ftetwild"][-1]["sag"]) for row in known]
    near = sum(ours is not None and abs(ours / theirs - 1) <= WITHIN for ours, theirs in sags)
    return (
        f"{near} of {len(rows)} within {WITHIN:.0%}; of {len(rows) - len(known)} fTetWild's meshes "
        "do not settle"
    )


def _told(one: dict) -> str:
    """Tets and sag [m], and why the structure may be another: pieces, gaps that were closed."""
    if one["sag"] is None:
        return one["reason"]
    pieces, gaps = one.get("pieces", 1), one.get("closed_gaps", 0.0)
    told = f" in {pieces} pieces" if pieces > 1 else ""
    told += f", gaps closed at {gaps:.1%}" if gaps else ""
    return f"{one['tets']:,}{told}, {one['sag']:.3g}"


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main()
