"""The verbs `train` and `evaluate`."""

from __future__ import annotations

import os
import time
import tomllib
from collections.abc import Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..fem.errors import InputError, UsageError
from ..predictors.encoders import speaking_encoder
from ..toolkit.asset import path_of
from ..toolkit.asset.child import Progress
from ..toolkit.asset.document import check_folder
from .datasets import sweethome3d
from .datasets.real import RealObject, load_real
from .prepare import RANGES, REGIONS, TEXT, TRAINING, VALIDATION, furniture

if TYPE_CHECKING:
    from ..predictors.encoders import Encoder
    from .evaluation.held_out import HeldOutSet, ImageFeatures
    from .evaluation.paper.tables import TableName
    from .training.film.config import TrainingConfig

WEIGHTS, RANGE_WEIGHTS = "film.safetensors", "unipixie.safetensors"
REGION_WEIGHTS = "regions.safetensors"
KINDS, KIND_WEIGHTS = "kinds", "matter.json"  # kinds of matter by looks: seconds on any processor
PHRASES = "phrases"  # rows by words of matter: most of an hour of a processor
TAGGER = "tagger"  # words of texts by parts: minutes on a GPU, from texts that it makes
ONE_PIECE = "one-piece"  # words for parts by matters: two minutes on a GPU
# AutoPhyX table 1, on a data set that is not published: beside our numbers, not among them.
PAPER = {"AutoPhyX (OpenCLIP), its own data": (0.042, 0.051, 0.083)}
PAPER_MASS = {"AutoPhyX, ABO-500": (0.652, 9.433, 0.901, 0.582)}
FURNITURE = ("validation", "merged")
NATURAL = "natural"
_UNTIL = 10**9  # steps: time ends the run


def train(
    config: Path | str, *, data: str | Path, output: str | Path, start: str | Path | None = None
) -> dict[str, Any]:
    """Train a network as a TOML file says (or a preset), or go on where it stopped.

    "kinds" fits kinds of matter to looks of real objects, in seconds; "tagger" learns from made
    texts which words speak of which part, "one-piece" which words name what has a matter, on a GPU
    where there is one. Started by ``torchrun`` a
    network trains on several GPUs.

    Parameters
    ----------
    config
        TOML file of a training run, or the name of a preset.
    data
        Folder that ``dataset build`` wrote.
    output
        Folder of the whole state, so that the same call continues an interrupted run, and of the
        weights at the end.
    start
        Weights to begin with.

    Returns
    -------
    dict
        ``files`` of the weights, ``steps`` and ``history``.

    Raises
    ------
    InputError
        Where the config cannot be read or the folder not be written.
    """
    from .training.film.recipe import train_film
    from .training.regions.recipe import PRESETS as REGION_PRESETS
    from .training.unipixie.config import PRESETS as RANGE_PRESETS
    from .training.unipixie.recipe import train_matter

    data, output, start = path_of(data), path_of(output), path_of(start)
    check_folder(output)
    real = data / TRAINING
    if str(config) == KINDS:
        return _train_kinds(real, output)
    if str(config) == TAGGER:
        return _train_tagger(output)
    if str(config) == ONE_PIECE:
        from .training.owners import preset, train_owners

        weights = output / "one_piece.safetensors"
        trained = train_owners(preset(), output=weights, resume=output / ONE_PIECE)
        return {"files": [weights], "steps": trained.steps, "history": trained.history}
    if str(config) == PHRASES:
        from .training.phrases.recipe import train_phrases

        weights = output / "phrases.safetensors"
        history = train_phrases(output=weights).history
        return {"files": [weights], "steps": history[-1]["step"], "history": history}
    if str(config) in REGION_PRESETS:
        from .datasets.region_sets import RegionCorpus
        from .training.regions.recipe import train_regions

        corpus, weights = RegionCorpus.load(data / REGIONS), output / REGION_WEIGHTS
        output.mkdir(parents=True, exist_ok=True)
        done = train_regions(REGION_PRESETS[str(config)], corpus, resume=output, output=weights)
        steps, history = sum(one.steps for one in done), done[-1].history
        return {"files": [weights], "steps": steps, "history": history}
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


def _train_kinds(real: Path, output: Path) -> dict[str, Any]:
    """Fit kinds of matter to the looks of real slots."""
    from .training.kinds_by_looks import save_kinds, train_kinds

    found, slots = train_kinds(load_real(real))
    output.mkdir(parents=True, exist_ok=True)
    save_kinds(output / KIND_WEIGHTS, found)
    return {"files": [output / KIND_WEIGHTS], "slots": slots}


def _train_tagger(output: Path) -> dict[str, Any]:
    """Learn from made texts which words speak of which part."""
    from ..predictors.encoders.minilm import packaged_weights
    from .training.tagger.recipe import made_from, preset, train_tagger

    weights = output / "tagger.safetensors"
    options = preset()
    materials, lexicon = made_from()
    trained = train_tagger(
        options, materials=materials, lexicon=lexicon, encoder=packaged_weights(),
        output=weights, resume=output, workers=max(1, (os.cpu_count() or 2) - 1),
    )  # fmt: skip
    return {"files": [weights], "steps": trained.steps, "history": trained.history}


