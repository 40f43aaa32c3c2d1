"""Evaluation: rows of the paper's metrics on objects, wordings and pairs never trained on."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from ..fem.errors import UsageError
from ..fem.table import load_table
from .binding import NamedPart
from .dataset.objects import make_objects
from .dataset.real import RealObject
from .dataset.texttable import TextTable, build_text_table
from .encoders.minilm import MiniLM
from .normalisation import DEFAULT
from .plain_words import HintedEncoder
from .predictor import TextEncoder
from .retrieval import RetrievalPredictor
from .text import Clause, parse
from .vocabulary import Vocabulary

if TYPE_CHECKING:
    from .film_scene import Scene
    from .film_unet import FilmUNet
    from .training.batch import Batch

Split = Literal["procedural", "validation"]
BASELINES = ("constant", "table-mean", "table-first", "retrieval")
_BOOTSTRAP = 1000  # resamples of the objects, for 95 % intervals


@dataclass(frozen=True)
class Row:
    """One line of the table; errors are mean squared errors of values normalised to [-1, 1].

    ``interval`` is the 95 % bootstrap interval of ``mse_mean`` over the objects; ``boundary_ratio``
    the error of voxels that touch another part over that of the others.
    """

    predictor: str
    split: str
    mse_E: float
    mse_nu: float
    mse_rho: float
    mse_mean: float
    clause_accuracy: float | None
    boundary_ratio: float
    objects: int
    seconds_per_object: float
    interval: tuple[float, float]
    by_clauses: dict[int, float]

    def to_dict(self) -> dict:
        """Plain data for JSON."""
        return asdict(self)


class Score(NamedTuple):
    """Of one object: errors (3,), those at boundaries and inside, accuracy, clauses, seconds."""

    errors: np.ndarray
    edge: float
    inner: float
    right: float
    clauses: int
    seconds: float


class Sample(NamedTuple):
    """One object with what its clauses say ("" for none) and its slots' names, if given."""

    batch: Batch
    said: list[str]
    names: tuple[str, ...]


# A predictor in the evaluation: an example in, values (1, 3, x, y, z) and logits (or None) out.
Guess = Callable[[Sample], tuple]


def evaluate(
    split: Split,
    predictors: Sequence[str] = ("film", *BASELINES),
    *,
    objects: int = 64,
    cells: int = 64,
    seed: int = 0,
    weights: Path | None = None,
    real: Sequence[RealObject] = (),
) -> list[Row]:
    """Return one row for each predictor.

    Parameters
    ----------
    split
        "procedural": new shapes, held-out frames, wordings and part/material pairs, no names.
        "validation": ``real`` objects of a source that training never saw, texts about kinds of
        matter and the default template.
    predictors
        Names of rows: film, film-names, film-notext, film-nofeatures, film-nohints and the
        ``BASELINES``. Names that are given are read as at run time.
    objects, cells, seed
        How many objects, on how fine a grid, drawn how.
    weights
        Checkpoint of the network; the shipped one by default.
    """
    text = held_out_text(seed, real=real)
    scores: dict[str, list[Score]] = {name: [] for name in predictors}
    guesses = {name: _guess(name, text, weights) for name in predictors}
    for names in (False, True):
        asked = [name for name in predictors if (name == "film-names") == names]
        batches = held_out_batches(
            split, text, objects=objects, cells=cells, seed=seed, names=names, real=real
        )
        for index, batch in enumerate(batches if asked else ()):
            if not batch.valued.any():
                continue
            slots = real[index].slots if split == "validation" else ()
            example = Sample(batch, spoken(batch, text), slots if names else ())
            for name in asked:
                scores[name].append(_score(guesses[name], example))
    return [summary(name, split, scores[name]) for name in predictors]


def held_out_text(seed: int, *, per_part: int = 12, real: Sequence[RealObject] = ()) -> TextTable:
    """Clauses of frames, wordings and pairs that training never sees, embedded."""
    encoder = HintedEncoder(MiniLM())
    return build_text_table(
        np.random.default_rng(seed), encoder.text, per_part=per_part, held_out=True, real=real
    )


