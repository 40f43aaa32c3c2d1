# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels on the listed nodes of the grid: clear, move, hold, push back."""

from functools import cache
from typing import Any, NamedTuple

import warp as wp

from .kernels_transfer import types_of

# Share of stationary mass from which a node is held: on average, over all places of a face between
# two nodes, it is then clamped 0.16 spacings inside the moving body, where bars get their length.
HELD_SHARE = 0.1
FREE_SLIP, STICKY, SEPARATE = 0, 1, 2


class GridKernels(NamedTuple):
    """Kernels on nodes.

    ``clear`` (nodes, grid); ``advance`` (nodes, grid, second, gravity, clock) makes velocities of
    momenta, ``second`` the grid of another thread or one of no nodes; ``wall`` (nodes, normals,
    velocities, mode, friction, touching, slot, grid, impulse, kick) corrects them; ``hold`` (nodes,
    still, slot, grid, impulse) stops nodes with a share of stationary mass.
    """

    clear: Any
    advance: Any
    wall: Any
    hold: Any


@cache
def grid_kernels(real: Any) -> GridKernels:
    """Kernels in ``real`` numbers."""
    return GridKernels(*_moving(real), _wall(real), _hold(real))


def _moving(real: Any) -> tuple[Any, Any]:
    vec3, vec4 = types_of(real).vec3, types_of(real).vec4

    @wp.kernel(module=f"mpm_grid_{real.__name__}", enable_backward=False)
    def clear(first: int, nodes: wp.array(dtype=int), grid: wp.array(dtype=vec4)):
        grid[nodes[first + wp.tid()]] = vec4()

    @wp.kernel(module=f"mpm_grid_{real.__name__}", enable_backward=False)
    def advance(
        first: int,
        nodes: wp.array(dtype=int),
        grid: wp.array(dtype=vec4),
        second: wp.array(dtype=vec4),
        gravity: vec3,
        clock: wp.array(dtype=real),
    ):
        """Gravity first, then the damping: the other way round a damped body sags too far."""
        node = nodes[first + wp.tid()]
        q = grid[node]
        if second.shape[0] > 0:
            q = q + second[node]
        if q[3] > real(0.0):
            v = clock[1] * (vec3(q[0], q[1], q[2]) / q[3] + clock[0] * gravity)
            grid[node] = vec4(v[0], v[1], v[2], q[3])

    return clear, advance


def _wall(real: Any) -> Any:
    vec3, vec4 = types_of(real).vec3, types_of(real).vec4

    @wp.kernel(module=f"mpm_grid_{real.__name__}", enable_backward=False)
    def wall(
        nodes: wp.array(dtype=int),
        normals: wp.array(dtype=vec3),
        velocities: wp.array(dtype=vec3),
        mode: int,
        friction: real,
        touching: real,
        slot: int,
        grid: wp.array(dtype=vec4),
        impulse: wp.array(dtype=vec3),
        kick: wp.array(dtype=vec4),
    ):
        """Separate: v_t max(0, 1 + f v_n / |v_t|) where v_n < 0, relative to the wall.

        ``kick`` is for rigid bodies: the changes of velocity, and the square of what approached, at
        nodes of more mass than ``touching``.
        """
        i = wp.tid()
        q = grid[nodes[i]]
        if q[3] > real(0.0):
            before = vec3(q[0], q[1], q[2])
            u = before - velocities[i]
            n = normals[i]
            into = wp.dot(u, n)
            approach = into * into
            if mode == STICKY:
                approach = wp.dot(u, u)
                u = vec3()
            elif mode == FREE_SLIP:
                u = u - into * n
            elif into < real(0.0):
                u = u - into * n
                speed = wp.length(u)
                if speed > real(0.0):
                    u = wp.max(real(0.0), real(1.0) + friction * into / speed) * u
            v = velocities[i] + u
            grid[nodes[i]] = vec4(v[0], v[1], v[2], q[3])
            change = v - before
            wp.atomic_add(impulse, slot, q[3] * change)
            if kick.shape[0] > 0 and q[3] > touching:
                kick[nodes[i]] += vec4(change[0], change[1], change[2], approach)

    return wall


def _hold(real: Any) -> Any:
    vec3, vec4 = types_of(real).vec3, types_of(real).vec4
    most = wp.constant(real(HELD_SHARE / (1 - HELD_SHARE)))

    @wp.kernel(module=f"mpm_grid_{real.__name__}", enable_backward=False)
    def hold(
        nodes: wp.array(dtype=int),
        still: wp.array(dtype=real),
        slot: int,
        grid: wp.array(dtype=vec4),
        impulse: wp.array(dtype=vec3),
    ):
        i = wp.tid()
        q = grid[nodes[i]]
        if q[3] > real(0.0) and still[i] > most * q[3]:
            grid[nodes[i]] = vec4(real(0.0), real(0.0), real(0.0), q[3])
            wp.atomic_add(impulse, slot, -q[3] * vec3(q[0], q[1], q[2]))

    return hold
