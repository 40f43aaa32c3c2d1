"""What the asset itself says: its node, group and material names as vectors, per part and cell."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from ..encoders.protocol import Encoder
from ..hearing.kinds import bare_words


def name_embeddings(
    labels: Sequence[Sequence[str]], encoder: Encoder
) -> Float[np.ndarray, "parts dim"]:
    """Unit embedding of everything that is said of each part; 0 for a part without words.

    Names are read as people mean them: "Metal_Chrome.001" as "metal chrome".
    """
    sentences = [" ".join(dict.fromkeys(bare_words(" ".join(part)))) for part in labels]
    known = [number for number, sentence in enumerate(sentences) if sentence]
    out = np.zeros((len(sentences), encoder.dim), dtype=np.float32)
    if known:
        out[known] = encoder.text([sentences[number] for number in known])
    return out