def spoken(batch: Batch, text: TextTable) -> list[str]:
    """Return what every slot for a clause says, "" where it is empty."""
    given = batch.scene.clauses[0].numpy()
    known = text.embedding.astype(np.float32)
    here = batch.scene.clause_mask[0].numpy()
    return [
        text.texts[int(np.square(known - vector).sum(axis=1).argmin())] if there else ""
        for vector, there in zip(given, here, strict=True)
    ]


def held_out_batches(
    split: Split,
    text: TextTable,
    *,
    objects: int,
    cells: int,
    seed: int,
    names: bool = False,
    real: Sequence[RealObject] = (),
) -> Iterator[Batch]:
    """Yield batches of one object each, for a split."""
    import torch

    from .training.phrasebook import Phrasebook
    from .training.samples import Mixture, Sampler
    from .training.stores import Store, procedural_store, real_store

    mixture = Mixture(
        composite=0, relabelled=0, real=0, no_text=0.1, mention=0.7, whole=0.1,
        object_name=0.5 if split == "validation" else 0.0, names=float(names), vision=0.0,
        no_hints=0.0, augment=0.0,
    )  # fmt: skip
    book = Phrasebook(text, "cpu")
    if split == "procedural":
        made = make_objects(objects, np.random.default_rng(seed + 1))
        store = procedural_store(made, cells=cells, device="cpu")
    else:
        store = real_store(list(real[:objects]), text, cells=cells, device="cpu")
    sampler = Sampler(book, store, None, None, mixture=mixture, seed=seed)
    for index in range(len(store.label)):
        item = Store(*(column[index : index + 1] for column in store))
        yield sampler.compose(item, torch.tensor([split == "validation"]), torch.tensor([False]))


def _score(guess: Guess, example: Sample) -> Score:
    """Compare a predictor with the truth of one object."""
    batch = example.batch
    began = time.perf_counter()
    values, logits = guess(example)
    seconds = time.perf_counter() - began
    wrong = ((values - batch.target) ** 2)[0].numpy()
    valued = batch.valued[0].numpy()
    edge = touches_another(batch.scene.part[0].numpy()) & valued
    mean = wrong.mean(axis=0)
    sides = [float(mean[m].mean()) if m.any() else np.nan for m in (edge, valued & ~edge)]
    right = np.nan
    if logits is not None and batch.bound.any():
        right = float((logits.argmax(1) == batch.clause)[batch.bound].float().mean())
    return Score(
        wrong[:, valued].mean(axis=1), sides[0], sides[1], right, int(batch.mentioned[0]), seconds
    )


def summary(name: str, split: str, scores: Sequence[Score]) -> Row:
    """Summarise the objects of one predictor."""
    if not scores:
        raise UsageError(f"no object of the {split} split has a known value: give more objects")
    errors = np.array([score.errors for score in scores])
    means, clauses = errors.mean(axis=1), np.array([score.clauses for score in scores])
    rng = np.random.default_rng(0)
    draws = rng.integers(len(means), size=(_BOOTSTRAP, len(means)))
    low, high = np.percentile(means[draws].mean(axis=1), [2.5, 97.5])
    sides = np.array([(score.edge, score.inner) for score in scores])
    sides = sides[~np.isnan(sides).any(axis=1)]
    edge, inner = sides.mean(axis=0) if len(sides) else (np.nan, np.nan)
    right = [score.right for score in scores if not np.isnan(score.right)]
    mse_E, mse_nu, mse_rho = errors.mean(axis=0).tolist()
    return Row(
        predictor=name,
        split=split,
        mse_E=mse_E,
        mse_nu=mse_nu,
        mse_rho=mse_rho,
        mse_mean=float(means.mean()),
        clause_accuracy=float(np.mean(right)) if right else None,
        boundary_ratio=float(edge / max(inner, 1e-9)),
        objects=len(means),
        seconds_per_object=float(np.mean([score.seconds for score in scores])),
        interval=(float(low), float(high)),
        by_clauses={int(k): float(means[clauses == k].mean()) for k in np.unique(clauses)},
    )


