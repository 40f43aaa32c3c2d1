"""The verbs about learning: `dataset build`, `dataset show`, `train` and `evaluate`."""

from __future__ import annotations

import logging
import tempfile
import time
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..fem.errors import AutophyxError, InputError, UsageError
from ..predictors.datasets.real import RealObject, load_real, save_real, voxelise
from ..predictors.encoders import speaking_encoder
from .io import sweethome3d
from .io.outputs import check_file, check_folder
from .native.child import Progress

if TYPE_CHECKING:
    from ..predictors.asset import Asset
    from ..predictors.encoders import Encoder
    from ..predictors.evaluation.held_out import HeldOutSet, ImageFeatures
    from ..predictors.training.film.config import TrainingConfig

log = logging.getLogger(__name__)

TEXT, TRAINING, VALIDATION = "text.safetensors", "real.safetensors", "validation.safetensors"
RANGES = "ranges.safetensors"
WEIGHTS, RANGE_WEIGHTS = "film.safetensors", "unipixie.safetensors"
# AutoPhyX table 1, on a data set that is not published: beside our numbers, not among them.
PAPER = {"AutoPhyX (OpenCLIP), its own data": (0.042, 0.051, 0.083)}
PAPER_MASS = {"AutoPhyX, ABO-500": (0.652, 9.433, 0.901, 0.582)}
_SHOWN_CELLS = 48


def build_dataset(
    output: Path, *, per_part: int = 300, seed: int = 0, device: str = "cpu", real: bool = True
) -> dict[str, Any]:
    """Write the clauses of training, and real objects for training and for validation.

    Parameters
    ----------
    output
        Folder to write into.
    per_part
        Clauses written for every kind of part; the shipped network heard 3,600.
    device
        Where sentences are embedded: "cpu", or "cuda" for a corpus of many thousands.
    real
        Whether to voxelise the furniture of Debian's sweethome3d-furniture too.
    """
    from ..predictors.datasets.text_table import save_text_table
    from ..predictors.training.film.presets import device_text_table

    check_folder(output)
    output.mkdir(parents=True, exist_ok=True)
    training = [voxels for voxels, _ in _furniture(sweethome3d.TRAINING)] if real else []
    files = []
    if real:
        validation = [voxels for voxels, _ in _furniture(sweethome3d.VALIDATION)]
        for name, objects in ((TRAINING, training), (VALIDATION, validation)):
            save_real(output / name, objects)
            files.append(output / name)
    table = device_text_table(per_part=per_part, seed=seed, device=device, real=training)
    save_text_table(output / TEXT, table)
    return {
        "files": [*files, output / TEXT],
        "clauses": len(table.texts),
        "real_objects": len(training),
    }


def build_ranges(output: Path, *, seed: int = 0, device: str = "cpu") -> dict[str, Any]:
    """Write the names of things and the ranges of what they may be made of: for ``unipixie``."""
    from ..predictors.datasets.ranges import build_range_table
    from ..predictors.encoders.minilm import MiniLM

    check_folder(output)
    output.mkdir(parents=True, exist_ok=True)
    table = build_range_table(MiniLM(device=device).text, seed=seed)
    table.save(output / RANGES)
    return {"files": [output / RANGES], "names": len(table.kind), "rows": len(table.low)}


def _furniture(sources: Sequence[sweethome3d.Source]) -> Iterator[tuple[RealObject, Asset]]:
    """Voxelise the objects that have a slot of known material; others are counted."""
    from .io.load import load_asset

    for source in sources:
        items, kept = sweethome3d.catalog(source), 0
        for item in items:
            with tempfile.TemporaryDirectory() as folder:
                try:
                    asset = load_asset(sweethome3d.extract(item, Path(folder)))
                    found = voxelise(asset, item.name, source)
                except AutophyxError as error:
                    log.warning("%s left out: %s", item.key, error)
                    continue
            if any(found.materials()):
                kept += 1
                yield found, asset
        log.info("%s: %d of %d objects have a known material", source, kept, len(items))


def show_dataset(output: Path, *, count: int = 6, seed: int = 0) -> dict[str, Any]:
    """Draw procedural objects, each part in a colour of its own; return what was said of them."""
    from ..predictors.datasets.grammar import Grammar
    from ..predictors.datasets.objects import category_names, make_objects
    from ..predictors.hearing.part_names import spoken
    from ..predictors.training.stores import procedural_store

    check_file(output, (".png",))
    rng = np.random.default_rng(seed)
    objects = make_objects(count, rng)
    store = procedural_store(objects, cells=_SHOWN_CELLS, device="cpu")
    grammar, names = Grammar(rng), category_names()
    samples = []
    for kinds, category in zip(objects.kinds, objects.category, strict=True):
        said = [grammar.part(int(kind)).text for kind in kinds if kind >= 0]
        samples.append({"object": spoken(names[category]), "clauses": said})
    _draw(output, store.label.numpy(), [sample["object"] for sample in samples])
    return {"files": [output], "samples": samples}


def _draw(output: Path, labels: np.ndarray, titles: Sequence[str]) -> None:
    from ..predictors.datasets.shapes import EMPTY, MAX_PARTS
    from ..predictors.grid import Grid
    from .report.feature_picture import voxel_shell
    from .report.picture import Panel, render_png
    from .report.tracer import ColouredSurface

    hues = np.random.default_rng(3).uniform(0.25, 0.95, (MAX_PARTS, 3))
    panels = []
    for label, title in zip(labels, titles, strict=True):
        shell = voxel_shell(label != EMPTY, Grid(np.zeros(3), 1 / _SHOWN_CELLS, label.shape))
        colours = hues[label[tuple(shell.cell.T)]]
        corners = np.repeat(colours[:, None], 3, axis=1)
        panels.append(Panel((ColouredSurface(shell.points, shell.faces, corners),), title))
    render_png(output, panels)


