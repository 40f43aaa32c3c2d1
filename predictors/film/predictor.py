"""The FiLM predictor: clauses bound to cells, then to parts or pieces of them, by the network.

Every clause of the text is embedded alone and bound to voxels by what the network sees of shape
and colour, by the asset's own names, and by the features of a vision-language encoder if given.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import ClassVar, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ...fem.errors import InputError
from ...fem.note import Note
from ...fem.scene.up import half_turn
from ...fem.table import FIELDS, MaterialTable, MaterialValue, load_table
from ..appearance.features import Appearance
from ..asset import UpAxis
from ..encoders import TextEncoder
from ..field import DEFAULT, MaterialField, Normalisation, read_weights
from ..film.words import EncodedText, HintedEncoder, hear
from ..grid import PartVoxels, pooled
from ..matter import MOST, by_appearance, by_look, matters, moved, typed_values
from ..partition import Partition, match_clauses, partition
from ..prediction import Binding, PartChoice, Prediction, field_of, unbound_by
from ..resolve.resolve import Lookup, lookup_of, nearest_row
from ..text.clauses import Clause, Sentence, bind
from .unet import FilmUNet, NetworkConfig, VoxelScene

WEIGHTS = Path(__file__).parents[1] / "weights" / "film.safetensors"


class Inference(NamedTuple):
    """What the network finds on the cells of the parts.

    ``values`` (nx, ny, nz, 3) are log E, nu, log rho in the ranges of ``normalisation``; ``shares``
    (nx, ny, nz, K + 1) say how surely each of the ``clauses`` speaks of a cell, the last one that
    none does; ``spread`` (nx, ny, nz) is the deviation of log10 E between views of the object from
    several sides. ``of_pieces`` and ``unbound`` are as ``EncodedText`` has them.
    """

    clauses: Sequence[Clause]
    values: np.ndarray
    shares: np.ndarray
    spread: np.ndarray
    normalisation: Normalisation = DEFAULT
    of_pieces: bool = False
    unbound: Sequence[int] = ()

    def pooled(self, parts: PartVoxels) -> Inference:
        """Return the means over every part: each is of one matter."""
        return self._replace(
            values=pooled(self.values, parts.part), shares=pooled(self.shares, parts.part)
        )

    def seen(
        self, parts: PartVoxels, frame: Frame, appearance: Appearance, table: MaterialTable
    ) -> Inference:
        """Return it with what looks say of clauses about matter; values follow the shares."""
        inside = parts.occupied
        looks = appearance.looks(inside)
        if looks is None:
            return self
        piece = parts.part[inside]
        if self.of_pieces:
            piece = piece * MOST + by_look(looks)
        piece = np.unique(piece, return_inverse=True)[1].ravel()
        cells = frame.upright(np.argwhere(inside), inside.shape)
        shares, values = self.shares.copy(), self.values.copy()
        shares[inside] = by_appearance(
            self.shares[inside], matters(self.clauses), cells, looks, piece,
            parts=not self.of_pieces,
        )  # fmt: skip
        told = typed_values(self.clauses, table, self.normalisation)
        values[inside] = moved(self.values[inside], shares[inside] - self.shares[inside], told)
        return self._replace(shares=shares, values=values)


class FilmModel:
    """The shipped network, or that of ``weights``, with all that it needs to read an asset."""

    def __init__(
        self,
        *,
        weights: Path | None = None,
        table: MaterialTable | None = None,
        encoder: TextEncoder | None = None,
    ) -> None:
        self.table = table or load_table()
        self._weights, self._given_encoder = weights or WEIGHTS, encoder

    @cached_property
    def encoder(self) -> TextEncoder:
        """The text encoder that the network was trained with."""
        from ..encoders.minilm import MiniLM

        return self._given_encoder or MiniLM()

    @cached_property
    def network(self) -> FilmUNet:
        """The network, loaded on the first inference."""
        return load_checkpoint(self._weights)

    @cached_property
    def words(self) -> HintedEncoder:
        """The same for what the network hears: sentence, hints of the lexicon, subject."""
        return HintedEncoder(self.encoder, normalisation=self.network.normalisation)

    def infer(
        self,
        parts: PartVoxels,
        heard: EncodedText,
        *,
        up: UpAxis = "z",
        appearance: Appearance | None = None,
        names: bool = True,
        turns: int = 4,
    ) -> Inference:
        """Return what the network finds on every cell.

        heard: What is said of the parts, as ``words`` embeds it.
        up: The axis that points up.
        appearance: Colours and features of the cells, if known.
        names: Whether the asset's own names may be read.
        turns: Views from so many sides are averaged; their spread is reported.
        """
        frame = Frame.of(parts, up)
        scene = self._scene(parts, frame, heard, appearance or Appearance(), names)
        values, shares = self._run(scene, frame, turns)
        normalisation = self.network.normalisation
        spread = values[..., 0].std(axis=0) * normalisation.span[0] / 2
        shares = shares[..., [*range(len(heard.clauses)), -1]]  # without the slot of a silent text
        found = Inference(
            heard.clauses, frame.back(values.mean(axis=0), parts), frame.back(shares, parts),
            frame.back(spread, parts), normalisation, heard.of_pieces, heard.unbound,
        )  # fmt: skip
        # Otherwise each part is of one matter.
        found = found if heard.of_pieces else found.pooled(parts)
        return found.seen(parts, frame, appearance or Appearance(), self.table)

    def _scene(
        self,
        parts: PartVoxels,
        frame: Frame,
        heard: EncodedText,
        appearance: Appearance,
        names: bool,
    ) -> VoxelScene:
        """Put everything that is known into the tensors of the network."""
        import torch

        count = len(heard.clauses)
        k = max(count, 1)
        embedded = np.zeros((1, k, heard.vectors.shape[1]), dtype=np.float32)
        embedded[0, :count] = heard.vectors
        part = frame.forward(parts.part, outside=-1)
        evidence = np.zeros((1, 2, k, *part.shape), dtype=np.float32)
        reliability = np.zeros((1, 2), dtype=np.float32)
        if count and appearance.features is not None and appearance.words is not None:
            asked = appearance.words.text(list(heard.subjects)).T.astype(np.float32)
            seen = frame.forward(appearance.features) @ asked
            evidence[0, 0], reliability[0, 0] = standard(seen, part >= 0), VISION
        if count and names:
            evidence[0, 1] = standard(heard.fits.T[part.clip(min=0)], part >= 0)
            reliability[0, 1] = heard.trust
        inputs = frame.inputs(part, appearance.colours)
        # The name of a part says nothing of its pieces.
        known = [known and names and not heard.of_pieces for known in heard.named]
        first, same = _distinct(heard.names)
        present = np.arange(k)[None] < count
        unsaid = np.array([not count and heard.spoken])
        numbers = (
            inputs[None], embedded, present, heard.whole[None], unsaid, evidence, reliability,
            heard.names[first][None], np.array([known])[:, first],
            np.where(part < 0, -1, same[part])[None].astype(np.int64),
        )  # fmt: skip
        tensors = (torch.from_numpy(np.ascontiguousarray(array)) for array in numbers)
        scene = VoxelScene(*tensors)
        if appearance.features is None:
            return scene
        looks = np.moveaxis(frame.forward(appearance.features.astype(np.float32)), -1, 0)
        return scene._replace(features=torch.from_numpy(looks[None]))

    def _run(self, scene: VoxelScene, frame: Frame, turns: int):
        """Values (turns, x, y, z, 3) and mean shares (x, y, z, clauses + 1) in the frame."""
        import torch

        out, shares = [], []
        fields = [
            f for f in ("inputs", "evidence", "part", "features") if getattr(scene, f) is not None
        ]
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
            share = torch.rot90(result.logits.softmax(1), -turn, (-3, -2))[0]
            shares.append(share.movedim(0, -1).numpy())
        return np.stack(out), np.mean(shares, axis=0)


def _distinct(
    names: Float[np.ndarray, "parts dim"],
) -> tuple[Int[np.ndarray, "n"], Int[np.ndarray, "parts"]]:
    """First part of each name, in order, and for each part the place of its name among them.

    Parts of one name are one to the network: what it costs grows with the names, not the bolts.
    """
    _, first, same = np.unique(names, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    return first[order], np.argsort(order)[same.reshape(-1)]


# The grid that the FiLM network sees: the object's box upright, at the size of training.

# Cells along the longest side in training; a grid with fewer or more than these is resampled.
TRAINED_CELLS, FEWEST_CELLS, MOST_CELLS = 62, 48, 64
# A thin object in a thinner grid would meet the deepest cells where training never put it: measured
# on two of them, the right clause fell from .99 to .4.
STEP = 64


@dataclass(frozen=True, eq=False)
class Frame:
    """The network's grid: the object's box, z up, resampled if need be, padded to its step.

    ``source`` holds, for every cell of the box, the cell of the upright grid behind it, as an index
    in C order; ``box`` the object's first cell and its number of cells along each upright axis.
    """

    axes: tuple[int, int, int]
    flip: tuple[int, ...]
    source: Int[np.ndarray, "x y z"]
    box: tuple[tuple[int, int], ...]
    inside: tuple[int, int, int]
    low: tuple[int, int, int]
    shape: tuple[int, int, int]

    @classmethod
    def of(cls, parts: PartVoxels, up: UpAxis, *, step: int = STEP) -> Frame:
        """Frame of the occupied box of ``parts``, in the middle of a cube as in training."""
        axes, flip = {"z": ((0, 1, 2), ()), "y": ((0, 2, 1), (1,)), "x": ((2, 1, 0), (0,))}[up[-1]]
        turned = half_turn(up)
        flip = tuple(i for i in range(3) if (i in flip) != (turned[axes[i]] < 0))
        upright = np.flip(parts.part.transpose(axes), flip)
        sides = [np.flatnonzero((upright >= 0).any(axis=tuple({0, 1, 2} - {i}))) for i in range(3)]
        box = tuple((int(cells[0]), int(cells[-1] - cells[0] + 1)) for cells in sides)
        longest = max(size for _, size in box)
        scale = 1.0 if FEWEST_CELLS <= longest <= MOST_CELLS else TRAINED_CELLS / longest
        x, y, z = (max(1, round(size * scale)) for _, size in box)
        i, j, k = (-(-m // step) * step for m in (x, y, z))
        low = (i - x) // 2, (j - y) // 2, (k - z) // 2
        return cls(axes, flip, _source(upright, box, (x, y, z)), box, (x, y, z), low, (i, j, k))

    def forward(self, cells: np.ndarray, *, outside: float = 0) -> np.ndarray:
        """Bring an array over the cells (nx, ny, nz, ...) into the frame."""
        more = tuple(range(3, cells.ndim))
        upright = np.flip(cells.transpose((*self.axes, *more)), self.flip)
        out = np.full((*self.shape, *cells.shape[3:]), outside, dtype=cells.dtype)
        box = tuple(slice(a, a + m) for a, m in zip(self.low, self.inside, strict=True))
        out[box] = upright.reshape(-1, *cells.shape[3:])[self.source]
        return out

    def upright(
        self, cells: Int[np.ndarray, "n 3"], shape: tuple[int, ...]
    ) -> Int[np.ndarray, "n 3"]:
        """Indices of cells of a grid of ``shape`` on the same grid, z up."""
        turned = cells[:, self.axes]
        for axis in self.flip:
            turned[:, axis] = shape[self.axes[axis]] - 1 - turned[:, axis]
        return turned

    def back(self, values: np.ndarray, parts: PartVoxels) -> np.ndarray:
        """Bring an array of the frame (x, y, z, ...) back to the cells of ``parts``."""
        shape = [parts.grid.shape[axis] for axis in self.axes]
        index = [
            a + _scaled(np.arange(n) - first, count, m)
            for (first, count), m, a, n in zip(self.box, self.inside, self.low, shape, strict=True)
        ]
        upright = np.flip(values[np.ix_(*index)], self.flip)
        more = tuple(range(3, values.ndim))
        return np.ascontiguousarray(upright.transpose((*np.argsort(self.axes), *more)))

    def place(self, shape: tuple[int, int, int]) -> Float[np.ndarray, "3 x y z"]:
        """Return places in the object's box, the longest side from -1 to 1."""
        half = max(self.inside) / 2
        lines = [((np.arange(n) + 0.5) - n / 2) / half for n in shape]
        return np.stack(np.meshgrid(*lines, indexing="ij")).astype(np.float32)

    def inputs(self, part: np.ndarray, colours: np.ndarray | None) -> Float[np.ndarray, "8 x y z"]:
        """Input channels: occupancy, colour, its flag, place."""
        occupied = (part >= 0).astype(np.float32)
        colour, flag = np.zeros((*part.shape, 3), np.float32), np.zeros_like(occupied)
        if colours is not None:
            colour, flag = self.forward(colours.astype(np.float32)), occupied
        channels = [occupied[None], np.moveaxis(colour, -1, 0), flag[None], self.place(part.shape)]
        return np.concatenate(channels) * occupied


