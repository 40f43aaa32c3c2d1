"""Evaluation: rows of the paper's metrics on objects, wordings and pairs never trained on."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from ..fem.errors import UsageError
from .dataset.objects import make_objects
from .dataset.real import RealObject
from .dataset.texttable import TextTable, build_text_table
from .encoders.minilm import MiniLM
from .lexicon import HintedEncoder

if TYPE_CHECKING:
    from .film_unet import FilmUNet
    from .training.batch import Batch

Split = Literal["procedural", "validation"]
BASELINES = ("constant", "table-mean", "table-first")
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


class Scores(NamedTuple):
    """Per object: errors (n, 3), boundary and interior error (n, 2), accuracy, clause count."""

    errors: np.ndarray
    edges: np.ndarray
    right: np.ndarray
    clauses: np.ndarray
    seconds: float


# A predictor in the evaluation: a batch in, values (n, 3, x, y, z) and logits (or None) out.
Guess = Callable[["Batch"], tuple]


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
        Names of rows: film, film-names, film-notext, film-nofeatures and the ``BASELINES``.
    objects, cells, seed
        How many objects, on how fine a grid, drawn how.
    weights
        Checkpoint of the network; the shipped one by default.
    """
    rows = []
    for name in predictors:
        scores = _score(name, split, objects, cells, seed, weights, real)
        rows.append(_row(name, split, scores))
    return rows


def held_out_text(seed: int, *, per_part: int = 12, real: Sequence[RealObject] = ()) -> TextTable:
    """Clauses of frames, wordings and pairs that training never sees, embedded."""
    encoder = HintedEncoder(MiniLM())
    return build_text_table(
        np.random.default_rng(seed), encoder.text, per_part=per_part, held_out=True, real=real
    )


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


def _score(name, split, objects, cells, seed, weights, real) -> Scores:
    text = held_out_text(seed, real=real)
    batches = held_out_batches(
        split, text, objects=objects, cells=cells, seed=seed,
        names=name == "film-names", real=real,
    )  # fmt: skip
    guess = _film(name, weights) if name.startswith("film") else _baseline(name, text)
    errors, edges, right, clauses = [], [], [], []
    seconds = 0.0
    for batch in batches:
        if not batch.valued.any():
            continue
        began = time.perf_counter()
        values, logits = guess(batch)
        seconds += time.perf_counter() - began
        wrong = ((values - batch.target) ** 2)[0].numpy()
        valued = batch.valued[0].numpy()
        edge = _touches_another(batch.scene.part[0].numpy()) & valued
        errors.append(wrong[:, valued].mean(axis=1))
        mean = wrong.mean(axis=0)
        inner = valued & ~edge
        edges.append([mean[m].mean() if m.any() else np.nan for m in (edge, inner)])
        bound = batch.bound[0]
        hit = (
            (logits.argmax(1)[0] == batch.clause[0])[bound].float().mean()
            if logits is not None
            else np.nan
        )
        right.append(float(hit))
        clauses.append(int(batch.mentioned[0]))
    seconds /= max(len(errors), 1)
    columns = [np.array(column) for column in (errors, edges, right, clauses)]
    return Scores(columns[0], columns[1], columns[2], columns[3], seconds)


def _accuracy(logits, clause, bound) -> float:
    """Share of the voxels in ``bound`` whose strongest clause is the right one."""
    return float((logits.argmax(0) == clause)[bound].float().mean())


def _row(name: str, split: str, scores: Scores) -> Row:
    """Summarise the objects of one predictor."""
    means = scores.errors.mean(axis=1)
    rng = np.random.default_rng(0)
    draws = rng.integers(len(means), size=(_BOOTSTRAP, len(means)))
    low, high = np.percentile(means[draws].mean(axis=1), [2.5, 97.5])
    both = scores.edges[~np.isnan(scores.edges).any(axis=1)]
    edge, inner = both.mean(axis=0) if len(both) else (np.nan, np.nan)
    by_clauses = {
        int(k): float(means[scores.clauses == k].mean()) for k in np.unique(scores.clauses)
    }
    right = scores.right[~np.isnan(scores.right)]
    mse_E, mse_nu, mse_rho = scores.errors.mean(axis=0).tolist()
    return Row(
        predictor=name,
        split=split,
        mse_E=mse_E,
        mse_nu=mse_nu,
        mse_rho=mse_rho,
        mse_mean=float(means.mean()),
        clause_accuracy=float(right.mean()) if len(right) else None,
        boundary_ratio=float(edge / max(inner, 1e-9)),
        objects=len(means),
        seconds_per_object=scores.seconds,
        interval=(float(low), float(high)),
        by_clauses=by_clauses,
    )


def _touches_another(part: np.ndarray) -> np.ndarray:
    """Voxels with a neighbour of another part among the six."""
    out = np.zeros(part.shape, dtype=bool)
    for axis in range(3):
        a, b = np.moveaxis(part, axis, 0)[:-1], np.moveaxis(part, axis, 0)[1:]
        differ = (a != b) & (a >= 0) & (b >= 0)
        moved = np.moveaxis(out, axis, 0)
        moved[:-1] |= differ
        moved[1:] |= differ
    return out


def _film(name: str, weights: Path | None) -> Guess:
    """Return the network, with text or features taken away as the row's name says."""
    import torch

    from .film import WEIGHTS
    from .training.checkpoint import load_checkpoint

    network: FilmUNet = load_checkpoint(weights or WEIGHTS)

    def guess(batch: Batch):
        scene = batch.scene
        if name == "film-notext":
            nothing = torch.zeros_like(scene.clause_mask)
            scene = scene._replace(
                clause_mask=nothing, has_object=torch.zeros_like(scene.has_object)
            )
        if name == "film-nofeatures":
            inputs = scene.inputs.clone()
            inputs[:, 1:5] = 0  # colour and its flag: occupancy and place stay
            scene = scene._replace(inputs=inputs)
        with torch.inference_mode():
            output = network(scene)
        return output.values, output.logits

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
    embedding = torch.from_numpy(text.embedding.astype(np.float32))

    def guess(batch: Batch):
        value = mean
        present = batch.scene.clauses[batch.scene.clause_mask]
        if name != "constant" and len(present):
            rows = (present @ embedding.T).argmax(dim=1).numpy()
            said = np.where(known[rows, None], np.nan_to_num(meaning[rows]), mean)
            value = said.mean(axis=0) if name == "table-mean" else said[0]
        tensor = torch.tensor(value, dtype=torch.float32)
        return tensor[None, :, None, None, None].expand_as(batch.target), None

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
    from .normalisation import DEFAULT
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
