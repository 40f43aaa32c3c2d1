"""The UniPixie predictor: what words leave open, from what is seen, anywhere from soft to stiff.

The network finds the likeliest matter of what it sees, the range of that, and samples.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ...fem.errors import InputError
from ...fem.mpm.materials import MaterialClass
from ...fem.note import Note
from ...fem.table import MaterialTable, MaterialValue, load_table
from ..appearance.features import Appearance
from ..asset import UpAxis, upright
from ..encoders import TextEncoder
from ..field import Normalisation, Ranges, read_weights
from ..grid import PartVoxels
from ..prediction import PartChoice, Prediction
from ..resolve.resolve import Lookup, lookup_of, nearest_row
from ..text.clauses import Sentence, bind
from ..text.parts import NamedPart, own_name, vocabulary_of
from .network import FEATURE, UniPixie, UniPixieConfig, Voxels, coherent_noise, known_of

if TYPE_CHECKING:
    import torch


WEIGHTS = Path(__file__).parents[1] / "weights" / "unipixie.safetensors"
ANY = -1.0  # asks for a plausible matter instead of a place in the range
CHUNK = 16_384  # tokens decoded at once: 8 MB an activation
SAMPLE_STEPS = 4  # of the flow, where it is to keep its spread
MEANT = 128  # tokens of a part at most that tell how a sample differs from the mean of all
ALL = slice(None)


class Found:
    """The network's answers for one asset; values are normalised log E, nu, log rho of tokens."""

    def __init__(self, loaded: Loaded, cube: Cube, voxels: Voxels) -> None:
        import torch

        self.network, self.normalisation, self.calibration = loaded
        self.cube, self.voxels = cube, voxels
        with torch.inference_mode():
            self.latents = self.network.encode(voxels)

    @cached_property
    def likeliest(self) -> tuple[Float[np.ndarray, "n 3"], Int[np.ndarray, "n"]]:
        """Mean of what is plausible, and the likeliest class, of every token."""
        # At the flow's start an x1-prediction knows no noise: it is the mean of all ends.
        return self._decode(ANY, self._noise(None), steps=1)

    @cached_property
    def ends(self) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"]]:
        """Soft and stiff end of the range of every token, E in order."""
        noise, margin = self._noise(None), np.array([self.calibration.margin, 0, 0])
        # At the flow's start: there training sought the ends of what is uncertain.
        soft, stiff = (self._decode(alpha, noise, steps=1)[0] for alpha in (0.0, 1.0))
        low, high = np.minimum(soft, stiff) - margin, np.maximum(soft, stiff) + margin
        return low.clip(-1, 1), high.clip(-1, 1)

    def at(self, alpha: float) -> Float[np.ndarray, "n 3"]:
        """Values at a place of the range; E never falls as ``alpha`` rises."""
        soft, stiff = self.ends
        return soft + alpha * (stiff - soft)

    def sample(self, seed: int, tokens: slice | np.ndarray = ALL) -> Float[np.ndarray, "n 3"]:
        """One plausible matter of some tokens: coherent within a part."""
        noise = self._noise(seed)[:, tokens]
        drawn = self._decode(ANY, noise, steps=SAMPLE_STEPS, tokens=tokens)[0]
        mean = self.likeliest[0][tokens]
        return (mean + self.calibration.spread * (drawn - mean)).clip(-1, 1)

    def samples(self, count: int, seed: int) -> Float[np.ndarray, "count parts 3"]:
        """Means over the parts of so many plausible matters; more of them begin with these.

        How a sample differs from the mean of all is told by some tokens of a part alone.
        """
        part, states = self.cube.part, np.random.SeedSequence(seed).generate_state(count)
        parts = range(int(part.max()) + 1)
        few = [np.flatnonzero(part == p) for p in parts]
        few = [
            some[np.linspace(0, len(some) - 1, MEANT).astype(int)] if len(some) > MEANT else some
            for some in few
        ]
        tokens = np.concatenate(few)
        mean = np.array([_mean(self.likeliest[0][part == p]) for p in parts])
        drawn = np.empty((count, len(few), 3))
        for values, state in zip(drawn, states.tolist(), strict=True):
            apart = self.sample(state, tokens) - self.likeliest[0][tokens]
            ends = np.cumsum([len(some) for some in few])[:-1]
            values[:] = mean + [_mean(some) for some in np.split(apart, ends)]
        return drawn.clip(-1, 1)

    def _noise(self, seed: int | None) -> torch.Tensor:
        """Where the flow begins, (1, n, 3): zero, the middle of the noise, without a seed."""
        import torch

        count = len(self.cube.part)
        if seed is None:
            return torch.zeros(1, count, 3)
        dice = torch.Generator().manual_seed(seed)
        shared = torch.randn(int(self.cube.part.max()) + 1, 3, generator=dice)
        own = torch.randn(count, 3, generator=dice)
        return coherent_noise(shared[self.cube.part], own)[None]

    def _decode(
        self, alpha: float, noise: torch.Tensor, *, steps: int = 0, tokens: slice | np.ndarray = ALL
    ) -> tuple[Float[np.ndarray, "n 3"], Int[np.ndarray, "n"]]:
        """Values and classes of tokens, some at a time: each sees the latents alone."""
        import torch

        values, classes = [], []
        given = torch.tensor([alpha])
        place, own = self.voxels.place[:, tokens], self.voxels.own[:, tokens]
        with torch.inference_mode():
            for begin in range(0, noise.shape[1], CHUNK):
                some = slice(begin, begin + CHUNK)
                voxels = self.voxels._replace(place=place[:, some], own=own[:, some])
                found, logits = self.network.sample_matter(
                    self.latents, voxels, given, noise[:, some], steps=steps
                )
                values.append(found[0].numpy())
                classes.append(logits[0].argmax(-1).numpy())
        return np.concatenate(values).clip(-1, 1), np.concatenate(classes)


