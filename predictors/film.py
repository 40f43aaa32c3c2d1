"""The FiLM predictor: one pass of the trained network, and exact values where the text names them.

Every clause of the text is embedded alone and bound to voxels by what the network sees of shape
and colour, by the asset's own names, and by the features of a vision-language encoder if given.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..fem.errors import UsageError
from ..fem.table import MaterialTable, load_table
from .asset import UpAxis
from .binding import NamedPart, is_whole
from .field import MaterialField
from .film_evidence import VISION, name_evidence, own_name, standard
from .film_frame import Frame
from .normalisation import DEFAULT
from .plain_words import HintedEncoder, subject
from .predictor import TextEncoder
from .retrieval import RetrievalPredictor
from .text import Clause, parse
from .vocabulary import Vocabulary
from .voxels import PartVoxels

if TYPE_CHECKING:
    from .film_scene import Scene
    from .film_unet import FilmUNet

WEIGHTS = Path(__file__).parent / "weights" / "film.safetensors"
# Reasons of the retrieval predictor that come from the user's words.
_TOLD, _TOLD_OF_ALL = ("text:", "override"), "whole sentence:"
# AutoPhyX 3.3: "This is a [object name]." leaves every part at the mean of its range.
_TEMPLATE = re.compile(r"((this|it) is |an image of )?an? [\w -]{1,40}\.?", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class Appearance:
    """What is seen of the cells: colours in [0, 1] (nx, ny, nz, 3), features (nx, ny, nz, D).

    ``words`` embeds clauses in the space of the features; either may be missing.
    """

    colours: np.ndarray | None = None
    features: np.ndarray | None = None
    words: TextEncoder | None = None


class Binding(NamedTuple):
    """What was understood of one part: the clause that took most of its voxels, and how surely.

    ``share`` of the part's voxels follow the clause (None: the text does not speak of it);
    ``spread`` is the mean deviation of log10 E between views of the object from four sides.
    """

    part: str
    clause: str | None
    share: float
    voxels: int
    spread: float
    exact: bool


class FilmPredictor:
    """Predicts with the shipped weights, or those of ``weights``."""

    name = "film"

    def __init__(
        self,
        *,
        weights: Path | None = None,
        table: MaterialTable | None = None,
        encoder: TextEncoder | None = None,
    ) -> None:
        self.table = table or load_table()
        self._weights, self._given_encoder = weights or WEIGHTS, encoder
        self._vocabulary = Vocabulary(self.table.phrases)

    @cached_property
    def encoder(self) -> TextEncoder:
        """The text encoder that the network was trained with."""
        from .encoders.minilm import MiniLM

        return self._given_encoder or MiniLM()

    @cached_property
    def network(self) -> FilmUNet:
        """The network, loaded on the first prediction."""
        from .training.checkpoint import load_checkpoint

        return load_checkpoint(self._weights)

    def predict(
        self,
        parts: PartVoxels,
        text: str,
        *,
        alpha: float | None = None,
        overrides: Mapping[str, str] | None = None,
        materials: Mapping[str, str] | None = None,
        up: UpAxis = "z",
        appearance: Appearance | None = None,
        names: bool = True,
        exact: bool = True,
    ) -> MaterialField:
        """Return the field; see ``explain`` for the options."""
        return self.explain(
            parts, text, alpha=alpha, overrides=overrides, materials=materials, up=up,
            appearance=appearance, names=names, exact=exact, turns=1,
        )[0]  # fmt: skip

    def explain(
        self,
        parts: PartVoxels,
        text: str,
        *,
        alpha: float | None = None,
        overrides: Mapping[str, str] | None = None,
        materials: Mapping[str, str] | None = None,
        up: UpAxis = "z",
        appearance: Appearance | None = None,
        names: bool = True,
        exact: bool = True,
        turns: int = 4,
    ) -> tuple[MaterialField, list[Binding]]:
        """Return the field and what was understood of every part.

        Parameters
        ----------
        overrides, materials
            For single parts: free text, and the exact name of a material of the table.
        up
            The axis that points up.
        appearance
            Colours and features of the cells, if known.
        names
            Whether the asset's own names may be read.
        exact
            Whether a material that the text names for a part is taken from the table as it stands;
            only where ``names`` may be read, for they bind it.
        turns
            Views from so many sides are averaged; their spread is reported.
        """
        if alpha is not None:
            raise UsageError("the film predictor has no --alpha: use --predictor retrieval")
        frame = Frame.of(parts, up)
        clauses = self.clauses(text)
        scene = self._scene(parts, frame, text, appearance or Appearance(), names)
        values, taken = self._run(scene, frame, turns)
        mean = values.mean(axis=0)
        spread = values[..., 0].std(axis=0) * DEFAULT.span[0] / 2
        E, nu, rho = DEFAULT.physical(frame.back(mean, parts))
        fixed = self._exact(parts, text, overrides, materials) if exact and names else {}
        for index, value in fixed.items():
            cells = parts.part == index
            E[cells], nu[cells], rho[cells] = value
        labels = parts.part.astype(np.int64)
        field = MaterialField(
            parts.grid, parts.occupied, E, nu, rho, part=labels, part_names=parts.part_names
        )
        said = [clause.text for clause in clauses]
        told = _bindings(
            parts, frame.back(taken, parts), frame.back(spread, parts), said, set(fixed)
        )
        return field, told

    def clauses(self, text: str) -> list[Clause]:
        """Clauses of a text as written; the default template names the object and says nothing."""
        found = parse(text, self._vocabulary)
        if _TEMPLATE.fullmatch(text.strip()) and not any(c.material or c.level for c in found):
            return []
        return _as_written(text, found)

    def _exact(self, parts: PartVoxels, text: str, overrides, materials) -> dict[int, tuple]:
        """Values of the parts whose material the text or an option names."""
        retrieval = RetrievalPredictor(table=self.table, encoder=self._given_encoder)
        chosen = retrieval.choose(
            parts.part_labels, text, overrides=overrides, materials=materials,
            part_volumes=parts.volumes,
        )  # fmt: skip
        # "the seat is foam" says nothing of the back; "oak chair" speaks of all of it.
        named = [c for c in parse(text, self._vocabulary) if c.material]
        told = (*_TOLD, _TOLD_OF_ALL) if all(map(is_whole, named)) else _TOLD
        return {
            index: tuple(choice.value)
            for index, choice in enumerate(chosen)
            if choice.weight == 1 and choice.why.startswith(told)
        }

    def _scene(
        self, parts: PartVoxels, frame: Frame, text: str, appearance: Appearance, names: bool
    ) -> Scene:
        """Put everything that is known into the tensors of the network."""
        import torch

        from .film_scene import Scene

        clauses = self.clauses(text)
        named = [NamedPart.of(labels, self._vocabulary, 0.0) for labels in parts.part_labels]
        spoken = [own_name(part) for part in named]
        k = max(len(clauses), 1)
        heard = HintedEncoder(self.encoder)
        vectors = heard.text([c.text for c in clauses] + spoken + [text or "object"])
        dim = vectors.shape[1]
        embedded = np.zeros((1, k, dim), dtype=np.float32)
        embedded[0, : len(clauses)] = vectors[: len(clauses)]
        own, whole = vectors[len(clauses) : -1], vectors[-1]
        part = frame.forward(parts.part, outside=-1)
        evidence = np.zeros((1, 2, k, *part.shape), dtype=np.float32)
        reliability = np.zeros((1, 2), dtype=np.float32)
        if clauses and appearance.features is not None and appearance.words is not None:
            seen = frame.forward(appearance.features) @ appearance.words.text(
                [subject(c.text) for c in clauses]
            ).T.astype(np.float32)
            evidence[0, 0], reliability[0, 0] = standard(seen, part >= 0), VISION
        if clauses and names:
            score, reliability[0, 1] = name_evidence(clauses, named, self.encoder)
            evidence[0, 1] = standard(score.T[part.clip(min=0)], part >= 0)
        inputs = frame.inputs(part, appearance.colours)
        known = [bool(name) and names for name in spoken]
        present = np.arange(k)[None] < len(clauses)
        unsaid = np.array([not clauses and bool(text.strip())])
        numbers = (
            inputs[None], embedded, present, whole[None], unsaid,
            evidence, reliability, own[None], np.array([known]), part[None].astype(np.int64),
        )  # fmt: skip
        return Scene(*(torch.from_numpy(np.ascontiguousarray(array)) for array in numbers))

    def _run(self, scene: Scene, frame: Frame, turns: int):
        """Values (turns, x, y, z, 3) and the clause of every voxel (-1: none) in the frame."""
        import torch

        out, shares = [], []
        fields = ("inputs", "evidence", "part")
        for turn in range(turns):
            turned = scene._replace(
                **{f: torch.rot90(getattr(scene, f), turn, (-3, -2)) for f in fields}
            )
            x, y, z = turned.inputs.shape[2:]
            place = torch.from_numpy(frame.place((x, y, z)))
            inputs = torch.cat([turned.inputs[:, :5], place[None] * turned.inputs[:, :1]], 1)
            with torch.inference_mode():
                result = self.network(turned._replace(inputs=inputs))
            out.append(torch.rot90(result.values, -turn, (-3, -2))[0].movedim(0, -1).numpy())
            shares.append(torch.rot90(result.logits.softmax(1), -turn, (-3, -2))[0].numpy())
        best = np.mean(shares, axis=0).argmax(axis=0)
        none = len(shares[0]) - 1
        return np.stack(out), np.where(best == none, -1, best)


def _as_written(text: str, clauses: Sequence[Clause]) -> list[Clause]:
    """Clauses with every word between their first and last: "extremely" is no filler here."""
    out, at, lower = [], 0, text.lower()
    for clause in clauses:
        start, end = -1, at
        for word in clause.text.lower().split():
            place = lower.find(word, end)
            if place < 0:  # the words stand in another order: a list was taken apart
                start = -1
                break
            start, end = (place if start < 0 else start), place + len(word)
        if start >= 0:
            at = end
            clause = replace(clause, text=" ".join(text[start:end].split()))
        out.append(clause)
    return out


def _bindings(
    parts: PartVoxels, taken: np.ndarray, spread: np.ndarray, said: Sequence[str], fixed: set[int]
) -> list[Binding]:
    """Most frequent clause of every part."""
    out = []
    for index, name in enumerate(parts.part_names):
        cells = parts.part == index
        count = np.bincount(taken[cells].astype(int) + 1, minlength=len(said) + 1)
        best, total = int(count.argmax()), int(cells.sum())
        clause = said[best - 1] if best else None
        share = float(count[best] / max(total, 1))
        doubt = float(spread[cells].mean()) if total else 0.0
        out.append(Binding(name, clause, share, total, doubt, index in fixed))
    return out