def _scaled(cells: Int[np.ndarray, "n"], count: int, wanted: int) -> Int[np.ndarray, "n"]:
    """Cell of ``wanted`` over a length at which the centre of each cell of ``count`` lies."""
    return ((cells + 0.5) * wanted / count).astype(np.int64).clip(0, wanted - 1)


def _source(
    upright: Int[np.ndarray, "nx ny nz"],
    box: Sequence[tuple[int, int]],
    inside: tuple[int, int, int],
) -> Int[np.ndarray, "x y z"]:
    """Cell behind each cell of the frame: the nearest, and none of the object is left out.

    Where several meet in one, matter wins over air, and of the parts the smallest.
    """
    nearest = [
        first + _scaled(np.arange(m), m, count)
        for (first, count), m in zip(box, inside, strict=True)
    ]
    source = np.ravel_multi_index(np.ix_(*nearest), upright.shape)
    if all(m >= count for (_, count), m in zip(box, inside, strict=True)):
        return source
    cells = np.argwhere(upright >= 0)
    label = upright[tuple(cells.T)]
    cells = cells[np.argsort(-np.bincount(label)[label], kind="stable")]
    at = (
        _scaled(cells[:, axis] - first, count, inside[axis])
        for axis, (first, count) in enumerate(box)
    )
    source[tuple(at)] = np.ravel_multi_index(tuple(cells.T), upright.shape)  # the last one stays
    return source


