"""The networks as rows of the evaluation, whole or deprived of something."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from ...fem.table import load_table
from ...predictors.appearance.features import Appearance
from ...predictors.encoders import TextEncoder
from ...predictors.encoders.minilm import MiniLM
from ...predictors.field import Normalisation
from ...predictors.film.predictor import VISION, standard
from ...predictors.film.words import name_evidence, subject
from ...predictors.grid import Grid, PartVoxels, pooled
from ...predictors.matter import by_appearance, by_look, matters, moved, typed_values
from ...predictors.partition import match_clauses
from ...predictors.text.clauses import Clause
from ...predictors.text.parts import NamedPart, Vocabulary
from .held_out import HeldOutObject
from .parser import clause_of, listen
from .rows import Setting, VoxelPredictor

if TYPE_CHECKING:
    from ...predictors.film.unet import FilmUNet, Output, VoxelScene


@dataclass(frozen=True)
class FilmRow:
    """The network, with what a row does without taken away from what it is given.

    ``names``: the asset's own names are heard. ``text``: so are the clauses. ``hints``: the
    lexicon's values and the subjects of the clauses. ``colour``, ``vision``: colours are seen, and
    what an image encoder sees. ``parts``: which cells are of one part is known. ``looks``: so is
    how well each kind of matter fits what is seen of a cell. ``assigned``: a part has the value of
    the one material that its clause names, as `assign` gives it, not the mean of what it may be.
    """

    names: bool = False
    text: bool = True
    hints: bool = True
    colour: bool = True
    vision: bool = True
    parts: bool = True
    looks: bool = True
    assigned: bool = False

    def build(self, setting: Setting) -> VoxelPredictor:
        """Return the network with the weights of the setting."""
        import torch

        from ...predictors.film.predictor import WEIGHTS, load_checkpoint

        network: FilmUNet = load_checkpoint(setting.weights or WEIGHTS)
        encoder, vocabulary = MiniLM(), Vocabulary(load_table().phrases)

        def predict(example: HeldOutObject):
            scene = self.deprived(example.batch.scene, encoder.dim)
            if self.vision:
                scene = with_vision(scene, example, setting.words or encoder)
            if example.names:
                scene = with_slot_names(scene, example, encoder, vocabulary)
            with torch.inference_mode():
                output = network(scene)
            output = pooled_by_part(output, scene) if self.parts else output
            scale = network.normalisation
            if self.looks and self.text and example.looks is not None:
                looks = example.looks.astype(np.float64)
                output = with_looks(output, example, looks, scale, parts=self.parts)
            return with_one_matter(output, example, scale) if self.assigned else output

        return predict

    def deprived(self, scene: VoxelScene, dim: int) -> VoxelScene:
        """Return the scene without what the row does without; ``dim`` is that of a sentence."""
        import torch

        if not self.text:
            nothing = torch.zeros_like(scene.clause_mask)
            silent = torch.zeros_like(scene.has_object)
            scene = scene._replace(clause_mask=nothing, has_object=silent)
        if not self.hints:
            sentence = torch.arange(scene.clauses.shape[-1]) < dim
            scene = scene._replace(clauses=scene.clauses * sentence)
        if not self.colour:
            inputs = scene.inputs.clone()
            inputs[:, 1:5] = 0  # colour and its flag: occupancy and place stay
            scene = scene._replace(inputs=inputs)
        return scene


FILM, FILM_NAMES, ASSIGNED = FilmRow(), FilmRow(names=True), FilmRow(assigned=True)
NO_TEXT, NO_HINTS, VOXELS = FilmRow(text=False), FilmRow(hints=False), FilmRow(parts=False)
VOXELS_NO_LOOKS, NO_LOOKS = FilmRow(parts=False, looks=False), FilmRow(looks=False)
RGB, NO_FEATURES = FilmRow(vision=False), FilmRow(vision=False, colour=False)


@dataclass(frozen=True)
class UniPixieRow:
    """The network of ranges: it hears no clause, and sees colours and, if given, features.

    ``names``: what the parts are called is known.
    """

    names: bool = False

    def build(self, setting: Setting) -> VoxelPredictor:
        """Return the shipped network."""
        import torch

        from ...predictors.unipixie.predictor import UniPixiePredictor

        predictor = UniPixiePredictor()

        def predict(example: HeldOutObject):
            scene = example.batch.scene
            part = scene.part[0].numpy()
            slots = example.names or [f"object {i}" for i in range(int(part.max()) + 1)]
            parts = _part_voxels(part, slots)
            colours = scene.inputs[0, 1:4].movedim(0, -1).numpy()
            seen = Appearance(colours if scene.inputs[0, 4].any() else None)
            found = predictor.find(parts, seen)
            values = np.zeros((*part.shape, 3), dtype=np.float32)
            values[part >= 0] = found.cube.back(found.likeliest[0])
            means = torch.from_numpy(pooled(values, part)).float()
            return means.movedim(-1, 0)[None], None

        return predict


UNIPIXIE, UNIPIXIE_NAMES = UniPixieRow(), UniPixieRow(names=True)


def pooled_by_part(output: Output, scene: VoxelScene) -> Output:
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


def with_looks(
    output: Output,
    example: HeldOutObject,
    looks: Float[np.ndarray, "n look"],
    normalisation: Normalisation,
    *,
    parts: bool,
) -> Output:
    """Return shares and values with what looks say of clauses about matter: as at run time."""
    import torch

    part = example.batch.scene.part[0].numpy()
    inside = part >= 0
    shares, values = (
        x[0].movedim(0, -1).float().numpy()[inside].astype(np.float64)
        for x in (output.logits.softmax(1), output.values)
    )
    clauses = _clauses(example)
    piece = np.unique(part[inside], return_inverse=True)[1] if parts else by_look(looks)
    dealt = by_appearance(shares, matters(clauses), np.argwhere(inside), looks, piece, parts=parts)
    told = typed_values(clauses, load_table(), normalisation)
    columns = []
    for whole, found in (
        (output.values, moved(values, dealt - shares, told)),
        (output.logits, np.log(dealt.clip(min=1e-9))),  # 1e-9: a share of nothing has a log too
    ):
        column = whole.float().clone()
        column[0, :, torch.from_numpy(inside)] = torch.from_numpy(found.T).float()
        columns.append(column)
    return output._replace(values=columns[0], logits=columns[1])


def with_one_matter(output: Output, example: HeldOutObject, normalisation: Normalisation) -> Output:
    """Return values of the materials that are named: of a part, by the one clause it is given.

    With more clauses than parts each cell has the one likeliest there. The binding is that, too.
    """
    import torch

    part = example.batch.scene.part[0].numpy()
    shares = output.logits.softmax(1)[0].movedim(0, -1).float().numpy()
    clauses = _clauses(example)
    here, names = [k for k, said in enumerate(example.said) if said], int(part.max()) + 1
    owner = shares.argmax(axis=-1)
    if len(here) <= names:
        parts = _part_voxels(part, [f"part {i}" for i in range(names)])
        found = match_clauses(parts, range(names), shares, here)
        owner = np.array([len(clauses) if one is None else one for one in found])[part]
    told = np.vstack([typed_values(clauses, load_table(), normalisation), np.full(3, np.nan)])
    known = (part >= 0) & np.isfinite(told[owner, 0])
    values = output.values.float().clone()
    values[0, :, torch.from_numpy(known)] = torch.from_numpy(told[owner[known]].T).float()
    logits = torch.nn.functional.one_hot(torch.from_numpy(owner), shares.shape[-1])
    return output._replace(values=values, logits=logits.movedim(-1, 0)[None].float())


def with_vision(scene: VoxelScene, example: HeldOutObject, encoder: TextEncoder) -> VoxelScene:
    """Return the scene with the evidence of an image encoder, at half the resolution."""
    import torch

    here = [k for k, said in enumerate(example.said) if said]
    if not here or example.features is None:
        return scene
    half = tuple(n // 2 for n in scene.part.shape[1:])
    cells = tuple(example.features.cells.T)
    cosine = np.zeros((*half, len(here)), dtype=np.float32)
    words = encoder.text([subject(example.said[k]) for k in here])
    cosine[cells] = example.features.values.astype(np.float32) @ words.T
    inside = np.zeros(half, dtype=bool)
    inside[cells] = True
    features = torch.zeros(1, example.features.values.shape[1], *half)
    features[0, :, *cells] = torch.from_numpy(example.features.values.astype(np.float32).T)
    evidence = torch.zeros(*scene.evidence.shape[:3], *half)
    evidence[0, 0, here] = torch.from_numpy(standard(cosine, inside))
    reliability = scene.reliability.clone()
    reliability[0, 0] = VISION
    return scene._replace(evidence=evidence, reliability=reliability, features=features)


def with_slot_names(
    scene: VoxelScene, example: HeldOutObject, encoder: TextEncoder, vocabulary: Vocabulary
) -> VoxelScene:
    """Return the scene with the evidence of names as it is gathered at run time."""
    import torch

    from ...predictors.film.unet import halve

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


def _part_voxels(part: np.ndarray, names: Sequence[str]) -> PartVoxels:
    """The cells of an object as parts, in a cube of one metre."""
    return PartVoxels(Grid(np.zeros(3), 1 / len(part), part.shape), part, tuple(names))


def _clauses(example: HeldOutObject) -> list[Clause]:
    """What every slot says, an empty clause where it says nothing."""
    return [_one_clause(said) if said else clause_of("") for said in example.said]


def _one_clause(said: str) -> Clause:
    """Read as one what was written as one: "use velvet for the fabric" speaks of fabric."""
    first, *others = [*listen(said, load_table()).clauses, clause_of(said)]
    spoken_of = [part for clause in others for part in (clause.phrase, *clause.parts) if part]
    return clause_of(said, first.material, (*first.parts, *spoken_of))