def touches_another(part: np.ndarray) -> np.ndarray:
    """Voxels with a neighbour of another part among the six."""
    out = np.zeros(part.shape, dtype=bool)
    for axis in range(3):
        a, b = np.moveaxis(part, axis, 0)[:-1], np.moveaxis(part, axis, 0)[1:]
        differ = (a != b) & (a >= 0) & (b >= 0)
        moved = np.moveaxis(out, axis, 0)
        moved[:-1] |= differ
        moved[1:] |= differ
    return out


def _guess(name: str, text: TextTable, weights: Path | None) -> Guess:
    if name.startswith("film"):
        return _film(name, weights)
    return _retrieval() if name == "retrieval" else _baseline(name, text)


def _film(name: str, weights: Path | None) -> Guess:
    """Return the network, with text, hints or features taken away as the row's name says."""
    import torch

    from .film import WEIGHTS
    from .training.checkpoint import load_checkpoint

    network: FilmUNet = load_checkpoint(weights or WEIGHTS)
    encoder = MiniLM()

    def guess(example: Sample):
        scene = example.batch.scene
        if name == "film-notext":
            nothing = torch.zeros_like(scene.clause_mask)
            scene = scene._replace(
                clause_mask=nothing, has_object=torch.zeros_like(scene.has_object)
            )
        if name == "film-nohints":
            plain = torch.arange(scene.clauses.shape[-1]) < encoder.dim
            scene = scene._replace(clauses=scene.clauses * plain)
        if name == "film-nofeatures":
            inputs = scene.inputs.clone()
            inputs[:, 1:5] = 0  # colour and its flag: occupancy and place stay
            scene = scene._replace(inputs=inputs)
        if example.names:
            scene = _with_names(scene, example, encoder)
        with torch.inference_mode():
            output = network(scene)
        return output.values, output.logits

    return guess


def _with_names(scene: Scene, example: Sample, encoder: TextEncoder) -> Scene:
    """Return the scene with the evidence of names as it is gathered at run time."""
    import torch

    from .film import name_evidence, standard

    vocabulary = Vocabulary(load_table().phrases)
    clauses = [_one_clause(said, vocabulary) for said in example.said]
    here = [k for k, said in enumerate(example.said) if said]
    if not here:
        return scene
    named = [NamedPart.of([slot], vocabulary, 0.0) for slot in example.names]
    score, trust = name_evidence([clauses[k] for k in here], named, encoder)
    part = scene.part[0].numpy()
    evidence, reliability = torch.zeros_like(scene.evidence), scene.reliability.clone()
    spread = standard(score.T[part.clip(min=0)], part >= 0)
    evidence[0, 1, here], reliability[0, 1] = torch.from_numpy(spread), trust
    return scene._replace(evidence=evidence, reliability=reliability)


def _one_clause(said: str, vocabulary: Vocabulary) -> Clause:
    """Read as one what was written as one: "use velvet for the fabric" speaks of fabric."""
    first, *others = [*parse(said, vocabulary), Clause(said)]
    spoken_of = [part for clause in others for part in (clause.material, *clause.parts) if part]
    return Clause(said, first.material, (*first.parts, *spoken_of))


def _retrieval() -> Guess:
    """Return retrieval: the clauses as one text, the parts by their size alone."""
    import torch

    retrieval = RetrievalPredictor()

    def guess(example: Sample):
        part = example.batch.scene.part[0]
        volumes = [float((part == p).sum()) for p in range(int(part.max()) + 1)]
        labels = [(f"part {p + 1}",) for p in range(len(volumes))]
        said = "; ".join(filter(None, example.said)) or "This is an object."
        chosen = retrieval.choose(labels, said, part_volumes=volumes)
        value = torch.tensor(np.array([DEFAULT.normalise(*c.value) for c in chosen]))
        return value.float()[part.clamp(min=0)].movedim(-1, 0)[None], None

    return guess


