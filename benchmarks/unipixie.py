"""How the network of ranges does on procedural objects, and the calibration that ships with it.

``python benchmarks/unipixie.py`` prints, for seen and unseen categories and for evidence from exact
words to noise: errors at alpha 0, .5 and 1, classes, order, how often ranges and intervals hold as
at run time, with the calibration of the weights, and what it would have to be (margin, spread).
``--write`` fits margin and spread on objects of one seed and puts them into the weights; the table
is of objects of another.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict, replace
from pathlib import Path

from autophyx_tet.predictors.encoders.minilm import MiniLM
from autophyx_tet.predictors.unipixie.predictor import WEIGHTS, RangeCalibration, load_unipixie
from autophyx_tet.research.datasets.ranges import RangeTable, build_range_table
from autophyx_tet.research.training.unipixie.config import BARE_WORDS, EvidenceShares, MatterConfig
from autophyx_tet.research.training.unipixie.names_on_device import Names
from autophyx_tet.research.training.unipixie.range_scores import RangeScores, range_scores
from autophyx_tet.research.training.unipixie.recipe import new_objects_sampler, save_unipixie

EVIDENCE = {
    "words": BARE_WORDS,
    "seen": EvidenceShares(exact=0, silent=0, swapped=0),
    "mixed": EvidenceShares(),
}
FITTED, TESTED = 3, 4  # seeds of the objects
VOXELS = 128  # of each object: parts are of one matter


def main() -> None:
    """Score, and write the calibration if asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ranges", type=Path, help="table of ranges; written anew by default")
    parser.add_argument("--weights", type=Path, default=WEIGHTS)
    parser.add_argument("--objects", type=int, default=96)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    table = RangeTable.load(given.ranges) if given.ranges else build_range_table(MiniLM().text)
    names, loaded = Names(table, "cpu"), load_unipixie(given.weights)
    config = MatterConfig(device="cpu", voxels=VOXELS, network=loaded.network.config)

    def scored(split: str, evidence: str, seed: int, calibration: RangeCalibration) -> RangeScores:
        drawn = replace(config, evidence=EVIDENCE[evidence])
        sampler = new_objects_sampler(names, drawn, given.objects, seed, held_out=split == "unseen")
        return range_scores(loaded.network, sampler, objects=given.objects, calibration=calibration)

    calibration = loaded.calibration
    if given.write:
        fitted = scored("seen", "mixed", FITTED, RangeCalibration())
        calibration = RangeCalibration(round(fitted.margin, 3), round(max(fitted.spread, 1.0), 2))
        normalisation = loaded.normalisation
        save_unipixie(
            given.weights, loaded.network, normalisation=normalisation, calibration=calibration
        )
        print(f"written: {calibration}")
    rows = {
        f"{split} {evidence}": scored(split, evidence, TESTED, calibration)
        for split in ("seen", "unseen")
        for evidence in EVIDENCE
    }
    if given.json:
        print(json.dumps({name: asdict(row) for name, row in rows.items()}))
        return
    heads = "mse at 0    .5     1    class  order  holds  margin  80 %  spread"
    print(f"{'categories, evidence':22} {heads}")
    for name, row in rows.items():
        errors = " ".join(f"{sum(each) / 3:.4f}" for each in row.mse.values())
        print(
            f"{name:22} {errors}  {row.right:.3f}  {row.monotone:.3f}  {row.covered:.3f}  "
            f"{row.margin:.3f}  {row.in_interval:.2f}  {row.spread:.2f}"
        )


if __name__ == "__main__":
    main()
