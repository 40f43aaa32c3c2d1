"""From a text to the material of every part: words where they settle it, a predictor for the rest.

The text is read here, once; whatever comes after takes its clauses.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from ..fem.errors import UsageError
from ..fem.scene.materials import MaterialTable, load_table
from .asset import UpAxis
from .hearing.parser import listen
from .lookup.lookup import Lookup
from .prediction import PartChoice, Prediction
from .predictor import PREDICTORS, Appearance, Predictor
from .voxels import PartVoxels


def predict_materials(
    parts: PartVoxels,
    text: str,
    *,
    predictor: Predictor | str,
    overrides: Mapping[str, str] | None = None,
    materials: Mapping[str, str] | None = None,
    alpha: float | None = None,
    part_volumes: Sequence[float] | None = None,
    usual: Mapping[str, tuple[str, str]] | None = None,
    up: UpAxis = "z",
    appearance: Callable[[], Appearance] | None = None,
    table: MaterialTable | None = None,
) -> Prediction:
    """Return the material of every part.

    Parameters
    ----------
    parts
        The cells [m] of every part.
    text
        What the user says of the object.
    predictor
        Who finds what words leave open, or its name in ``PREDICTORS``.
    overrides, materials, alpha, part_volumes
        As ``Lookup.choose`` takes them; volumes [m^3].
    usual
        By part a kind of thing and its usual material, for where no word names another.
    up
        The axis that points up.
    appearance
        Gives what is seen of the cells; called only where words leave a part open.
    table
        The materials; by default those of the package.

    Raises
    ------
    UsageError
        Where a part, a material or the predictor is unknown, or ``alpha`` is to move what a
        predictor finds that cannot do it.
    """
    table, predictor = table or load_table(), _named(predictor)
    sentence = listen(text, table)
    choices = Lookup(table=table).choose(
        parts.part_labels, sentence, overrides=overrides, materials=materials, alpha=alpha,
        part_volumes=part_volumes,
    )  # fmt: skip
    choices = [_usual(choice, table, usual or {}) for choice in choices]
    left_open = [c.part for i, c in enumerate(choices) if not c.settled and i in parts.part]
    if not left_open:
        return Prediction.of(parts, choices, sentence, alpha=alpha)
    if alpha is not None and not predictor.takes_alpha:
        able = " or ".join(name for name in PREDICTORS if PREDICTORS[name].takes_alpha)
        raise UsageError(
            f"--alpha moves a material within its range, and no word names one for part "
            f"{left_open[0]!r}: name it, or use --predictor {able}"
        )
    return predictor.predict(
        parts, sentence, choices=choices, appearance=appearance, up=up, alpha=alpha
    )


def _named(predictor: Predictor | str) -> Predictor:
    return PREDICTORS[predictor]() if isinstance(predictor, str) else predictor


def _usual(
    choice: PartChoice, table: MaterialTable, usual: Mapping[str, tuple[str, str]]
) -> PartChoice:
    """The choice, or the usual material of its kind where no word of text or name decided it."""
    kind, material = usual.get(choice.part, ("", ""))
    if not material or choice.clause or choice.why.startswith(("name:", "override")):
        return choice
    row = table.exact(material)
    why = f"usual for a {kind}"
    return PartChoice(choice.part, row, row.value(choice.alpha), 1.0, choice.alpha, why)
