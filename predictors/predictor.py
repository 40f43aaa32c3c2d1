"""The seam of the predictors: what each is given and gives, and who there is.

Words come first: what they settle is chosen before a predictor is asked, and stays. A predictor is
one file and one line here, or a call of ``PREDICTORS.register`` from outside.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, ClassVar, Protocol, runtime_checkable

from ..fem.registry import Registry

if TYPE_CHECKING:
    from .appearance.features import Appearance
    from .asset import UpAxis
    from .grid import PartVoxels
    from .prediction import PartChoice, Prediction
    from .text.clauses import Sentence


@runtime_checkable
class Predictor(Protocol):
    """Finds the materials of the parts that words leave open.

    ``takes_alpha`` says whether it can move E of such a part from soft (0) to stiff (1),
    ``takes_samples`` whether its class takes how many materials it is to draw of such a part.
    """

    name: ClassVar[str]
    takes_alpha: ClassVar[bool]
    takes_samples: ClassVar[bool]

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
        """Return the materials of all parts.

        parts: The cells [m] of every part.
        sentence: What the user says of the object.
        choices: For each part what words settle, else what they make likeliest; by default looked
            up.
        appearance: Gives what is seen of the cells; called only where it is needed.
        up: The axis that points up.
        alpha: Place of E in its range, 0 (soft) to 1 (stiff); None follows words such as "soft".
        """


PREDICTORS: Registry[type[Predictor]] = Registry(
    "predictor",
    __package__ or "",
    {
        "film": "film.predictor:FilmPredictor",
        "unipixie": "unipixie.predictor:UniPixiePredictor",
        "retrieval": "resolve.resolve:RetrievalPredictor",
    },
)
