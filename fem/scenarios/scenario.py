"""The seam of scenarios: a body becomes a scene and is given to a method; which there are."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Protocol, runtime_checkable

from ..registry import Registry

if TYPE_CHECKING:
    from ..scene.mesh import TetMesh
    from ..scene.scene import Scene
    from ..scene.up import UpAxis


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
        ...


SCENARIOS: Registry[type[Scenario]] = Registry(
    "scenario",
    __package__ or "",
    {
        "sag": "sag:Sag",
        "hang": "hang:Hang",
        "wind": "wind:Wind",
        "poke": "poke:Poke",
        "drop": "drop:Drop",
        "squeeze": "squeeze:Squeeze",
        "fall": "fall:Fall",
        "tear": "tear:Tear",
        "modal": "vibration:Vibration",
    },
)
