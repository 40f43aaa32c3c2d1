"""What the network finds on the cells of an asset: clauses bound to cells, values, how surely.

Every clause of the text is embedded alone and bound to voxels by what the network sees of shape
and colour, by the asset's own names, and by the features of a vision-language encoder if given.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ...fem.scene.materials import MaterialTable, load_table
from ..asset import UpAxis
from ..encoders.protocol import TextEncoder
from ..hearing.clauses import HeardClause
from ..hearing.hints import Heard, HintedEncoder
from ..images.appearance import Appearance
from ..matter.evidence import by_looks, matters, moved, told_values
from ..matter.pieces import MOST, by_look
from ..normalisation import DEFAULT, Normalisation
from ..voxels import PartVoxels, pooled
from .evidence import VISION, standard
from .frame import Frame

if TYPE_CHECKING:
    from .config import VoxelScene
    from .unet import FilmUNet

WEIGHTS = Path(__file__).parents[1] / "weights" / "film.safetensors"


class Inference(NamedTuple):
    """What the network finds on the cells of the parts.

    ``values`` (nx, ny, nz, 3) are log E, nu, log rho in the ranges of ``normalisation``; ``shares``
    (nx, ny, nz, K + 1) say how surely each of the ``clauses`` speaks of a cell, the last one that
    none does; ``spread`` (nx, ny, nz) is the deviation of log10 E between views of the object from
    several sides. ``of_pieces`` and ``unbound`` are as ``Heard`` has them.
    """

    clauses: Sequence[HeardClause]
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
        shares[inside] = by_looks(
            self.shares[inside], matters(self.clauses), cells, looks, piece,
            parts=not self.of_pieces,
        )  # fmt: skip
        told = told_values(self.clauses, table, self.normalisation)
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
        from .checkpoint import load_checkpoint

        return load_checkpoint(self._weights)

    @cached_property
    def words(self) -> HintedEncoder:
        """The same for what the network hears: sentence, hints of the lexicon, subject."""
        return HintedEncoder(self.encoder, normalisation=self.network.normalisation)

    def infer(
        self,
        parts: PartVoxels,
        heard: Heard,
        *,
        up: UpAxis = "z",
        appearance: Appearance | None = None,
        names: bool = True,
        turns: int = 4,
    ) -> Inference:
        """Return what the network finds on every cell.

        Parameters
        ----------
        heard
            What is said of the parts, as ``words`` embeds it.
        up
            The axis that points up.
        appearance
            Colours and features of the cells, if known.
        names
            Whether the asset's own names may be read.
        turns
            Views from so many sides are averaged; their spread is reported.
        """
        frame = Frame.of(parts, up)
        scene = self._scene(parts, frame, heard, appearance or Appearance(), names)
        values, shares = self._run(scene, frame, turns)
        normalisation = self.network.normalisation
        spread = values[..., 0].std(axis=0) * normalisation.span[0] / 2
        shares = shares[..., [*range(len(heard.clauses)), -1]]  # without the slot of a silent text
        found = Inference(
            heard.clauses,
            frame.back(values.mean(axis=0), parts),
            frame.back(shares, parts),
            frame.back(spread, parts),
            normalisation,
            heard.of_pieces,
            heard.unbound,
        )
        # Otherwise each part is of one matter.
        found = found if heard.of_pieces else found.pooled(parts)
        return found.seen(parts, frame, appearance or Appearance(), self.table)

    def _scene(
        self,
        parts: PartVoxels,
        frame: Frame,
        heard: Heard,
        appearance: Appearance,
        names: bool,
    ) -> VoxelScene:
        """Put everything that is known into the tensors of the network."""
        import torch

        from .config import VoxelScene

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
