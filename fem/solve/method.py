"""The seams of methods and scenarios: a scene goes in, a result comes out; which there are."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, ClassVar, Protocol, TypeAlias, runtime_checkable

from ..note import Note
from ..registry import Registry

if TYPE_CHECKING:
    from ..mesh import TetMesh
    from ..scene.scene import Scene
    from ..scene.up import UpAxis
    from .result import Modes, MotionResult, SagResult

FrameProgress: TypeAlias = Callable[[int, int], None]  # called with (frames done, frames in all)


@runtime_checkable
class Method(Protocol):
    """A method of solution: finite elements at rest, in motion or ringing, and what comes later.

    The scene knows nothing of the method; how it is solved are options here.
    """

    @property
    def laws(self) -> tuple[str, ...]:
        """Names of the elastic laws that the method can use; none named: all of ``LAWS``."""

    def solve(
        self,
        scene: Scene,
        *,
        law: str | None = None,
        order: int | None = None,
        device: str = "cpu",
        progress: FrameProgress | None = None,
    ) -> SagResult | MotionResult | Modes:
        """Answer of ``scene``; ``progress`` is called after every frame of a motion.

        None leaves ``law`` and ``order`` [1 or 2] to the method. One that has no elements, or takes
        its laws from the materials, raises ``UsageError`` where it is given a choice.
        """


def halving_notes(halved: int, frames: int) -> tuple[str, ...]:
    """Say that steps were made of smaller ones: a motion damps less then, and differs."""
    return (Note("method.steps_converge", halved=halved, frames=frames),) if halved else ()


METHODS: Registry[Method] = Registry(
    "method",
    __package__ or "",
    {
        "statics": "equilibrium:METHOD",
        "dynamics": "dynamics:METHOD",
        "modal": "modal:METHOD",
        "mpm": ".mpm.method:METHOD",
        "spring": ".springs.body:METHOD",
        "lbs": ".reduced.motion:METHOD",
    },
)
"""Methods of solution by name: ``METHODS["statics"].solve(scene)``."""


@runtime_checkable
class Scenario(Protocol):
    """What happens to a body, told by a name and a few numbers: a frozen dataclass of these.

    A scenario's option on the command line is ``--NAME-FIELD`` or ``--FIELD``.
    """

    # What the answer shows, in a few words.
    title: ClassVar[str]
    # Name of the method that solves it.
    method: ClassVar[str]
    # Whether the first vibrations of the standing body belong to its answer.
    with_modes: ClassVar[bool]

    def scene(self, mesh: TetMesh, *, up: UpAxis = "z") -> Scene:
        """Scene of ``mesh`` with the axis ``up`` pointing up."""


SCENARIOS: Registry[type[Scenario]] = Registry(
    "scenario",
    __package__ or "",
    {
        "sag": ".scenarios:Sag",
        "hang": ".scenarios:Hang",
        "wind": ".scenarios:Wind",
        "poke": ".scenarios:Poke",
        "drop": ".scenarios:Drop",
        "squeeze": ".scenarios:Squeeze",
        "fall": ".scenarios:Fall",
        "tear": ".scenarios:Tear",
        "spin": ".scenarios:Spin",
        "modal": ".scenarios:Vibration",
    },
)
"""Scenarios by name: ``SCENARIOS["wind"](speed=5.0).scene(mesh)``, in m/s."""