def _config(config: Path | str) -> TrainingConfig:
    """Return the preset of that name, or what the TOML file says."""
    from .training.film.config import TrainingConfig
    from .training.film.presets import PRESETS

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
    data: str | Path | None = None,
    weights: str | Path | None = None,
    objects: int = 64,
    cells: int = 64,
    seed: int = 0,
    texts: int = 1,
    encoder: str | None = None,
    renders: int = 0,
    swing: bool = False,
    memory: str | Path | None = None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Score predictors on objects of a split, or on a folder of examples.

    Parameters
    ----------
    split
        "procedural", or "validation" and "merged" as in ``HeldOutSet``, or "natural", sentences
        about things in one piece as ``assign`` takes them, or a folder of examples.
    predictors
        Rows of the table; those of the split by default.
    data
        Folder that ``build_dataset`` wrote, in which cells have no looks; else it is fetched.
    weights
        Checkpoint of the network; the shipped one by default.
    objects, cells, seed, texts
        How many objects, on how fine a grid, drawn how; how often something is said of each.
    encoder, memory
        Image encoder that looks at the furniture, and the folder of what it saw before.
    renders, swing
        How many objects are put under load, and whether their motions are compared, not the rest.
    progress
        Called with the stage and the seconds so far.

    Returns
    -------
    dict
        ``rows``, one a predictor, with its errors; ``papers``, those of others beside them.

    Raises
    ------
    UsageError
        Where an encoder or renders are asked for of a split that has none.
    InputError
        Where the split is no folder of examples, or weights cannot be read.
    """
    from .evaluation.held_out import HeldOutSet
    from .evaluation.held_out_evaluation import evaluate_held_out
    from .evaluation.rows import DEFAULT_ROWS

    data, weights, memory = map(path_of, (data, weights, memory))
    if split == NATURAL:
        return _evaluate_natural(objects, progress)
    if encoder and (split not in FURNITURE or data):
        raise UsageError("--encoder wants --split validation or merged, and no --data")
    if split not in ("procedural", *FURNITURE):
        if renders:
            raise UsageError("--renders wants --split procedural, validation or merged")
        return _evaluate_folder(Path(split), predictors, weights)
    words = speaking_encoder(encoder) if encoder else None
    held_out = HeldOutSet("procedural", objects, cells, seed, texts)
    if split in FURNITURE:
        held_out = replace(held_out, split=split)
        if data:
            held_out = replace(held_out, real=load_real(data / VALIDATION))
        else:
            held_out = with_furniture(held_out, words, memory=memory, tell=progress)
    rows = evaluate_held_out(
        held_out, predictors or DEFAULT_ROWS, weights=weights, words=words, renders=renders,
        swing=swing, progress=progress,
    )  # fmt: skip
    return {"rows": [row.to_dict() for row in rows], "papers": {"mse": PAPER}}


def _evaluate_natural(objects: int, progress: Progress | None) -> dict[str, Any]:
    """Score ``assign`` on the first objects of the validation source that have a sentence."""
    from .datasets.natural import naturals, one_pieces
    from .evaluation.natural import evaluate_natural

    known = naturals(sweethome3d.VALIDATION)
    keys = [*dict.fromkeys(one.key for one in known)][:objects]
    known = [one for one in known if one.key in keys]
    return evaluate_natural(known, one_pieces(known), progress=progress)


def _evaluate_folder(
    folder: Path, predictors: Sequence[str], weights: Path | None
) -> dict[str, Any]:
    """Score predictors on objects of anyone's, and their masses."""
    from .evaluation.folder_evaluation import FOLDER_ROWS, evaluate_folder

    rows, masses = evaluate_folder(folder, predictors or FOLDER_ROWS, weights=weights)
    return {
        "rows": [row.to_dict() for row in rows],
        "masses": {name: errors._asdict() for name, errors in masses.items()},
        "papers": {"mse": PAPER, "mass": PAPER_MASS},
    }


def evaluate_table(
    table: TableName,
    *,
    data: Path,
    weights: Path | None = None,
    minutes: float | None = None,
    device: str = "cpu",
    objects: int = 96,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Make one of UniPixie's tables on our objects; the paper's figures stand beside.

    Networks that it trains are on a CPU those of the preset ``unipixie-cpu``: the way is the same,
    the figures are not. ``minutes`` are each row's; by default all take the steps of the preset.
    ``weights`` are of the network that is asked as it is (S5, theta), by default the shipped one.
    """
    from ..predictors.unipixie.predictor import WEIGHTS as SHIPPED
    from .evaluation.paper.tables import TableRun, table_of
    from .training.unipixie.config import PRESETS

    base = replace(PRESETS["unipixie-cpu" if device == "cpu" else "unipixie"], device=device)
    base = base if minutes is None else replace(base, minutes=minutes, steps=_UNTIL)
    real, began = data / TRAINING, time.monotonic()
    run = TableRun(
        base=base, ranges=data / RANGES, real=real if real.is_file() else None, objects=objects,
        weights=weights or SHIPPED,
        progress=(lambda row: progress(row, time.monotonic() - began)) if progress else None,
    )  # fmt: skip
    found = table_of(table, run)
    return {"rows": [row._asdict() for row in found.rows], "papers": found.papers}


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
    for voxels, asset in islice(furniture(sweethome3d.VALIDATION), held_out.objects):
        if tell:
            tell(f"object {len(real) + 1}, {voxels.name}", time.monotonic() - began)
        real.append(voxels)
        if encoder:
            features.append(
                cached_image_features(asset, voxels, encoder, cells=held_out.cells, memory=memory)
            )
    return replace(held_out, real=real, features=features)