# Files of trained weights: float16 safetensors with the network's sizes and normalisation.


def load_checkpoint(path: Path) -> FilmUNet:
    """Read a network in float32 on the CPU.

    Raises InputError: Where the file holds no such network.
    """
    try:
        facts, normalisation, tensors = read_weights(path)
        config = NetworkConfig.from_dict(facts["network"])
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise InputError("inference.checkpoint_film", path=path, error=error) from error
    network = FilmUNet(config, normalisation=normalisation)
    network.load_state_dict(tensors)
    return network.eval()


# Evidence for the network: how well what is seen and what a part is called fit a clause.

VISION = 0.2  # as of simulated evidence of strength .8: chosen beforehand, not fitted


def standard(evidence: Float[np.ndarray, "x y z k"], inside: np.ndarray) -> np.ndarray:
    """Evidence (k, x, y, z) with zero mean and unit deviation inside, 0 outside."""
    within = evidence[inside]
    scaled = (evidence - within.mean()) / np.sqrt(within.var() + 1e-4)  # 1e-4: as in training
    return np.moveaxis(np.where(inside[..., None], scaled, 0), -1, 0).astype(np.float32)


class FilmPredictor:
    """Predicts with the shipped weights, or those of ``weights``."""

    name: ClassVar[str] = "film"
    takes_alpha: ClassVar[bool] = False
    takes_samples: ClassVar[bool] = False

    def __init__(
        self,
        *,
        weights: Path | None = None,
        table: MaterialTable | None = None,
        encoder: TextEncoder | None = None,
    ) -> None:
        self.model = FilmModel(weights=weights, table=table, encoder=encoder)
        self.table = self.model.table
        self.certainty = None if weights else Certainty.load()  # measured of the shipped ones
        self.lookup = (
            Lookup(table=self.table, encoder=encoder) if encoder else lookup_of(self.table)
        )

    def predict(
        self,
        parts: PartVoxels,
        sentence: Sentence,
        *,
        choices: Sequence[PartChoice] | None = None,
        appearance: Callable[[], Appearance] | None = None,
        up: UpAxis = "z",
        alpha: float | None = None,
    ) -> Prediction:
        """Return what words settle, and for all other parts what the network finds there.

        A clause that names a material gives its row; where none does, the values are the network's
        own. See ``Predictor``; ``alpha`` moves nothing here.
        """
        if choices is None:
            bound = bind(sentence, parts.part_labels)
            choices = self.lookup.settle(parts.part_labels, bound, volumes=parts.volumes).choices
        there = set(np.unique(parts.part).tolist())
        left_open = [i for i, choice in enumerate(choices) if not choice.settled and i in there]
        seen = appearance() if appearance else None
        heard = hear(sentence, parts.part_labels, self.table, self.model.words)
        found = self.model.infer(parts, heard, up=up, appearance=seen)
        if found.of_pieces:  # the text speaks of more parts than there are
            pieces = partition(parts, left_open, found.shares, found.clauses)
        else:
            owners = match_clauses(parts, left_open, found.shares, found.unbound)
            pieces = Partition(parts, tuple(range(len(owners))), owners)
        decided = [
            replace(choices[parent], part=name)
            for parent, name in zip(pieces.parents, pieces.parts.part_names, strict=True)
        ]
        for i, (parent, owner) in enumerate(zip(pieces.parents, pieces.owners, strict=True)):
            if parent in left_open:
                decided[i] = self._choose(decided[i], found, pieces.parts.part == i, owner)
        # The choices' values, and the network's own cell by cell where it decided alone
        field = field_of(pieces.parts, decided)
        own = [i for i, choice in enumerate(decided) if choice.network]
        learned = np.isin(pieces.parts.part, own)
        values = {
            name: np.where(learned, value, getattr(field, name))
            for name, value in zip(FIELDS, found.normalisation.physical(found.values), strict=True)
        }
        field = replace(field, ranges=None if learned.any() else field.ranges, **values)
        unbound = unbound_by([*choices, *decided], sentence.clauses)
        return Prediction(pieces.parts, pieces.parents, field, tuple(decided), unbound)

    def field(
        self,
        parts: PartVoxels,
        sentence: Sentence,
        *,
        up: UpAxis = "z",
        appearance: Appearance | None = None,
        names: bool = True,
    ) -> MaterialField:
        """Return what the network finds by itself, no value looked up; see ``FilmModel.infer``."""
        heard = hear(sentence, parts.part_labels, self.table, self.model.words)
        found = self.model.infer(parts, heard, up=up, appearance=appearance, names=names, turns=1)
        E, nu, rho = found.normalisation.physical(found.values)
        labels = parts.part.astype(np.int64)
        return MaterialField(
            parts.grid, parts.occupied, E, nu, rho, part=labels, part_names=parts.part_names
        )

    def _choose(
        self, words: PartChoice, found: Inference, cells: np.ndarray, owner: int | None
    ) -> PartChoice:
        """Choose for a piece what its clause names, else the row nearest to the values found.

        Of what ``words`` made likeliest stays whether the text was understood.
        """
        clause = None if owner is None else found.clauses[owner]
        shares = found.shares[cells].mean(axis=0)
        share = float(shares[-1 if owner is None else owner])
        text = None if clause is None else clause.text
        measured = text is not None and owner == shares.argmax() and not found.of_pieces
        certainty = self.certainty.of(share) if self.certainty and measured else None
        spread = float(found.spread[cells].mean())
        binding = Binding(text, share, int(cells.sum()), spread, certainty)
        why = f"network: {'nothing text' if text is None else repr(text)}"
        if certainty is not None:
            why += Note("predictor.right_about", certainty=10 * certainty)
        if clause is not None and clause.material:
            return replace(
                self.lookup.of_clause(words.part, clause, why), weight=share, settled=False,
                binding=binding, unknown=words.unknown, guessed=words.unknown is not None,
            )  # fmt: skip
        mean = found.values[cells].mean(axis=0)
        value = MaterialValue(*map(float, found.normalisation.physical(mean)))
        row = nearest_row(self.table, found.normalisation, mean)
        return PartChoice(
            words.part, row, value, share, 0.5, why, settled=False, binding=binding,
            network="FiLM", unknown=words.unknown,
            guessed=clause is None or words.unknown is not None,
        )  # fmt: skip


