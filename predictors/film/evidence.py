"""Evidence for the network: how well what is seen and what a part is called fit a clause."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from ..encoders.protocol import TextEncoder
from ..language.binding import NamedPart, nouns_of, of_pieces, overlap
from ..language.clauses import Clause
from ..language.kinds import kind_of
from ..voxels import PartVoxels

# How far names are to be trusted, on the scale of training: a word in common, or only a likeness.
SHARED_WORD, LIKE_WORD = 1.0, 0.5
VISION = 0.2  # as of simulated evidence of strength .8: chosen beforehand, not fitted
SAME_MATTER = 2.0  # "the metal is iron" of a part that the asset calls chrome: as a word of a label


def own_name(part: NamedPart) -> str:
    """Words of a part with the material its labels tell, "" where they tell nothing."""
    word = "" if part.spoken == "object" else part.spoken
    material = part.material or ""
    return word if material in word else f"{word} {material}".strip()


def name_evidence(
    clauses: Sequence[Clause], named: Sequence[NamedPart], encoder: TextEncoder
) -> tuple[Float[np.ndarray, "clauses parts"], float]:
    """How well each part's own name fits each clause, and how far that is to be trusted."""
    score = np.clip(overlap(clauses, named), 0, 3)
    score = np.where(score > 0, score, SAME_MATTER * _same_matter(clauses, named))
    if score.any():
        return score, SHARED_WORD
    if of_pieces(clauses, named):  # their part's name is like one clause, and they are not
        return np.zeros_like(score), 0.0
    nouns = encoder.text([" ".join(c.parts) or c.text for c in clauses])
    names = encoder.text([own_name(part) for part in named])
    return nouns @ names.T, LIKE_WORD


def _same_matter(clauses: Sequence[Clause], named: Sequence[NamedPart]) -> np.ndarray:
    """Whether a clause speaks of the kind of matter that a part's names tell (clauses, parts)."""
    asked = [{kind_of(noun) for noun in nouns_of(clause)} for clause in clauses]
    own = [kind_of(" ".join((part.name, *part.labels))) for part in named]
    return np.array([[kind is not None and kind in kinds for kind in own] for kinds in asked])


def standard(evidence: Float[np.ndarray, "x y z k"], inside: np.ndarray) -> np.ndarray:
    """Evidence (k, x, y, z) with zero mean and unit deviation inside, 0 outside."""
    within = evidence[inside]
    scaled = (evidence - within.mean()) / np.sqrt(within.var() + 1e-4)  # 1e-4: as in training
    return np.moveaxis(np.where(inside[..., None], scaled, 0), -1, 0).astype(np.float32)


def with_names(parts: PartVoxels, names: Sequence[str]) -> PartVoxels:
    """Return the parts under other names: to hide what they are called, or to tell it."""
    return replace(parts, part_names=tuple(names), labels=())
