"""How well the network reads clauses alone: levels in held-out wordings, materials of the table."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .encoders.minilm import MiniLM
from .language.hints import HintedEncoder
from .normalisation import DEFAULT


def level_response(
    *, weights: Path | None = None, seed: int = 0, parts: int = 12
) -> dict[str, float]:
    """Spearman correlation of the asked level with log10 E and log10 rho over held-out wordings."""
    import torch
    from scipy.stats import spearmanr

    from .datasets.grammar import Grammar
    from .datasets.wordings import LEVELS
    from .film.checkpoint import load_checkpoint
    from .film.predictor import WEIGHTS

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

    from .datasets.grammar import Grammar
    from .film.checkpoint import load_checkpoint
    from .film.predictor import WEIGHTS

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
