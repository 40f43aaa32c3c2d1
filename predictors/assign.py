"""From clauses to the material of every part: words where they settle it, else a predictor."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from ..fem.errors import UsageError
from ..fem.note import Note
from ..fem.table import MaterialTable, key, load_table
from .appearance.features import Appearance
from .asset import UpAxis
from .grid import PartVoxels
from .partition import alike, merged
from .prediction import PartChoice, Prediction
from .predictor import PREDICTORS, Predictor
from .resolve.resolve import lookup_of
from .text.clauses import Bound


def predict_materials(
    parts: PartVoxels,
    bound: Bound,
    *,
    predictor: Predictor | str,
    overrides: Mapping[str, str] | None = None,
    materials: Mapping[str, str] | None = None,
    values: Mapping[str, Mapping[str, float]] | None = None,
    alpha: float | None = None,
    samples: int = 0,
    volumes: Sequence[float] | None = None,
    within: Callable[[int, float], float] | None = None,
    usual: Mapping[str, tuple[str, str]] | None = None,
    up: UpAxis = "z",
    appearance: Callable[[], Appearance] | None = None,
    table: MaterialTable | None = None,
) -> Prediction:
    """Return the material of every part; what is one thing several times is found once.

    parts: The cells [m] of every part.
    bound: What the user says of the object, and of which part.
    predictor: Who finds what words leave open, or its name in ``PREDICTORS``.
    overrides, materials, values, alpha, volumes, within: As ``Lookup.settle`` takes them; volumes
        [m^3], depths [m].
    samples: How many plausible materials to draw of every part that words leave open.
    usual: By part a kind of thing and its usual material, for where no word names another.
    up: The axis that points up.
    appearance: Gives what is seen of the cells; called only where words leave a part open.
    table: The materials, by default those of the package.
    Raises UsageError: Where a part, a material or the predictor is unknown, a part is stated twice,
        ``alpha`` is to move, or ``samples`` to draw, what a predictor finds that cannot do it.
    """
    if both := {key(name) for name in overrides or {}} & {key(name) for name in materials or {}}:
        raise UsageError("assign.part_both", both=min(both))
    if samples < 0:
        raise UsageError("assign.samples_wanted", samples=samples)
    if isinstance(predictor, str) and (samples or predictor not in PREDICTORS):
        if not PREDICTORS[predictor].takes_samples:
            able = " or ".join(name for name in PREDICTORS if PREDICTORS[name].takes_samples)
            raise UsageError("assign.samples_finds", predictor=predictor, able=able)
    given = {"table": table, "samples": samples}  # a table that is the user's own is its table too
    table = table or load_table()
    settled = lookup_of(table).settle(
        parts.part_labels, bound, overrides=overrides, materials=materials, values=values,
        alpha=alpha, volumes=volumes, within=within,
    )  # fmt: skip
    choices = list(settled.choices)
    for i, choice in enumerate(choices):
        # The usual material of its kind where no word of text or name decided it
        kind, material = (usual or {}).get(choice.part, ("", ""))
        if material and choice.guessed and not choice.clause and choice.understood:
            row, why = table.exact(material), Note("assign.usual", kind=kind)
            value, alpha_of = row.value(choice.alpha), choice.alpha
            choices[i] = PartChoice(choice.part, row, value, 1.0, alpha_of, why, guessed=True)
    left_open = [i for i, c in enumerate(choices) if not c.settled and i in parts.part]
    if not left_open:
        made = Prediction.of(parts, choices, bound.sentence, alpha=alpha)
        return replace(made, warnings=settled.warnings)
    if isinstance(predictor, str):  # loaded where words leave something open, and not before
        kind = PREDICTORS[predictor]
        predictor = kind(**{name: value for name, value in given.items() if value})
    if alpha is not None and not predictor.takes_alpha:
        able = " or ".join(name for name in PREDICTORS if PREDICTORS[name].takes_alpha)
        raise UsageError("assign.alpha_moves", part=choices[left_open[0]].part, able=able)
    first = alike(parts, left_open, [choice.clause for choice in choices])
    known = {"choices": choices, "appearance": appearance, "up": up, "alpha": alpha}
    found = predictor.predict(merged(parts, first), bound.sentence, **known)
    return replace(found.for_each(parts, first), warnings=settled.warnings)