def _baseline(name: str, text: TextTable) -> Guess:
    """Return a predictor that reads every clause perfectly but knows not of which voxel it speaks.

    ``constant`` is the mean of the part kinds; ``table-mean`` the mean of what the clauses ask
    for; ``table-first`` gives the whole object what the first clause asks for.
    """
    import torch

    from .training.phrasebook import settled_values

    if name not in BASELINES:
        raise UsageError(f"unknown row {name!r}: wanted film, film-... or one of {BASELINES}")
    meaning, known = settled_values(text)
    mean = text.levels[:, -1].mean(axis=0)
    first = {said: row for row, said in reversed(list(enumerate(text.texts)))}

    def guess(example: Sample):
        value = mean
        rows = np.array([first[said] for said in example.said if said], dtype=int)
        if name != "constant" and len(rows):
            said = np.where(known[rows, None], np.nan_to_num(meaning[rows]), mean)
            value = said.mean(axis=0) if name == "table-mean" else said[0]
        tensor = torch.tensor(value, dtype=torch.float32)
        return tensor[None, :, None, None, None].expand_as(example.batch.target), None

    return guess


def level_response(
    *, weights: Path | None = None, seed: int = 0, parts: int = 12
) -> dict[str, float]:
    """Spearman correlation of the asked level with log10 E and log10 rho over held-out wordings."""
    import torch
    from scipy.stats import spearmanr

    from .dataset.grammar import Grammar
    from .dataset.wordings import LEVELS
    from .film import WEIGHTS
    from .training.checkpoint import load_checkpoint

    network, encoder = load_checkpoint(weights or WEIGHTS), HintedEncoder(MiniLM())
    grammar = Grammar(np.random.default_rng(seed), held_out=True)
    seen = [i for i, kind in enumerate(grammar.kinds) if not kind.held_out]
    keys = np.random.default_rng(seed).choice(seen, parts, replace=False)
    result = {}
    for name, axis, field in (("log10_E", 0, "stiffness"), ("log10_rho", 2, "density")):
        levels = [
            n for n in LEVELS if getattr(LEVELS[n], field) is not None and LEVELS[n].nu is None
        ]
        found = []
        for key in keys:
            asked = [lv for lv in levels for _ in range(5)]
            texts = [grammar.part_level(int(key), lv).text for lv in asked]
            with torch.inference_mode():
                vectors = torch.from_numpy(encoder.text(texts))
                values = network.text_values(vectors, torch.zeros(len(texts), dtype=torch.long))
            shares = [getattr(LEVELS[lv], field) for lv in asked]
            found.append(spearmanr(shares, values[:, axis].numpy())[0])
        result[name] = float(np.mean(found))
    return result


def named_materials(*, weights: Path | None = None, seed: int = 0) -> dict[str, float]:
    """Median |d log10 E| and |d log10 rho| of every row of the table in held-out frames."""
    import torch

    from .dataset.grammar import Grammar
    from .film import WEIGHTS
    from .training.checkpoint import load_checkpoint

    network, encoder = load_checkpoint(weights or WEIGHTS), HintedEncoder(MiniLM())
    grammar = Grammar(np.random.default_rng(seed), held_out=True)
    rows = grammar.rows
    texts = [grammar.whole(0, row).text for row in rows]
    with torch.inference_mode():
        vectors = torch.from_numpy(encoder.text(texts))
        values = network.text_values(vectors, torch.zeros(len(texts), dtype=torch.long)).numpy()
    truth = np.array([DEFAULT.normalise(*row.value()) for row in rows])
    off = np.abs(values - truth) * DEFAULT.span / 2
    return {"rows": len(rows), "log10_E": float(np.median(off[:, 0])),
            "log10_rho": float(np.median(off[:, 2]))}  # fmt: skip
