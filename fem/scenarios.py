"""What happens to a body, from a name and a few numbers: each is a scene and a method's name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np

from .errors import InputError
from .laws.law import Law
from .mesh import TetMesh, face_normals, material_of, outer_faces
from .note import Note
from .scene.loads import Traction, spread_force
from .scene.obstacles import gripper
from .scene.scene import Scene
from .scene.supports import Supports, find_supports, ground_under
from .scene.up import UpAxis, up_index, up_vector
from .solve.contact import barrier_thickness
from .solve.dynamics import DynamicMethod
from .solve.equilibrium import StaticMethod
from .solve.method import FrameProgress
from .solve.result import MotionResult, SagResult
from .solve.schemes import Scheme
from .validation import checked_direction, checked_number, checked_positive, checked_vector

SUPPORTS = ("base", "three-point")
OF_MODES = (*SUPPORTS, "free")


def _checked_supports(supports: str, known: Sequence[str]) -> str:
    if supports not in known:
        names = ", ".join(known)
        raise InputError("scenarios.supports_wanted", supports=supports, supports_2=names)
    return supports


def _standing(mesh: TetMesh, up: UpAxis, *, three_point: bool = False) -> Scene:
    """Scene of ``mesh`` that stands on the ground and carries nothing."""
    held, warnings = find_supports(mesh, up, three_point=three_point)
    ground = ground_under(mesh, up)
    return Scene(mesh=mesh, up=up, supports=held, ground=ground, warnings=warnings)


@dataclass(frozen=True)
class Sag:
    """It stands on its ``supports`` under ``gravity`` [m/s^2], downwards.

    'base': the nodes near the lowest point are clamped; 'three-point': it rests on three of them,
    free to expand sideways.
    """

    title: ClassVar[str] = Note("scenarios.sag_under")
    method: ClassVar[str] = "statics"
    with_modes: ClassVar[bool] = True

    supports: str = "base"
    gravity: float = 9.81

    def scene(self, mesh: TetMesh, *, up: UpAxis = "z") -> Scene:
        """Scene of the standing ``mesh``."""
        supports = _checked_supports(self.supports, SUPPORTS)
        weight = -checked_number("gravity", self.gravity, "m/s^2", least=0.0) * up_vector(up)
        standing = _standing(mesh, up, three_point=supports == "three-point")
        return replace(standing, gravity_vector=weight)


def sag(
    mesh: TetMesh,
    *,
    up: UpAxis = "z",
    order: int | None = None,
    supports: str = "base",
    gravity: float = 9.81,
    law: str | None = None,
    device: str = "cpu",
) -> SagResult:
    """Let ``mesh`` settle under its weight.

    Parameters
    ----------
    mesh
        Tets with a material.
    up
        The axis that points up.
    order
        1: linear tets, 2: quadratic; None: quadratic while they are affordable.
    supports
        'base': the nodes near the lowest point are clamped; 'three-point': it rests on three of
        them, free to expand sideways.
    gravity
        Acceleration [m/s^2], downwards.
    law
        None: the linear law, and neo-Hookean where the linear answer strains more than 5 %.
        ``Law.LINEAR``: never repeat.
    device
        'cpu' or 'cuda'.

    Returns
    -------
    SagResult
        Largest displacement [m], the whole static solution, and how far off its mesh may be.

    Raises
    ------
    ConvergenceError
        If the linear solve does not reach its tolerance.

    Examples
    --------
    >>> from autophyx_tet.fem import ElementMaterial, box_mesh, sag
    >>> block = box_mesh((1, 1, 1), (1, 1, 1))
    >>> block = block.with_material(ElementMaterial.uniform(6, E=1e6, nu=0.0, rho=1e3))
    >>> round(sag(block, gravity=10.0, order=2).max_displacement, 9)  # m: rho g L^2 / (2 E)
    0.005
    """
    scene = Sag(supports, gravity).scene(mesh, up=up)
    return StaticMethod().solve(scene, law=law, order=order, device=device)


@dataclass(frozen=True)
class Hang:
    """It hangs from its highest points under ``gravity`` [m/s^2], downwards."""

    title: ClassVar[str] = Note("scenarios.hanging_under")
    method: ClassVar[str] = "statics"
    with_modes: ClassVar[bool] = False

    gravity: float = 9.81

    def scene(self, mesh: TetMesh, *, up: UpAxis = "z") -> Scene:
        """Scene of the hanging ``mesh``."""
        held, warnings = find_supports(mesh, up, from_top=True)
        weight = -checked_number("gravity", self.gravity, "m/s^2", least=0.0) * up_vector(up)
        return Scene(mesh=mesh, up=up, supports=held, gravity_vector=weight, warnings=warnings)


def hang(
    mesh: TetMesh,
    *,
    up: UpAxis = "z",
    order: int | None = None,
    gravity: float = 9.81,
    law: str | None = None,
    device: str = "cpu",
) -> SagResult:
    """Hang ``mesh`` from its highest points under its weight.

    Parameters
    ----------
    mesh, up, order, gravity, law, device
        As in ``sag``: metres and m/s^2.

    Returns
    -------
    SagResult
        Largest displacement [m], the whole static solution, and how far off its mesh may be.

    Raises
    ------
    ConvergenceError
        If the linear solve does not reach its tolerance.

    Examples
    --------
    >>> from autophyx_tet.fem import ElementMaterial, box_mesh, hang
    >>> block = box_mesh((1, 1, 1), (1, 1, 1))
    >>> block = block.with_material(ElementMaterial.uniform(6, E=1e6, nu=0.0, rho=1e3))
    >>> round(hang(block, gravity=10.0, order=2).max_displacement, 9)  # m: rho g L^2 / (2 E)
    0.005
    """
    scene = Hang(gravity).scene(mesh, up=up)
    return StaticMethod().solve(scene, law=law, order=order, device=device)


AIR_DENSITY = 1.225  # [kg/m^3] at 15 C, sea level


@dataclass(frozen=True)
class Wind:
    """Drag on every face that looks into a wind of ``speed`` [m/s] along ``direction``.

    By default along the first horizontal axis; ``drag`` is the coefficient [1] of a face across the
    wind. The weight is left out: the answer is what the wind adds. Faces do not shelter each other.
    """

    title: ClassVar[str] = Note("scenarios.wind")
    method: ClassVar[str] = "statics"
    with_modes: ClassVar[bool] = False

    direction: Sequence[float] | None = None
    speed: float = 10.0
    drag: float = 1.2

    def scene(self, mesh: TetMesh, *, up: UpAxis = "z") -> Scene:
        """Scene of the standing ``mesh``; ``InputError`` where the wind has no direction."""
        direction = np.roll(up_vector(up), 1) if self.direction is None else self.direction
        blows = checked_direction("wind direction", direction)
        speed = checked_positive("wind speed", self.speed, "m/s")
        drag = checked_positive("drag coefficient", self.drag, "")
        faces = mesh.boundary.faces[outer_faces(mesh)]
        facing = -face_normals(mesh.points, faces) @ blows
        windward = facing > 0
        push = 0.5 * AIR_DENSITY * speed**2 * drag * facing[windward, None] * blows
        load = Traction(faces[windward], push, Note("scenarios.windward_side"))
        return replace(_standing(mesh, up), tractions=(load,), duration=5.0, frames=125)


def wind(
    mesh: TetMesh,
    *,
    up: UpAxis = "z",
    direction: Sequence[float] | None = None,
    speed: float = 10.0,
    drag: float = 1.2,
    order: int | None = None,
    law: str | None = None,
    device: str = "cpu",
) -> SagResult:
    """Blow on a standing ``mesh``: drag on every face that looks into the wind.

    The weight is left out: the answer is what the wind adds. Faces do not shelter each other.

    Parameters
    ----------
    mesh, up, order, law, device
        As in ``sag``.
    direction
        Where the wind blows to, shape (3,); by default along the first horizontal axis.
    speed
        Speed of the wind [m/s].
    drag
        Drag coefficient [1] of a face across the wind.

    Returns
    -------
    SagResult
        Largest displacement [m], the whole static solution, and how far off its mesh may be.

    Raises
    ------
    InputError
        Where the wind has no direction, or a number is not positive.
    ConvergenceError
        If the linear solve does not reach its tolerance.

    Examples
    --------
    >>> from autophyx_tet.fem import ElementMaterial, box_mesh, wind
    >>> block = box_mesh((1, 1, 1), (1, 1, 1))
    >>> block = block.with_material(ElementMaterial.uniform(6, E=1e6, nu=0.0, rho=1e3))
    >>> blown = wind(block, speed=10.0, drag=1.2)
    >>> round(float(-blown.static.reaction[:, 0].sum()), 6)  # N: 1.2 (1.225 / 2) v^2 on 1 m^2
    73.5
    """
    scene = Wind(direction, speed, drag).scene(mesh, up=up)
    return StaticMethod().solve(scene, law=law, order=order, device=device)


# Radius of a finger over the body's diagonal.
FINGER_RADIUS = 0.05


@dataclass(frozen=True)
class Poke:
    """A finger pushes with ``force`` [N] along ``direction`` (down), ``at`` a point [m] (highest).

    The force is spread over a patch of a twentieth of the diagonal; the weight is left out.
    """

    title: ClassVar[str] = Note("scenarios.under_finger")
    method: ClassVar[str] = "statics"
    with_modes: ClassVar[bool] = False

    force: float = 10.0
    at: Sequence[float] | None = None
    direction: Sequence[float] | None = None

    def scene(self, mesh: TetMesh, *, up: UpAxis = "z") -> Scene:
        """Scene of the standing ``mesh``."""
        used = np.unique(mesh.tets)
        highest = mesh.points[used[np.argmax(mesh.points[used] @ up_vector(up))]]
        place = highest if self.at is None else checked_vector("poke at", self.at, "m")
        direction = -up_vector(up) if self.direction is None else self.direction
        pushes = checked_direction("poke direction", direction)
        force = checked_positive("poke force", self.force, "N")
        faces = mesh.boundary.faces[outer_faces(mesh)]
        away = np.linalg.norm(mesh.points[faces].mean(axis=1) - place, axis=1)
        patch = FINGER_RADIUS * float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
        touched = faces[away <= max(patch, float(away.min()))]
        load = spread_force(mesh, touched, force * pushes)
        load = load._replace(name=Note("scenarios.touched_patch"))
        return replace(_standing(mesh, up), tractions=(load,))


def poke(
    mesh: TetMesh,
    *,
    up: UpAxis = "z",
    force: float = 10.0,
    at: Sequence[float] | None = None,
    direction: Sequence[float] | None = None,
    order: int | None = None,
    law: str | None = None,
    device: str = "cpu",
) -> SagResult:
    """Press a finger on a standing ``mesh``; the weight is left out.

    Parameters
    ----------
    mesh, up, order, law, device
        As in ``sag``.
    force
        Force of the finger [N], spread over a patch of a twentieth of the diagonal.
    at
        Where [m], shape (3,); by default the highest point.
    direction
        Where the finger pushes to, shape (3,); by default down.

    Returns
    -------
    SagResult
        Largest displacement [m], the whole static solution, and how far off its mesh may be.

    Raises
    ------
    InputError
        Where there is no face to push on, or a number is out of range.
    ConvergenceError
        If the linear solve does not reach its tolerance.

    Examples
    --------
    >>> from autophyx_tet.fem import ElementMaterial, box_mesh, poke
    >>> block = box_mesh((1, 1, 1), (1, 1, 1))
    >>> block = block.with_material(ElementMaterial.uniform(6, E=1e6, nu=0.0, rho=1e3))
    >>> pushed = poke(block, force=10.0)
    >>> round(float(pushed.static.reaction[:, 2].sum()), 6)  # N: the ground holds against it
    10.0
    """
    scene = Poke(force, at, direction).scene(mesh, up=up)
    return StaticMethod().solve(scene, law=law, order=order, device=device)


FRAMES = 20
# A squeeze is slow: the plates take this many times the crossing of the slowest shear wave.
SLOWNESS = 50.0
# And at least this long [s] for each width of travel: friction sticks below a speed that is a share
# of the size per second, so the corners of a squeeze in milliseconds (stiff bodies) would be too
# sharp for Newton; and it is the same friction for every share.
LEAST = 100.0
# The plates begin to push at this share of their travel from the body, where they start. They go on
# by half of it: wherever in it they end, the body is squeezed as asked to half a per cent.
REACH = 0.01


@dataclass(frozen=True)
class Squeeze:
    """Two plates close by ``share`` of the width along ``axis``, slowly, without gravity.

    By default along the first horizontal axis; ``friction`` is that of the plates [1].
    """

    title: ClassVar[str] = "Squeezed"
    method: ClassVar[str] = "dynamics"
    with_modes: ClassVar[bool] = False

    axis: Literal["x", "y", "z"] | None = None
    share: float = 0.1
    friction: float = 0.5
    frames: int = FRAMES

    def scene(self, mesh: TetMesh, *, up: UpAxis = "z") -> Scene:
        """Scene of ``mesh`` between the plates; ``InputError`` where the share is not one."""
        if not 0 < self.share < 1:
            raise InputError("scenarios.share_wanted", share=self.share)
        checked_number("friction", self.friction, "", least=0.0)
        k = up_index(self.axis or ("x" if up[-1] != "x" else "y"))
        low, high = mesh.bounds
        diagonal = float(np.linalg.norm(high - low))
        travel = self.share * float(high[k] - low[k]) / 2
        reach = min(REACH * travel, barrier_thickness(mesh))
        material = material_of(mesh)
        slowest = float(np.sqrt((material.lame.mu / material.rho).min()))
        duration = max(LEAST * self.share, SLOWNESS * diagonal / slowest)
        speed = (travel + reach / 2) / duration
        away = reach * np.eye(3)[k]
        return Scene(
            mesh=mesh,
            up=up,
            obstacles=gripper(tuple(low - away), tuple(high + away), k, speed),
            friction=self.friction,
            thickness=reach,
            duration=duration,
            frames=self.frames,
        )


def squeeze(
    mesh: TetMesh,
    *,
    axis: Literal["x", "y", "z"] = "x",
    share: float = 0.1,
    friction: float = 0.5,
    frames: int = FRAMES,
    law: str = Law.NEO_HOOKEAN,
    order: int | None = None,
    device: str = "cpu",
    progress: FrameProgress | None = None,
) -> MotionResult:
    """Squeeze ``mesh`` between two plates, slowly against the waves in the body, without gravity.

    Parameters
    ----------
    mesh
        Tets [m] with E [Pa], nu [1] and rho [kg/m^3].
    axis
        Along which the plates close.
    share
        How far they close, as a share [1] of the body's width.
    friction
        Coefficient of Coulomb friction [1] of the plates.
    frames
        States wanted.
    law, order, device
        Elastic law, order of the elements, and where to solve.
    progress
        Called after every frame.

    Returns
    -------
    MotionResult
        States at equal times [s]; ``obstacle_forces`` (frames, 2, 3) [N] are those of the plates.

    Raises
    ------
    InputError
        Where a number is out of range.
    ConvergenceError
        If a step fails however short it is made.

    Examples
    --------
    >>> from autophyx_tet.fem import ElementMaterial, box_mesh, squeeze
    >>> block = box_mesh((1, 1, 1), (1, 1, 1))
    >>> block = block.with_material(ElementMaterial.uniform(6, E=1e6, nu=0.0, rho=1e3))
    >>> left, right = squeeze(block, frames=2, friction=0.0).obstacle_forces[-1, :, 0]
    >>> bool(left > 0 > right), bool(abs(left / 1e5 - 1) < 0.2)  # about E A e = 1e5 N
    (True, True)
    """
    scene = Squeeze(axis, share, friction, frames).scene(mesh)
    return DynamicMethod().solve(scene, law=law, order=order, device=device, progress=progress)


# A drop is followed for this many fall times, so that the bounce is seen.
FALLS = 3.0
DROP_FRAMES = 90


@dataclass(frozen=True)
class Drop:
    """It falls from ``height`` [m], half its size by default, under ``gravity`` [m/s^2].

    ``friction`` is the coefficient of Coulomb friction [1] of the ground.
    """

    title: ClassVar[str] = "Dropped"
    method: ClassVar[str] = "dynamics"
    with_modes: ClassVar[bool] = False

    height: float | None = None
    friction: float = 0.3
    gravity: float = 9.81
    frames: int = DROP_FRAMES

    def scene(self, mesh: TetMesh, *, up: UpAxis = "z") -> Scene:
        """Scene of ``mesh`` above the ground; ``InputError`` where the height is not positive."""
        size = float(np.ptp(mesh.bounds, axis=0).max())
        height = 0.5 * size if self.height is None else self.height
        checked_positive("height", height, "m")
        checked_positive("gravity", self.gravity, "m/s^2")
        checked_number("friction", self.friction, "", least=0.0)
        return Scene(
            mesh=mesh,
            up=up,
            gravity_vector=-self.gravity * up_vector(up),
            obstacles=(ground_under(mesh, up, gap=height),),
            friction=self.friction,
            duration=FALLS * float(np.sqrt(2 * height / self.gravity)),
            frames=self.frames,
        )


def drop(
    mesh: TetMesh,
    *,
    up: UpAxis = "z",
    height: float | None = None,
    friction: float = 0.3,
    gravity: float = 9.81,
    frames: int = DROP_FRAMES,
    law: str = Law.NEO_HOOKEAN,
    scheme: Scheme = Scheme.IMPLICIT_EULER,
    order: int | None = None,
    device: str = "cpu",
    progress: FrameProgress | None = None,
) -> MotionResult:
    """Let ``mesh`` fall on the ground.

    Parameters
    ----------
    mesh
        Tets [m] with E [Pa], nu [1] and rho [kg/m^3].
    up
        The axis that points up.
    height
        Height of the fall [m]; by default half the size of the body.
    friction
        Coefficient of Coulomb friction [1] of the ground.
    gravity
        Acceleration [m/s^2], downwards.
    frames
        States wanted over three times the time of the fall.
    law, order, scheme, device
        Elastic law, order of the elements, time integration, and where to solve.
    progress
        Called after every frame.

    Returns
    -------
    MotionResult
        States at equal times [s]: displacement [m], velocity [m/s], forces [N] and energies [J].

    Raises
    ------
    InputError
        Where a number is out of range.
    ConvergenceError
        If a step fails however short it is made.

    Examples
    --------
    >>> from autophyx_tet.fem import ElementMaterial, box_mesh, drop
    >>> block = box_mesh((1, 1, 1), (1, 1, 1))
    >>> block = block.with_material(ElementMaterial.uniform(6, E=1e6, nu=0.0, rho=1e3))
    >>> fall = drop(block, height=0.5, frames=6)
    >>> fall.smallest_gap > 0, bool(fall.contact_forces[:, 2].max() > 0)  # the ground keeps it out
    (True, True)
    """
    scene = Drop(height, friction, gravity, frames).scene(mesh, up=up)
    return DynamicMethod().solve(
        scene, law=law, order=order, device=device, progress=progress, scheme=scheme
    )


# PhysGaussian's and AutoPhyX's falls: 50 frames of 0.04 s.
FALL_FRAMES, FRAME_TIME = 50, 0.04


@dataclass(frozen=True)
class Fall:
    """It falls from ``height`` [m], its largest size by default, under ``gravity`` [m/s^2].

    ``friction`` is the coefficient of Coulomb friction [1] of the ground.
    """

    title: ClassVar[str] = "Falling"
    method: ClassVar[str] = "mpm"
    with_modes: ClassVar[bool] = False

    height: float | None = None
    friction: float = 0.3
    gravity: float = 9.81

    def scene(self, mesh: TetMesh, *, up: UpAxis = "z") -> Scene:
        """Scene of ``mesh`` above the ground; ``InputError`` where the height is not positive."""
        size = float(np.ptp(mesh.bounds, axis=0).max())
        height = size if self.height is None else self.height
        scene = Drop(height, self.friction, self.gravity).scene(mesh, up=up)
        return replace(scene, duration=FALL_FRAMES * FRAME_TIME, frames=FALL_FRAMES)


# A spin is followed for so many of its turns.
TURNS = 2.0


@dataclass(frozen=True)
class Spin:
    """It turns freely about its shortest side, ``rate`` [1/s] turns a second at the start.

    Nothing holds it and nothing pulls: its angular momentum stays, while it stretches by its speed.
    """

    title: ClassVar[str] = Note("scenarios.spin")
    method: ClassVar[str] = "mpm"
    with_modes: ClassVar[bool] = False

    rate: float = 1.0

    def scene(self, mesh: TetMesh, *, up: UpAxis = "z") -> Scene:
        """Scene of the turning ``mesh``; ``InputError`` where the rate is not positive."""
        checked_positive("rate", self.rate, "1/s")
        weights = mesh.volumes * material_of(mesh).rho
        middle = weights @ mesh.centroids / weights.sum()
        axis = np.eye(3)[np.argmin(np.ptp(mesh.bounds, axis=0))]
        velocity = 2 * np.pi * self.rate * np.cross(axis, mesh.points - middle)
        return Scene(mesh=mesh, up=up, velocity=velocity, duration=TURNS / self.rate, frames=50)


# Points within this fraction of the length from an end are gripped.
GRIPPED = 0.15


@dataclass(frozen=True)
class Tear:
    """Its ends, along its longest axis, go apart by ``share`` [1] of its length in ``time`` [s]."""

    title: ClassVar[str] = "Pulled apart"
    method: ClassVar[str] = "mpm"
    with_modes: ClassVar[bool] = False

    share: float = 0.3
    time: float = 2.0
    gravity: float = 0.0

    def scene(self, mesh: TetMesh, *, up: UpAxis = "z") -> Scene:
        """Scene of ``mesh`` between two grips; ``InputError`` where a number is out of range."""
        checked_positive("share", self.share, "")
        checked_positive("time", self.time, "s")
        checked_number("gravity", self.gravity, "m/s^2", least=0.0)
        low, high = mesh.bounds
        along = int(np.argmax(high - low))
        place = (mesh.points[:, along] - low[along]) / (high[along] - low[along])
        pull = 0.5 * self.share * (high - low)[along] * np.eye(3)[along]
        held = Supports.clamp(len(place), place < GRIPPED, -pull)
        held = held.with_fixed(place > 1 - GRIPPED, (0, 1, 2), pull)
        weight = -self.gravity * up_vector(up)
        return Scene(
            mesh=mesh, up=up, supports=held, gravity_vector=weight, duration=self.time, frames=50
        )


@dataclass(frozen=True)
class Vibration:
    """The first ``modes`` natural vibrations of the body on its ``supports``, as in ``Sag``.

    'free': nothing holds it.
    """

    title: ClassVar[str] = Note("scenarios.first_natural")
    method: ClassVar[str] = "modal"
    with_modes: ClassVar[bool] = False

    supports: str = "base"
    modes: int = 6

    def scene(self, mesh: TetMesh, *, up: UpAxis = "z") -> Scene:
        """Scene of the ``mesh``, standing or free."""
        supports = _checked_supports(self.supports, OF_MODES)
        if supports == "free":
            return Scene(mesh=mesh, up=up, modes=self.modes)
        standing = _standing(mesh, up, three_point=supports == "three-point")
        return replace(standing, modes=self.modes)
