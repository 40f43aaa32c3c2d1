# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels on the nodes of the grid, of rigid bodies, and of the survey of the particles."""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from ..laws.kernels_tensor import volume_change
from .boundaries import Touch
from .kernels_transfer import OPTIONS, transfer_functions, types_of
from .materials import Form, MaterialClass

# Fraction of stationary mass from which a node is fixed: on average, over all places of a face
# between two nodes, it is then clamped 0.16 spacings inside the moving body, where bars get their
# length.
FIXED_FRACTION = 0.1


@cache
def grid_kernels(real: Any) -> SimpleNamespace:
    """Kernels on nodes, in ``real`` numbers.

    ``clear`` (nodes, grid); ``advance`` (nodes, grid, second, gravity, clock) makes velocities of
    momenta, ``second`` the grid of another thread or one of no nodes; ``wall`` (nodes, normals,
    velocities, mode, friction, touching, slot, grid, impulse, kick) corrects them; ``hold`` (nodes,
    still, slot, grid, impulse) stops nodes with a fraction of stationary mass.
    """
    vec3, vec4 = types_of(real).vec3, types_of(real).vec4
    most = wp.constant(real(FIXED_FRACTION / (1 - FIXED_FRACTION)))

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
            if mode == wp.static(int(Touch.STICKY)):
                approach = wp.dot(u, u)
                u = vec3()
            elif mode == wp.static(int(Touch.SLIP)):
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

    return SimpleNamespace(clear=clear, advance=advance, wall=wall, hold=hold)


@cache
def rigid_kernels(real: Any) -> SimpleNamespace:
    """Kernels of bodies that take the momentum and the angular momentum of their nodes.

    ``gather`` (first, cloud, frame, grid, kick, bodies) sums momenta and what walls kicked,
    ``settle`` (bodies, clock, rest) makes velocities of them and moves the bodies, ``carry``
    (first, cloud, bodies) moves their particles. ``Bodies`` is their struct.
    """
    types = types_of(real)
    Cloud, Frame, vec3, vec4 = types.Cloud, types.Frame, types.vec3, types.vec4
    mat33 = types.mat33
    place, inside, _, gather = transfer_functions(real)

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

    @wp.func
    def spin_of(R: mat33, inertia: mat33, turning: vec3):
        return R * (wp.inverse(inertia) * (wp.transpose(R) * turning))

    @wp.kernel(module="unique", enable_backward=False)
    def settle(bodies: Bodies, clock: wp.array(dtype=real), rest: real):
        """Stop at walls, then move: by the spin at the start, which momentum then makes anew.

        A wall stops the nodes in it, a part of the body's mass: what it gave is scaled until the
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
        extra = more * push
        w = spin_of(R, bodies.inertia[b], L)
        taken = (real(1.0) + more) * (real(1.0) + more) * answer
        if wp.dot(P, P) / bodies.mass[b] + wp.dot(L, w) < rest * rest * taken:
            extra = extra - P
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
        bodies.extra[b] = bodies.extra[b] + extra

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

    return SimpleNamespace(gather=sum_momenta, settle=settle, carry=carry, Bodies=Bodies)


# Entries of the survey.
SPEED, MOVED, SPREAD, WAVE, OUTSIDE, NOT_FINITE, INVERTED, COUNT = range(8)


@cache
def survey_kernel(kind: MaterialClass, real: Any, form: Form = Form.PLAIN) -> Any:
    """(first, cloud, frame, listed, survey) for a class: maxima, and counts of the last entries.

    ``listed`` are the places for which nodes were listed; moves are in spacings. What tore has lost
    the stiffness of its stretch, however far its crack is open.
    """
    types = types_of(real)
    place, inside, _, _ = transfer_functions(real)
    vec3, Cloud, Frame = types.vec3, types.Cloud, types.Frame
    fluid, snow = kind == MaterialClass.FLUID, kind == MaterialClass.SNOW
    tears, rigid = form == Form.TEARING, kind == MaterialClass.STATIONARY

    @wp.kernel(module="unique", enable_backward=False)
    def look(
        first: int,
        cloud: Cloud,
        frame: Frame,
        listed: wp.array(dtype=vec3),
        survey: wp.array(dtype=real),
    ):
        p = first + wp.tid()
        x = cloud.x[p]
        v = cloud.v[p]
        C = cloud.C[p]
        H = cloud.H[p]
        if not wp.isfinite(wp.dot(x, x) + wp.dot(v, v) + wp.ddot(C, C) + wp.ddot(H, H)):
            wp.atomic_add(survey, wp.static(NOT_FINITE), real(1.0))
        else:
            if not inside(frame, place(frame, x)):
                wp.atomic_add(survey, wp.static(OUTSIDE), real(1.0))
            away = (x - listed[p]) / frame.spacing
            most = wp.max(wp.abs(away[0]), wp.max(wp.abs(away[1]), wp.abs(away[2])))
            wp.atomic_max(survey, wp.static(SPEED), wp.length(v))
            wp.atomic_max(survey, wp.static(MOVED), most)
            wp.atomic_max(survey, wp.static(SPREAD), wp.sqrt(wp.ddot(C, C)))
            J = real(1.0) + volume_change(H)
            if J <= real(0.0):
                wp.atomic_add(survey, wp.static(INVERTED), real(1.0))
            density = cloud.m[p] / cloud.volume[p]
            stiff = cloud.lam[p] + real(2.0) * cloud.mu[p]
            if wp.static(fluid):
                stiff = cloud.k[p][0] * wp.pow(wp.max(J, real(0.1)), -cloud.k[p][1])
            else:
                X = H + wp.transpose(H) + H * wp.transpose(H)
                stretch = wp.sqrt(wp.ddot(X, X))
                if wp.static(tears):
                    q = cloud.q[p]
                    if q > real(1.0):
                        keep = wp.exp(-cloud.k[p][1] * (q - real(1.0))) / q
                        stretch = wp.min(stretch, real(1.0) + keep * stretch)
                stiff = stiff * (real(1.0) + stretch)
            if wp.static(snow):
                hard = cloud.k[p][2] * (real(1.0) - cloud.q[p])
                stiff = stiff * wp.exp(wp.clamp(hard, real(0.0), real(5.0)))
            if wp.static(rigid):
                stiff = real(0.0)
            wp.atomic_max(survey, wp.static(WAVE), wp.sqrt(stiff / density))

    return look