@contextmanager
def one_torch_thread() -> Iterator[None]:
    """Within, torch uses one thread: of so small a network two only wait for each other."""
    import torch

    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def _mean(values: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "3"]:
    """Mean over tokens, NaN of none: a part without a cell."""
    return values.mean(axis=0) if len(values) else np.full(3, np.nan)


def voxels_on(
    network: UniPixie,
    cube: Cube,
    parts: PartVoxels,
    names: Float[np.ndarray, "parts 384"],
    named: Bool[np.ndarray, "parts"],
    seen: Appearance,
) -> Voxels:
    """Bring what is known of an asset onto the cube, as the network reads it.

    Of embeddings of what the asset calls its parts those that are not ``named`` say nothing; what
    is ``seen`` of the cells stands in for them.
    """
    import torch

    inside = parts.occupied
    label = parts.part[inside]
    colours = np.zeros((len(label), 3)) if seen.colours is None else seen.colours[inside]
    lifted = None
    if seen.features is not None and seen.features.shape[-1] == FEATURE:
        lifted = seen.features[inside]
    found = []
    with torch.inference_mode():
        for begin in range(0, len(label), CHUNK):
            some = label[begin : begin + CHUNK]
            vectors, known = names[some], named[some]
            if lifted is not None:
                vectors = np.where(known[:, None], vectors, lifted[begin : begin + CHUNK])
                known = np.ones_like(known)
            shown = np.full(len(some), seen.colours is not None)
            arrays = (vectors, known, colours[begin : begin + CHUNK], shown)
            feature, flag, colour, lit = (torch.from_numpy(np.asarray(a)) for a in arrays)
            found.append(network.project(known_of(feature.float(), flag, colour.float(), lit)))
    learned = cube.tokens(torch.cat(found).numpy())
    own = torch.from_numpy(learned.astype(np.float32))
    grid = torch.zeros(cube.cells**3, own.shape[1])
    share = torch.from_numpy(cube.share.astype(np.float32))[:, None]
    grid.index_add_(0, torch.from_numpy(cube.at), own * share)
    side = (cube.cells,) * 3
    place = torch.from_numpy(cube.place.astype(np.float32))
    return Voxels(grid.T.reshape(1, -1, *side), place[None], own[None])


# The cells of an asset as tokens on the network's cube: upright, in the middle, as in training.

