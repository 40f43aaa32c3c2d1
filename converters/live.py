"""Splats that follow particles on the device of these, and their pictures: a film as it happens."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float, UInt8

from ..fem.device import start_warp
from ..predictors.appearance.views import Camera
from .embedding import STRETCH
from .points.gaussians import gaussians, matrices_of
from .points.table import PointTable
from .points.views import DEVIATIONS, NEAREST, WIDENED, Look

if TYPE_CHECKING:
    from ..fem.mpm.solver import MpmSolver


class LiveSplats:
    """Splats of a ``table`` that follow the particles of a ``solver``, from where both are now.

    Places, shapes and pictures stay on the solver's device; a finished picture alone leaves it.
    Colours are those without harmonics, which do not turn.

    Parameters
    ----------
    table
        Gaussian splats [m], with finite positions.
    solver
        What moves them.
    """

    def __init__(self, table: PointTable, solver: MpmSolver) -> None:
        from ..fem.mpm.particles import Followers
        from .kernels import Drawn, Follow

        wp, device, found = start_warp(), solver.cloud.device, gaussians(table)
        self.solver, self.device = solver, device
        now, free = solver.state.x, solver.free
        x = np.concatenate([now[free], now[~free]])  # in the order that the solver tells
        labels = np.zeros(len(found.means), dtype=np.int64)
        parts = np.zeros(len(x), dtype=np.int64)
        after = Followers.of(found.means, x, labels=labels, parts=parts)
        roots = matrices_of(found.rotations) * found.sigmas[:, None, :]

        def array(values: np.ndarray, dtype: type) -> Any:
            kind = np.int32 if dtype is int else np.float32
            return wp.array(np.ascontiguousarray(values, kind), dtype=dtype, device=device)

        self.follow = Follow()
        self.follow.count = after.near.shape[1]
        self.follow.near = array(after.near.ravel(), int)
        self.follow.weight = array(after.weights.ravel(), float)
        arms = after.points[:, None] - after.rest[after.near]
        self.follow.arm = array(arms.reshape(-1, 3), wp.vec3)
        self.follow.root = array(roots, wp.mat33)
        self.opacity = array(found.opacity, float)
        self.colour = array(np.clip(Look.of(table).base, 0, 1), wp.vec3)
        self.x = array(x, wp.vec3)
        self.F = array(np.broadcast_to(np.eye(3), (len(x), 3, 3)), wp.mat33)
        count = len(found.means)
        self.means = wp.empty(count, dtype=wp.vec3, device=device)
        self.roots = wp.empty(count, dtype=wp.mat33, device=device)
        self.drawn = Drawn()
        kinds = {"centre": wp.vec2, "conic": wp.vec3, "reach": wp.vec2, "depth": float}
        for name, kind in kinds.items():
            setattr(self.drawn, name, wp.empty(count, dtype=kind, device=device))
        self.sums = wp.empty(count, dtype=int, device=device)
        self._lists = [wp.empty(0, dtype=kind, device=device) for kind in (wp.int64, int)]
        self.behind: tuple[np.ndarray, Any] | None = None
        self.image: Any = None

    def carry(self) -> None:
        """Move the splats to where the particles are."""
        from .kernels import carry

        self.solver.cloud.write_frame(self.x, self.F)
        inputs = [self.follow, self.x, self.F, STRETCH, self.means, self.roots]
        start_warp().launch(carry, len(self.means), inputs, device=self.device)

    def picture(
        self, camera: Camera, background: Float[np.ndarray, "height width 3"]
    ) -> UInt8[np.ndarray, "height width 3"]:
        """The splats as ``camera`` sees them, before a ``background`` of colours in [0, 1]."""
        from . import kernels as k

        wp, side = start_warp(), int(k.TILE)
        height, width = camera.size
        if self.behind is None or self.behind[0] is not background:
            values = np.ascontiguousarray(background, dtype=np.float32)
            self.behind = background, wp.array(values, dtype=wp.vec3, device=self.device)
            self.image = wp.empty((height, width, 3), dtype=wp.uint8, device=self.device)
        view = k.View()
        view.turn = wp.mat33(*camera.pose[:3, :3].T.ravel().tolist())
        view.position = wp.vec3(*camera.position.tolist())
        view.focal, view.middle = wp.vec2(*camera.focal), wp.vec2(*camera.center)
        view.near = NEAREST * float(np.linalg.norm(camera.position))
        view.columns, view.rows = -(-width // side), -(-height // side)
        tiles = view.columns * view.rows

        def launch(kernel: Any, size: int | tuple, *inputs: Any) -> None:
            wp.launch(kernel, size, list(inputs), device=self.device, block_dim=side * side)

        places = (self.means, self.roots, view, WIDENED, DEVIATIONS)
        launch(k.project, len(self.means), *places, self.drawn, self.sums)
        wp.utils.array_scan(self.sums, self.sums, inclusive=True)
        total = int(self.sums[-1:].numpy()[0])
        if 2 * total > len(self._lists[0]):  # twice as long: radix sort wants room
            kinds = (wp.int64, int)
            self._lists = [wp.empty(3 * total, dtype=t, device=self.device) for t in kinds]
        keys, rows = self._lists
        launch(k.list_tiles, len(self.means), self.drawn, self.sums, view, keys, rows)
        wp.utils.radix_sort_pairs(keys, rows, total)
        first = wp.zeros(tiles + 1, dtype=int, device=self.device)
        if total:
            launch(k.find_tiles, total, keys, total, first)
        given = (self.drawn, self.opacity, self.colour, first, rows, view, self.behind[1])
        launch(k.blend_tiles, (tiles, side * side), *given, self.image)
        return self.image.numpy()
