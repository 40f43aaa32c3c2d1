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
from .io import sweethome3d
from .io.outputs import check_file, check_folder
from .native.child import Progress

if TYPE_CHECKING:
    from ..predictors.asset import Asset
    from ..predictors.evaluation.evaluate import Seen
    from ..predictors.training.config import TrainingConfig

log = logging.getLogger(__name__)

TEXT, TRAINING, VALIDATION = "text.safetensors", "real.safetensors", "validation.safetensors"
WEIGHTS = "film.safetensors"
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
    from ..predictors.training.presets import device_text_table

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
    from ..predictors.language.part_names import spoken
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
    from .report.tracer import Surface

    hues = np.random.default_rng(3).uniform(0.25, 0.95, (MAX_PARTS, 3))
    panels = []
    for label, title in zip(labels, titles, strict=True):
        shell = voxel_shell(label != EMPTY, Grid(np.zeros(3), 1 / _SHOWN_CELLS, label.shape))
        colours = hues[label[tuple(shell.cell.T)]]
        corners = np.repeat(colours[:, None], 3, axis=1)
        panels.append(Panel((Surface(shell.points, shell.faces, corners),), title))
    render_png(output, panels)


def train(
    config: Path | str, *, data: Path, output: Path, start: Path | None = None
) -> dict[str, Any]:
    """Train a network as a TOML file says (or a preset), or go on where it stopped.

    Started by ``torchrun`` it trains on several GPUs. ``output`` holds the whole state, so that the
    same command continues an interrupted run, and the weights at the end; ``start`` are weights to
    begin with.
    """
    from ..predictors.film.checkpoint import save_checkpoint
    from ..predictors.training.trainer import train as run

    options = _config(config)
    check_folder(output)
    real = data / TRAINING
    if not real.is_file():
        real = None
        options = replace(options, mixture=replace(options.mixture, real=0.0))
    trained = run(options, text=data / TEXT, real=real, start=start, resume=output)
    save_checkpoint(output / WEIGHTS, trained.network, facts={"steps": trained.steps})
    return {"files": [output / WEIGHTS], "steps": trained.steps, "history": trained.history}


def _config(config: Path | str) -> TrainingConfig:
    """Return the preset of that name, or what the TOML file says."""
    from ..predictors.training.config import TrainingConfig
    from ..predictors.training.presets import PRESETS

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

    ``encoder`` looks at the objects of the validation split, and ``memory`` is the folder of what
    it saw before; ``renders`` objects are put under load. ``progress`` gets (stage, seconds).
    """
    from ..predictors.evaluation import evaluate as evaluation
    from ..predictors.evaluation import folder_evaluation

    if encoder and (split != "validation" or data):
        raise UsageError("--encoder looks at furniture: wanted --split validation, without --data")
    if split not in ("procedural", "validation"):
        if renders:
            raise UsageError("--renders wants --split procedural or validation")
        rows, masses = folder_evaluation.evaluate_folder(
            Path(split), predictors or folder_evaluation.PREDICTORS, weights=weights
        )
        return {
            "rows": [row.to_dict() for row in rows],
            "masses": {name: errors._asdict() for name, errors in masses.items()},
            "papers": {"mse": PAPER, "mass": PAPER_MASS},
        }
    held: dict[str, Any] = {}
    if split == "validation":
        kept = data / VALIDATION if data else None
        if kept:
            held["real"] = load_real(kept)
        else:
            held = _seen_furniture(objects, encoder, cells=cells, memory=memory, tell=progress)
    rows = evaluation.evaluate(
        "validation" if split == "validation" else "procedural",
        predictors or ("film", *evaluation.BASELINES),
        objects=objects, cells=cells, seed=seed, texts=texts, weights=weights, renders=renders,
        progress=progress, **held,
    )  # fmt: skip
    return {"rows": [row.to_dict() for row in rows], "papers": {"mse": PAPER}}


def _seen_furniture(
    count: int, encoder: str | None, *, cells: int, memory: Path | None, tell: Progress | None
) -> dict[str, Any]:
    """Furniture for validation, and what an encoder sees of it: arguments of the evaluation."""
    from ..predictors.encoders import speaking_encoder
    from .image_features import sight

    looker = speaking_encoder(encoder) if encoder else None
    real: list[RealObject] = []
    seen: list[Seen | None] = []
    began = time.monotonic()
    for voxels, asset in islice(_furniture(sweethome3d.VALIDATION), count):
        if tell:
            tell(f"object {len(real) + 1}, {voxels.name}", time.monotonic() - began)
        real.append(voxels)
        if looker:
            seen.append(sight(asset, voxels, looker, cells=cells, memory=memory))
    return {"real": real, "seen": seen, "words": looker}