PAD = 1  # empty cells of the cube on either side of the longest


@dataclass(frozen=True, eq=False)
class Cube:
    """Tokens: what of one part lies in one cell of the cube.

    cells: Cells of the cube along a side.
    token: Tokens of each occupied cell of the asset, in C order: several where the cube is finer.
    place: Mean place of each token in [-1, 1], z up.
    part: Part of each token.
    at, share: Flat cell of the cube of each token, x the slowest, and its share of what lies there.
    """

    cells: int
    token: Int[np.ndarray, "m t"]
    place: Float[np.ndarray, "n 3"]
    part: Int[np.ndarray, "n"]
    at: Int[np.ndarray, "n"]
    share: Float[np.ndarray, "n"]

    @classmethod
    def of(cls, parts: PartVoxels, up: UpAxis, *, cells: int) -> Cube:
        """Put the occupied cells of ``parts`` on a cube of ``cells``."""
        # Centres [m] of the occupied cells, divided until they are as small as the cube's
        centres = parts.grid.centers()[parts.occupied]
        longest = round(float(np.ptp(centres, axis=0).max()) / parts.grid.h) + 1
        times = ceil(cells / longest)
        line = ((np.arange(times) + 0.5) / times - 0.5) * parts.grid.h
        offsets = np.stack(np.meshgrid(line, line, line, indexing="ij"), -1).reshape(-1, 3)
        points = upright((centres[:, None] + offsets), up)
        low, high = points.min((0, 1)), points.max((0, 1))
        gap = parts.grid.h / round(points.shape[1] ** (1 / 3))
        half = (float((high - low).max()) + gap) / 2 * cells / (cells - 2 * PAD)
        place = (points - (low + high) / 2) / half
        x, y, z = np.moveaxis(((place + 1) / 2 * cells).astype(np.int64), -1, 0)
        label = parts.part[parts.occupied][:, None]
        pair = ((x * cells + y) * cells + z) * len(parts.part_names) + label
        pair, token = np.unique(pair, return_inverse=True)
        at, part = np.divmod(pair, len(parts.part_names))
        flat = token.reshape(-1)
        count = np.bincount(flat)
        there = np.bincount(at, weights=count)
        axes = (np.bincount(flat, axis) for axis in place.reshape(-1, 3).T)
        mean = np.stack(list(axes), 1) / count[:, None]
        return cls(cells, token.reshape(points.shape[:2]), mean, part, at, count / there[at])

    def tokens(self, values: Float[np.ndarray, "m c"]) -> Float[np.ndarray, "n c"]:
        """Means over each token's cells of values of the occupied cells."""
        flat, times = self.token.reshape(-1), self.token.shape[1]
        sums = (np.bincount(flat, np.repeat(column, times)) for column in values.T)
        return np.stack(list(sums), 1) / np.bincount(flat)[:, None]

    def back(self, values: Float[np.ndarray, "n c"]) -> Float[np.ndarray, "m c"]:
        """Bring values of tokens to the occupied cells."""
        return values[self.token].mean(axis=1)


# Files of trained weights: float16 safetensors with the network's sizes and normalisation.


class RangeCalibration(NamedTuple):
    """What was measured of a network's ranges and samples, and mends them.

    The ends of a range move outwards by ``margin`` (of normalised log E), so that 95 % of parts lie
    between them (conformal prediction, Vovk et al. 2005); samples lie ``spread`` times further from
    their mean, so that their middle 80 % holds the truth as often.
    """

    margin: float = 0.0
    spread: float = 1.0


class Loaded(NamedTuple):
    """A network with what its numbers mean and how far its ranges hold."""

    network: UniPixie
    normalisation: Normalisation
    calibration: RangeCalibration


def load_unipixie(path: Path) -> Loaded:
    """Read a network, in float32 on the CPU.

    Raises InputError: Where the file holds no such network.
    """
    try:
        facts, normalisation, tensors = read_weights(path)
        config = UniPixieConfig(**facts["network"])
        calibration = RangeCalibration(**facts["calibration"])
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise InputError("inference.checkpoint_unipixie", path=path, error=error) from error
    network = UniPixie(config)
    network.load_state_dict(tensors)
    return Loaded(network.eval(), normalisation, calibration)