# How often a share of the network's is right: said only where it was found to hold.

SHIPPED = Path(__file__).parents[1] / "weights" / "film_certainty.json"

_LEAST = 1e-4  # of a share, for its log-odds: shares are means over cells and views


class Calibration(NamedTuple):
    """Certainty = logistic(slope log-odds(share) + offset), Platt (1999)."""

    slope: float
    offset: float

    def __call__(self, share: float) -> float:
        """Return how often an answer with such a share of a part is right."""
        return float(1 / (1 + np.exp(-(self.slope * log_odds(share) + self.offset))))


@dataclass(frozen=True)
class Certainty:
    """A calibration, and the spans of certainty in which other objects bore it out.

    ``benchmarks/reliability.py`` fits and checks it; the card of the weights shows both.
    """

    calibration: Calibration
    spans: tuple[tuple[float, float], ...] = ()

    @classmethod
    def load(cls, path: Path = SHIPPED) -> Certainty:
        """Return that of the shipped weights."""
        found = json.loads(path.read_text(encoding="utf-8"))
        calibration = Calibration(found["slope"], found["offset"])
        return cls(calibration, tuple((low, high) for low, high in found["spans"]))

    def of(self, share: float) -> float | None:
        """Return how often an answer with such a share is right, None where nobody knows."""
        certainty = self.calibration(share)
        known = any(low <= certainty <= high for low, high in self.spans)
        return certainty if known else None


def log_odds(share: np.ndarray | float) -> np.ndarray:
    """Return log(p / (1 - p)) of shares in [0, 1]."""
    share = np.asarray(np.clip(share, _LEAST, 1 - _LEAST))
    return np.asarray(np.log(share / (1 - share)))
