"""The seam of methods: a scene goes in, a result comes out, and which methods there are."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol, TypeAlias, runtime_checkable

from ..registry import Registry

if TYPE_CHECKING:
    from ..result import Modes, MotionResult, SagResult
    from ..scene.scene import Scene

FrameProgress: TypeAlias = Callable[[int, int], None]  # called with (frames done, frames in all)


@runtime_checkable
class Method(Protocol):
    """A method of solution: finite elements at rest, in motion or ringing, and what comes later.

    The scene knows nothing of the method; how it is solved are options here.
    """

    @property
    def laws(self) -> tuple[str, ...]:
        """Names of the elastic laws that the method can use; none named: all of ``LAWS``."""
        ...

    def solve(
        self,
        scene: Scene,
        *,
        law: str | None = None,
        order: int | None = None,
        device: str = "cpu",
        progress: FrameProgress | None = None,
    ) -> SagResult | MotionResult | Modes:
        """Answer of ``scene``; None leaves ``law`` and ``order`` [1 or 2] to the method.

        ``progress`` is called after every frame of a motion.
        """
        ...


def halving_notes(halved: int, frames: int) -> tuple[str, ...]:
    """Say that steps were made of smaller ones: a motion damps less then, and differs."""
    if not halved:
        return ()
    return (f"{halved} of {frames} steps did not converge and were made of smaller ones",)


METHODS: Registry[Method] = Registry(
    "method",
    __package__ or "",
    {
        "statics": "equilibrium:METHOD",
        "dynamics": "dynamics:METHOD",
        "modal": "modal:METHOD",
        "mpm": ".mpm.method:METHOD",
        "spring": ".springs.method:METHOD",
        "lbs": ".reduced.method:METHOD",
    },
)