def train(
    config: Path | str, *, data: Path, output: Path, start: Path | None = None
) -> dict[str, Any]:
    """Train a network as a TOML file says (or a preset), or go on where it stopped.

    Started by ``torchrun`` it trains on several GPUs. ``output`` holds the whole state, so that the
    same command continues an interrupted run, and the weights at the end; ``start`` are weights to
    begin with.
    """
    from ..predictors.training.film.recipe import train_film
    from ..predictors.training.unipixie.config import PRESETS as RANGE_PRESETS
    from ..predictors.training.unipixie.recipe import train_matter

    check_folder(output)
    real = data / TRAINING
    if str(config) in RANGE_PRESETS:
        weights, ranges = output / RANGE_WEIGHTS, data / RANGES
        trained = train_matter(
            RANGE_PRESETS[str(config)], ranges=ranges, real=real if real.is_file() else None,
            resume=output, output=weights,
        )  # fmt: skip
        return {"files": [weights], "steps": trained.steps, "history": trained.history}
    options = _config(config)
    if not real.is_file():
        real = None
        options = replace(options, mixture=replace(options.mixture, real=0.0))
    weights = output / WEIGHTS
    trained = train_film(
        options, text=data / TEXT, real=real, start=start, resume=output, output=weights
    )
    return {"files": [weights], "steps": trained.steps, "history": trained.history}


def _config(config: Path | str) -> TrainingConfig:
    """Return the preset of that name, or what the TOML file says."""
    from ..predictors.training.film.config import TrainingConfig
    from ..predictors.training.film.presets import PRESETS

    if str(config) in PRESETS:
        return PRESETS[str(config)]
    try:
        return TrainingConfig.from_dict(tomllib.loads(Path(config).read_text()))
    except (OSError, tomllib.TOMLDecodeError) as error:
        presets = ", ".join(PRESETS)
        raise InputError(
            f"cannot read the training config {config}: {error}; presets are {presets}"
        ) from error


def evaluate(
    split: str,
    *,
    predictors: Sequence[str] = (),
    data: Path | None = None,
    weights: Path | None = None,
    objects: int = 64,
    cells: int = 64,
    seed: int = 0,
    texts: int = 1,
    encoder: str | None = None,
    renders: int = 0,
    memory: Path | None = None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Score predictors on "procedural" or "validation" objects, or on a folder of examples.

    Parameters
    ----------
    split
        "procedural", "validation" (real furniture), or a folder of objects with texts and values.
    predictors
        Rows of the table; those of the split by default.
    data
        Folder that ``build_dataset`` wrote; without it the furniture is fetched.
    weights
        Checkpoint of the network; the shipped one by default.
    objects, cells, seed, texts
        How many objects, on how fine a grid, drawn how; how often something is said of each.
    encoder, memory
        Image encoder that looks at the furniture, and the folder of what it saw before.
    renders
        How many objects are put under load.
    progress
        Called with the stage and the seconds so far.
    """
    from ..predictors.evaluation.held_out import HeldOutSet
    from ..predictors.evaluation.held_out_evaluation import evaluate_held_out
    from ..predictors.evaluation.rows import DEFAULT_ROWS

    if encoder and (split != "validation" or data):
        raise UsageError("--encoder looks at furniture: wanted --split validation, without --data")
    if split not in ("procedural", "validation"):
        if renders:
            raise UsageError("--renders wants --split procedural or validation")
        return _evaluate_folder(Path(split), predictors, weights)
    words = speaking_encoder(encoder) if encoder else None
    held_out = HeldOutSet("procedural", objects, cells, seed, texts)
    if split == "validation":
        held_out = replace(held_out, split="validation")
        if data:
            held_out = replace(held_out, real=load_real(data / VALIDATION))
        else:
            held_out = with_furniture(held_out, words, memory=memory, tell=progress)
    rows = evaluate_held_out(
        held_out, predictors or DEFAULT_ROWS, weights=weights, words=words, renders=renders,
        progress=progress,
    )  # fmt: skip
    return {"rows": [row.to_dict() for row in rows], "papers": {"mse": PAPER}}


def _evaluate_folder(
    folder: Path, predictors: Sequence[str], weights: Path | None
) -> dict[str, Any]:
    """Score predictors on objects of anyone's, and their masses."""
    from ..predictors.evaluation.folder_evaluation import FOLDER_ROWS, evaluate_folder

    rows, masses = evaluate_folder(folder, predictors or FOLDER_ROWS, weights=weights)
    return {
        "rows": [row.to_dict() for row in rows],
        "masses": {name: errors._asdict() for name, errors in masses.items()},
        "papers": {"mse": PAPER, "mass": PAPER_MASS},
    }


def with_furniture(
    held_out: HeldOutSet,
    encoder: Encoder | None = None,
    *,
    memory: Path | None = None,
    tell: Progress | None = None,
) -> HeldOutSet:
    """Return the set with furniture of the validation source, and what an encoder sees of it."""
    from .image_features import cached_image_features

    real: list[RealObject] = []
    features: list[ImageFeatures | None] = []
    began = time.monotonic()
    for voxels, asset in islice(_furniture(sweethome3d.VALIDATION), held_out.objects):
        if tell:
            tell(f"object {len(real) + 1}, {voxels.name}", time.monotonic() - began)
        real.append(voxels)
        if encoder:
            features.append(
                cached_image_features(asset, voxels, encoder, cells=held_out.cells, memory=memory)
            )
    return replace(held_out, real=real, features=features)
