"""The launches of one substep, recorded: stages, and in each of them what every thread does."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from jaxtyping import Float

from ..device import start_warp
from .cloud import Cloud
from .kernels.kernels_grid import grid_kernels
from .kernels.kernels_transfer import move_kernel, push_kernel, scatter_kernel
from .particles import Particles
from .rigid import REST, RigidBodies
from .walls import Wall, still_nodes

# What one thread launches, for both threads.
Stage = list[list[Any]]


class Substep:
    """Particles to grid, grid, walls, grid to particles.

    ``list_nodes`` and ``record`` again when the particles were sorted; ``record`` when walls moved.

    Parameters
    ----------
    cloud
        The particles.
    walls
        What holds or stops nodes, in this order.
    gravity_vector
        Acceleration of gravity [m/s^2], shape (3,).
    held
        Stationary particles: nodes that they weigh on stand still.
    lagrangian
        Whether weights are those at rest.
    threads
        One, or two on a CPU: warp's kernels run at once, each thread on a grid of its own.
    """

    def __init__(
        self,
        cloud: Cloud,
        walls: Sequence[Wall],
        gravity_vector: Sequence[float] | np.ndarray,
        *,
        held: Particles | None,
        lagrangian: bool,
        threads: int,
    ) -> None:
        wp, types, lattice = start_warp(), cloud.types, cloud.lattice
        self.cloud, self.walls, self.lagrangian = cloud, tuple(walls), lagrangian
        self.device = cloud.device
        self.threads = threads if self.device == "cpu" else 1
        self._gravity = types.vec3(*map(float, gravity_vector))
        self._clock = wp.zeros(2, dtype=types.real, device=self.device)
        sizes = [lattice.count, lattice.count if self.threads == 2 else 0]
        self._grids = [wp.zeros(n, dtype=types.vec4, device=self.device) for n in sizes]
        self._impulse = wp.zeros(len(walls) + 1, dtype=types.vec3, device=self.device)
        self._worker = ThreadPoolExecutor(1) if self.threads == 2 else None
        self.rigid: RigidBodies | None = None
        if cloud.particles.rigid.max() >= 0:
            given = cloud.particles, lattice.spacing, cloud.real, self.device
            self.rigid = RigidBodies(*given)
        size = lattice.count if self.rigid is not None else 0
        self._kick = wp.zeros(size, dtype=types.vec4, device=self.device)
        self._still = still_nodes(held, lattice)
        self._stages: list[Stage] = []
        self._graph: Any = None

    @property
    def pull(self) -> float:
        """Acceleration [m/s^2] by gravity and outer forces, at most."""
        return float(np.linalg.norm(self._gravity)) + self.cloud.strongest_push

    @property
    def moving(self) -> bool:
        """Whether walls are elsewhere later."""
        return any(w.moves or w.start > 0 or w.end < np.inf for w in self.walls)

    @property
    def step(self) -> float:
        """Step [s] of the last chunk."""
        return float(self._clock.numpy()[0])

    def set_step(self, dt: float, damping: float) -> None:
        """Take steps of ``dt`` [s] in which velocities fade at the rate ``damping`` [1/s]."""
        self._clock.assign(np.array([dt, np.exp(-damping * dt)], dtype=self._clock.numpy().dtype))

    def take_impulses(self) -> Float[np.ndarray, "holders 3"]:
        """Momentum [N s] that every wall, and then what is stationary, gave since asked last."""
        found = self._impulse.numpy().astype(np.float64).copy()
        self._impulse.zero_()
        if self.rigid is not None:  # what rigid bodies got more is shared as the rest is
            size = np.linalg.norm(found[:-1], axis=1)
            share = size / max(size.sum(), 1e-300)
            found[:-1] += share[:, None] * self.rigid.take_push()
        return found

    def list_nodes(self) -> None:
        """List the nodes near the particles."""
        drift = 0 if self.lagrangian else 1
        x = self.cloud.particles.x if self.lagrangian else self.cloud.read("x")
        self.nodes = self.cloud.lattice.near(x, drift=drift)
        given = self.nodes.astype(np.int32)
        self._nodes = start_warp().array(given, dtype=int, device=self.device)
        for grid in (*self._grids, self._kick):
            grid.zero_()

    def record(self, time: float) -> None:
        """Record the launches, with the walls where they are at ``time`` [s]."""
        self._graph, self._stages = None, []
        if not len(self.nodes):  # every particle has left the grid
            return
        stages = [self._clears(), self._scatters(), self._advances()]
        stages += [self._holds(0.0 if self.lagrangian else time), self._moves()]
        stages += self._settles()
        self._stages = [stage for stage in stages if any(stage)]
        if self.device != "cpu":
            wp = start_warp()
            with wp.ScopedCapture(device=self.device) as capture:
                for stage in self._stages:
                    for launch in stage[0]:
                        launch.launch()
            self._graph = capture.graph

    def _launch(self, kernel: Any, count: int, inputs: list[Any]) -> Any:
        """Recorded launch of ``count`` > 0: warp records none of nothing."""
        return start_warp().launch(kernel, count, inputs, device=self.device, record_cmd=True)

    def _halves(self, first: int, count: int) -> list[tuple[int, int, int]]:
        """Thread, first and count of what each thread takes."""
        half = (count + 1) // 2 if self.threads == 2 else count
        given = [(0, first, half), (1, first + half, count - half)]
        return [share for share in given if share[2]]

    def _clears(self) -> Stage:
        kernel, stage = grid_kernels(self.cloud.real).clear, [[], []]
        for thread in range(self.threads):
            given = [0, self._nodes, self._grids[thread]]
            stage[thread].append(self._launch(kernel, len(self.nodes), given))
        cloud = self.cloud
        if len(cloud.struct.push):
            given = [0, cloud.struct, self._clock]
            stage[0].append(self._launch(push_kernel(cloud.real), len(cloud), given))
        if self.rigid is not None:
            given = [0, self._nodes, self._kick]
            stage[0].append(self._launch(kernel, len(self.nodes), given))
        return stage

    def _scatters(self) -> Stage:
        cloud, stage = self.cloud, [[], []]
        for span in cloud.spans:
            kernel = scatter_kernel(
                span.kind, cloud.real, lagrangian=self.lagrangian, form=span.form
            )
            for thread, first, count in self._halves(span.first, span.count):
                given = [first, cloud.struct, cloud.frame, self._clock, self._grids[thread]]
                stage[thread].append(self._launch(kernel, count, given))
        return stage

    def _advances(self) -> Stage:
        kernel, stage = grid_kernels(self.cloud.real).advance, [[], []]
        for thread, first, count in self._halves(0, len(self.nodes)):
            given = [first, self._nodes, *self._grids, self._gravity, self._clock]
            stage[thread].append(self._launch(kernel, count, given))
        return stage

    def _holds(self, time: float) -> Stage:
        wp, types, stage = start_warp(), self.cloud.types, [[], []]
        kernel = grid_kernels(self.cloud.real).wall
        for slot, wall in enumerate(self.walls):
            found = wall.at(self.cloud.lattice, self.nodes, time)
            if len(found.nodes):
                arrays = [
                    wp.array(found.nodes.astype(np.int32), dtype=int, device=self.device),
                    wp.array(found.normals, dtype=types.vec3, device=self.device),
                    wp.array(found.velocities, dtype=types.vec3, device=self.device),
                ]
                touching = 0.0 if self.rigid is None else self.rigid.touching
                given = [*arrays, int(wall.touch), wall.friction, touching, slot, self._grids[0]]
                given = [*given, self._impulse, self._kick]
                stage[0].append(self._launch(kernel, len(found.nodes), given))
        still = self._still
        if len(still.nodes):
            arrays = [
                wp.array(still.nodes.astype(np.int32), dtype=int, device=self.device),
                wp.array(still.mass, dtype=types.real, device=self.device),
            ]
            given = [*arrays, len(self.walls), self._grids[0], self._impulse]
            hold = grid_kernels(self.cloud.real).hold
            stage[0].append(self._launch(hold, len(still.nodes), given))
        return stage

    def _moves(self) -> Stage:
        cloud, stage = self.cloud, [[], []]
        for span in cloud.spans:
            if span.rigid:
                continue
            kernel = move_kernel(cloud.real, lagrangian=self.lagrangian, carries=span.carries)
            for thread, first, count in self._halves(span.first, span.count):
                given = [first, cloud.struct, cloud.frame, self._clock, self._grids[0]]
                stage[thread].append(self._launch(kernel, count, given))
        return stage

    def _settles(self) -> list[Stage]:
        """Rigid bodies: sum their momenta, settle, move their particles."""
        cloud, bodies = self.cloud, self.rigid
        if bodies is None:
            return []
        gathers, carries = [], []
        for span in cloud.spans:
            if span.rigid:
                given = [span.first, cloud.struct]
                summed = [*given, cloud.frame, self._grids[0], self._kick, bodies.struct]
                gathers.append(self._launch(bodies.kernels.gather, span.count, summed))
                moved = [*given, bodies.struct]
                carries.append(self._launch(bodies.kernels.carry, span.count, moved))
        settle = [bodies.struct, self._clock, cloud.real(0.0 if self.moving else REST)]
        settles = [self._launch(bodies.kernels.settle, bodies.count, settle)]
        return [[[*gathers, *settles, *carries], []]]

    def run(self, steps: int) -> None:
        """Take ``steps`` steps."""
        if self._graph is not None:
            for _ in range(steps):
                start_warp().capture_launch(self._graph)
            return
        for _ in range(steps):
            for here, there in self._stages:
                waiting = (
                    self._worker.submit(_launch_all, there) if there and self._worker else None
                )
                _launch_all(here)
                if waiting is not None:
                    waiting.result()


def _launch_all(launches: list[Any]) -> None:
    for launch in launches:
        launch.launch()
