# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels of rigid bodies: they take the momentum and the angular momentum of their nodes."""

from functools import cache
from typing import Any, NamedTuple

import warp as wp

from .kernels_transfer import OPTIONS, gather_function, types_of, weight_functions


class RigidKernels(NamedTuple):
    """Kernels of rigid bodies.

    ``gather`` (first, cloud, frame, grid, kick, bodies) sums momenta and what walls kicked,
    ``settle`` (bodies, clock, rest) makes velocities of them and moves the bodies, ``carry``
    (first, cloud, bodies) moves their particles.
    ``Bodies`` is their struct.
    """

    gather: Any
    settle: Any
    carry: Any
    Bodies: Any


@cache
def rigid_kernels(real: Any) -> RigidKernels:
    """Kernels in ``real`` numbers."""
    vec3, mat33 = types_of(real).vec3, types_of(real).mat33

    @wp.struct
    class Bodies:
        """Bodies: mass, place of the centre at rest and now, rotation, inertia, momenta, speeds."""

        mass: wp.array(dtype=real)
        start: wp.array(dtype=vec3)
        centre: wp.array(dtype=vec3)
        rotation: wp.array(dtype=mat33)
        inertia: wp.array(dtype=mat33)
        momentum: wp.array(dtype=vec3)
        turning: wp.array(dtype=vec3)
        push: wp.array(dtype=vec3)
        torque: wp.array(dtype=vec3)
        approach: wp.array(dtype=real)
        extra: wp.array(dtype=vec3)
        velocity: wp.array(dtype=vec3)
        spin: wp.array(dtype=vec3)

    return RigidKernels(_gather(real, Bodies), _settle(real, Bodies), _carry(real, Bodies), Bodies)


def _gather(real: Any, Bodies: Any) -> Any:
    types = types_of(real)
    Cloud, Frame, vec3, vec4 = types.Cloud, types.Frame, types.vec3, types.vec4
    mat33 = types.mat33
    place, inside, _ = weight_functions(real)
    gather = gather_function(real)

    @wp.func
    def axial(C: mat33):
        return vec3(C[2, 1] - C[1, 2], C[0, 2] - C[2, 0], C[1, 0] - C[0, 1])

    @wp.kernel(module="unique", enable_backward=False, module_options=OPTIONS)
    def sum_momenta(
        first: int,
        cloud: Cloud,
        frame: Frame,
        grid: wp.array(dtype=vec4),
        kick: wp.array(dtype=vec4),
        bodies: Bodies,
    ):
        p = first + wp.tid()
        g = place(frame, cloud.x[p])
        v = cloud.v[p]
        C = cloud.C[p]
        b = cloud.body[p]
        m = cloud.m[p]
        arm = cloud.x[p] - bodies.centre[b]
        spread = real(0.25) * frame.spacing * frame.spacing
        if inside(frame, g):
            u, U = gather(frame, g, grid)
            v = vec3(u[0], u[1], u[2])
            C = U
            k, K = gather(frame, g, kick)
            push = vec3(k[0], k[1], k[2])
            wp.atomic_add(bodies.push, b, m * push)
            wp.atomic_add(bodies.torque, b, m * (wp.cross(arm, push) + spread * axial(K)))
            wp.atomic_add(bodies.approach, b, m * k[3])
        wp.atomic_add(bodies.momentum, b, m * v)
        wp.atomic_add(bodies.turning, b, m * (wp.cross(arm, v) + spread * axial(C)))

    return sum_momenta


def _settle(real: Any, Bodies: Any) -> Any:
    vec3, mat33 = types_of(real).vec3, types_of(real).mat33

    @wp.func
    def spin_of(R: mat33, inertia: mat33, turning: vec3):
        return R * (wp.inverse(inertia) * (wp.transpose(R) * turning))

    @wp.kernel(module="unique", enable_backward=False)
    def settle(bodies: Bodies, clock: wp.array(dtype=real), rest: real):
        """Stop at walls, then move: by the spin at the start, which momentum then makes anew.

        A wall stops the nodes in it, a share of the body's mass: what it gave is scaled until the
        body as a whole no longer approaches, or it would creep into the ground. A body of which
        they leave less than ``rest`` of the speed that they took from it rests: what gravity adds
        in every step would rock it, and it would sink from corner to corner.
        """
        b = wp.tid()
        dt = clock[0]
        R = bodies.rotation[b]
        push = bodies.push[b]
        torque = bodies.torque[b]
        answer = wp.dot(push, push) / bodies.mass[b]
        answer = answer + wp.dot(torque, spin_of(R, bodies.inertia[b], torque))
        more = real(0.0)
        if answer > real(0.0):
            more = wp.max(bodies.approach[b] / answer - real(1.0), real(0.0))
        P = bodies.momentum[b] + more * push
        L = bodies.turning[b] + more * torque
        given = more * push
        w = spin_of(R, bodies.inertia[b], L)
        taken = (real(1.0) + more) * (real(1.0) + more) * answer
        if wp.dot(P, P) / bodies.mass[b] + wp.dot(L, w) < rest * rest * taken:
            given = given - P
            P = vec3()
            L = vec3()
            w = vec3()
        V = P / bodies.mass[b]
        angle = wp.length(w) * dt
        if angle > real(0.0):
            n = w / wp.length(w)
            K = wp.skew(n)
            c = real(2.0) * wp.sin(real(0.5) * angle) * wp.sin(real(0.5) * angle)
            R = (wp.identity(n=3, dtype=real) + wp.sin(angle) * K + c * (K * K)) * R
        bodies.rotation[b] = R
        bodies.centre[b] = bodies.centre[b] + dt * V
        bodies.velocity[b] = V
        bodies.spin[b] = spin_of(R, bodies.inertia[b], L)
        bodies.momentum[b] = vec3()
        bodies.turning[b] = vec3()
        bodies.push[b] = vec3()
        bodies.torque[b] = vec3()
        bodies.approach[b] = real(0.0)
        bodies.extra[b] = bodies.extra[b] + given

    return settle


def _carry(real: Any, Bodies: Any) -> Any:
    Cloud = types_of(real).Cloud

    @wp.kernel(module="unique", enable_backward=False)
    def carry(first: int, cloud: Cloud, bodies: Bodies):
        p = first + wp.tid()
        b = cloud.body[p]
        R = bodies.rotation[b]
        w = bodies.spin[b]
        arm = R * (cloud.rest[p] - bodies.start[b])
        cloud.x[p] = bodies.centre[b] + arm
        cloud.v[p] = bodies.velocity[b] + wp.cross(w, arm)
        cloud.C[p] = wp.skew(w)
        cloud.H[p] = R - wp.identity(n=3, dtype=real)

    return carry
