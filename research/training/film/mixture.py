"""What the batches of training are mixed of."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Mixture:
    """How samples are drawn; all numbers are probabilities unless they say otherwise."""

    composite: float = 0.25
    relabelled: float = 0.1
    real: float = 0.15
    no_text: float = 0.1
    mention: float = 0.6
    whole: float = 0.2
    pair: float = 0.2
    object_name: float = 0.5
    names: float = 0.25
    vision: float = 0.5
    vision_without_shape: float = 0.85
    colour: float = 0.85
    features: float = 0.0  # an image encoder's are seen
    looked: float = 0.7  # of the features of real slots: what the encoder saw, not simulated
    strength: float = 4.0  # evidence is drawn with strengths from 0 to this
    no_hints: float = 0.15  # the lexicon is silent on a whole object
    augment: float = 1.0  # of the colours of real slots
    dressed: float = 0.0  # of the real ones: procedural shapes in slots of real objects
    doubt: float = 0.0  # of the binding of real objects
    noise: tuple[float, float, float] = (0.7, 0.7, 0.7)  # of evidence: by part, smooth, by voxel
