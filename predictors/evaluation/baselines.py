"""Who is compared in the evaluation: the network, whole or deprived of something, and baselines."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...fem.errors import UsageError
from ...fem.scene.materials import load_table
from ..datasets.text_table import TextTable
from ..encoders.minilm import MiniLM
from ..encoders.protocol import TextEncoder
from ..film.evidence import VISION, name_evidence, standard
from ..language.binding import NamedPart
from ..language.clauses import Clause
from ..language.hints import subject
from ..language.parser import parse
from ..language.vocabulary import Vocabulary
from ..lookup.lookup import Lookup
from ..normalisation import DEFAULT
from ..voxels import pooled

if TYPE_CHECKING:
    from ..film.config import Output, Scene
    from ..film.unet import FilmUNet
    from ..training.batch import Batch

BASELINES = ("constant", "table-mean", "table-first", "retrieval", "pixie")
# The network without: colours and features, features, text, the lexicon's hints and subjects,
# and without knowing which cells are of one part.
DEPRIVED = ("film-nofeatures", "film-rgb", "film-notext", "film-nohints", "film-voxels")


class Seen(NamedTuple):
    """Features of an image encoder: half-resolution cells (n, 3) that have one, values (n, D)."""

    cells: np.ndarray
    values: np.ndarray


class Sample(NamedTuple):
    """One object with what its clauses say ("" for none), its slots' names and what is seen."""

    batch: Batch
    said: list[str]
    names: tuple[str, ...]
    seen: Seen | None = None


# A predictor in the evaluation: an example in, values (1, 3, x, y, z) and logits (or None) out.
Guess = Callable[[Sample], tuple]


def guess_of(
    name: str, text: TextTable, weights: Path | None, words: TextEncoder | None = None
) -> Guess:
    """Return the predictor of a row; ``pixie`` is the network that hears no text.

    ``words`` are those of the image encoder that sees the objects.
    """
    if name in ("film", "film-names", "pixie", *DEPRIVED):
        return _film("film-notext" if name == "pixie" else name, weights, words)
    return _retrieval() if name == "retrieval" else _baseline(name, text)


def _film(name: str, weights: Path | None, words: TextEncoder | None) -> Guess:
    """Return the network, with what the row's name says taken away."""
    import torch

    from ..film.checkpoint import load_checkpoint
    from ..film.inference import WEIGHTS

    network: FilmUNet = load_checkpoint(weights or WEIGHTS)
    encoder, vocabulary = MiniLM(), Vocabulary(load_table().phrases)

    def guess(example: Sample):
        scene = _deprived(example.batch.scene, name, encoder.dim)
        if example.seen is not None and name not in ("film-rgb", "film-nofeatures"):
            scene = _with_vision(scene, example, words or encoder)
        if example.names:
            scene = _with_names(scene, example, encoder, vocabulary)
        with torch.inference_mode():
            output = network(scene)
        return output if name == "film-voxels" else _by_part(output, scene)

    return guess


def _by_part(output: Output, scene: Scene) -> Output:
    """Return the means over each part, but for ``binding.of_pieces``: as at run time."""
    import torch

    part = scene.part[0].numpy()
    if int(scene.clause_mask.sum()) > part.max() + 1:
        return output
    columns = (output.values, output.logits.softmax(1))
    values, shares = (
        torch.from_numpy(pooled(x[0].movedim(0, -1).float().numpy(), part)).movedim(-1, 0)[None]
        for x in columns
    )
    # 1e-9: a share of nothing has a log too.
    return output._replace(values=values, logits=shares.clamp(min=1e-9).log())


def _deprived(scene: Scene, name: str, dim: int) -> Scene:
    """Return the scene without what the row does without."""
    import torch

    if name == "film-notext":
        nothing = torch.zeros_like(scene.clause_mask)
        return scene._replace(clause_mask=nothing, has_object=torch.zeros_like(scene.has_object))
    if name == "film-nohints":
        plain = torch.arange(scene.clauses.shape[-1]) < dim
        return scene._replace(clauses=scene.clauses * plain)
    if name == "film-nofeatures":
        inputs = scene.inputs.clone()
        inputs[:, 1:5] = 0  # colour and its flag: occupancy and place stay
        return scene._replace(inputs=inputs)
    return scene