class UniPixiePredictor:
    """Predicts with the shipped weights, or those of ``weights``.

    Of every part that it decides it draws so many plausible ``samples``, from ``seed`` on.
    """

    name: ClassVar[str] = "unipixie"
    takes_alpha: ClassVar[bool] = True
    takes_samples: ClassVar[bool] = True

    def __init__(
        self,
        *,
        weights: Path | None = None,
        table: MaterialTable | None = None,
        encoder: TextEncoder | None = None,
        samples: int = 0,
        seed: int = 0,
    ) -> None:
        self.table = table or load_table()
        self._weights = weights or WEIGHTS
        self.samples, self.seed = samples, seed
        self.lookup = (
            Lookup(table=self.table, encoder=encoder) if encoder else lookup_of(self.table)
        )

    @cached_property
    def loaded(self) -> Loaded:
        """The network and what its numbers mean, read on the first inference."""
        return load_unipixie(self._weights)

    @one_torch_thread()
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
        """Return what words settle, and for all other parts what the network finds.

        See ``Predictor``. Without ``alpha`` a part gets the mean of what is plausible; with it, a
        place between the soft and the stiff end of its range.
        """
        if choices is None:
            choices = self.lookup.settle(
                parts.part_labels, bind(sentence, parts.part_labels), alpha=alpha,
                volumes=parts.volumes,
            ).choices  # fmt: skip
        found = self.find(parts, appearance() if appearance else Appearance(), up=up)
        there = set(np.unique(parts.part).tolist())
        left_open = [i for i, c in enumerate(choices) if not c.settled and i in there]
        decided, physical = list(choices), found.normalisation.physical
        drawn = physical(found.samples(self.samples, self.seed))
        ends = {}
        for i in left_open:
            mine = found.cube.part == i
            draws = tuple(
                MaterialValue(*map(float, one))
                for one in zip(*(v[:, i] for v in drawn), strict=True)
            )
            # The mean of the network's values over the part, and the row nearest to it
            values = found.likeliest[0] if alpha is None else found.at(alpha)
            mean = values[mine].mean(axis=0)
            value = MaterialValue(*map(float, physical(mean)))
            row = nearest_row(self.table, found.normalisation, mean, grades=False)
            ends[i] = [end[mine].mean(axis=0) for end in found.ends]
            soft, stiff = (end[0] for end in ends[i])
            place = 0.5 if alpha is None and stiff <= soft else alpha
            if place is None:
                place = float(np.clip((mean[0] - soft) / (stiff - soft), 0, 1))
            votes = np.bincount(found.likeliest[1][mine])
            words = choices[i]
            decided[i] = PartChoice(
                words.part, row, value, words.weight, place,
                Note("predictor.network_looks"), settled=False, network="UniPixie",
                guessed=True, unknown=words.unknown, draws=draws,
                matter=MaterialClass(int(votes.argmax())).name.lower(),
            )  # fmt: skip
        made = Prediction.of(parts, decided, sentence, alpha=alpha)
        field = made.field
        if field.ranges is None or field.part is None:
            return made
        ranges = [np.array(values) for values in field.ranges]
        for part, both in ends.items():
            for values, pair in zip(ranges, zip(*map(physical, both), strict=True), strict=True):
                values[field.part == part] = pair
        return replace(made, field=replace(field, ranges=Ranges(*ranges)))

    def find(self, parts: PartVoxels, appearance: Appearance, *, up: UpAxis = "z") -> Found:
        """Return all that the network finds of an asset: likeliest, range, samples, classes."""
        vocabulary = vocabulary_of(self.table)
        said = [own_name(NamedPart.of(words, vocabulary, 0.0)) for words in parts.part_labels]
        names = self.lookup.kernel.encoder.text([words or "object" for words in said])
        named = np.array([bool(words) for words in said])
        network = self.loaded.network
        cube = Cube.of(parts, up, cells=network.config.cells)
        return Found(self.loaded, cube, voxels_on(network, cube, parts, names, named, appearance))