def _with_vision(scene: Scene, example: Sample, encoder: TextEncoder) -> Scene:
    """Return the scene with the evidence of an image encoder, at half the resolution."""
    import torch

    here = [k for k, said in enumerate(example.said) if said]
    if not here or example.seen is None:
        return scene
    half = tuple(n // 2 for n in scene.part.shape[1:])
    cells = tuple(example.seen.cells.T)
    likeness = np.zeros((*half, len(here)), dtype=np.float32)
    words = encoder.text([subject(example.said[k]) for k in here])
    likeness[cells] = example.seen.values.astype(np.float32) @ words.T
    inside = np.zeros(half, dtype=bool)
    inside[cells] = True
    evidence = torch.zeros(*scene.evidence.shape[:3], *half)
    evidence[0, 0, here] = torch.from_numpy(standard(likeness, inside))
    reliability = scene.reliability.clone()
    reliability[0, 0] = VISION
    return scene._replace(evidence=evidence, reliability=reliability)


def _with_names(
    scene: Scene, example: Sample, encoder: TextEncoder, vocabulary: Vocabulary
) -> Scene:
    """Return the scene with the evidence of names as it is gathered at run time."""
    import torch

    from ..film.config import halve

    clauses = [_one_clause(said) for said in example.said]
    here = [k for k, said in enumerate(example.said) if said]
    if not here:
        return scene
    named = [NamedPart.of([slot], vocabulary, 0.0) for slot in example.names]
    score, trust = name_evidence([clauses[k] for k in here], named, encoder)
    evidence, reliability = scene.evidence.clone(), scene.reliability.clone()
    part = scene.part[0].numpy()
    if part.shape != evidence.shape[3:]:  # beside evidence at half the resolution
        part = halve(scene).part[0].numpy()
    spread = standard(score.T[part.clip(min=0)], part >= 0)
    evidence[0, 1, here], reliability[0, 1] = torch.from_numpy(spread), trust
    return scene._replace(evidence=evidence, reliability=reliability)


def _one_clause(said: str) -> Clause:
    """Read as one what was written as one: "use velvet for the fabric" speaks of fabric."""
    first, *others = [*parse(said, load_table()).clauses, Clause(said)]
    spoken_of = [part for clause in others for part in (clause.material, *clause.parts) if part]
    return Clause(said, first.material, (*first.parts, *spoken_of))


def _retrieval() -> Guess:
    """Return retrieval: the clauses as one text, the parts by their size alone."""
    import torch

    lookup = Lookup()

    def guess(example: Sample):
        part = example.batch.scene.part[0]
        volumes = [float((part == p).sum()) for p in range(int(part.max()) + 1)]
        labels = [(f"part {p + 1}",) for p in range(len(volumes))]
        said = "; ".join(filter(None, example.said)) or "This is an object."
        chosen = lookup.choose(labels, parse(said, lookup.table), part_volumes=volumes)
        value = torch.tensor(np.array([DEFAULT.normalise(*c.value) for c in chosen]))
        return value.float()[part.clamp(min=0)].movedim(-1, 0)[None], None

    return guess


def _baseline(name: str, text: TextTable) -> Guess:
    """Return a predictor that reads every clause perfectly but knows not of which voxel it speaks.

    ``constant`` is the mean of the part kinds; ``table-mean`` the mean of what the clauses ask
    for; ``table-first`` gives the whole object what the first clause asks for.
    """
    import torch

    from ..training.sentences import settled_values

    if name not in BASELINES:
        raise UsageError(
            f"unknown row {name!r}: wanted film, film-names, one of {DEPRIVED} or {BASELINES}"
        )
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
