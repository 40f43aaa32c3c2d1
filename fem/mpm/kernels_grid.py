# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels on the nodes of the grid, of rigid bodies, and of the survey of the particles."""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from ..laws.kernels_tensor import Doubles, Ints, volume_change
from ..laws.neo_hookean import energy_and_stress
from .boundaries import Touch
from .kernels_transfer import APART, LOST, OPTIONS, stretch_functions, transfer_functions, types_of
from .materials import GAMMA, Form, MaterialClass

# Fraction of stationary mass from which a node is fixed: on average, over all places of a face
# between two nodes, it is then clamped 0.16 spacings inside the moving body, where bars get their
# length.
FIXED_FRACTION = 0.1


@cache
def grid_kernels(real: Any) -> SimpleNamespace:
    """Kernels on nodes, in ``real`` numbers.

    ``clear`` (nodes, count, grid); ``advance`` (nodes, count, grid, second, gravity, clock) makes
    velocities of momenta, ``second`` the grid of another thread or one of no nodes; ``wall``
    (nodes, normals, velocities, mode, friction, touching, slot, grid, impulse, kick) corrects them;
    ``hold`` (nodes, still, slot, grid, impulse) stops nodes with a fraction of stationary mass.
    Of nodes with a ``count`` the first so many are meant.
    """
    types = types_of(real)
    vec3, vec4 = types.vec3, types.vec4
    most = wp.constant(real(FIXED_FRACTION / (1 - FIXED_FRACTION)))

    @wp.kernel(module=f"mpm_grid_{real.__name__}", enable_backward=False)
    def clear(first: int, nodes: Ints, count: Ints, grid: types.Nodes):
        i = first + wp.tid()
        if i < count[0]:
            grid[nodes[i]] = vec4()

    @wp.kernel(module=f"mpm_grid_{real.__name__}", enable_backward=False)
    def advance(
        first: int,
        nodes: Ints,
        count: Ints,
        grid: types.Nodes,
        second: types.Nodes,
        gravity: vec3,
        clock: types.Reals,
    ):
        """Gravity first, then the damping: the other way round a damped body sags too far."""
        i = first + wp.tid()
        if i >= count[0]:
            return
        node = nodes[i]
        q = grid[node]
        if second.shape[0] > 0:
            q = q + second[node]
        if q[3] > real(0.0):
            v = clock[1] * (vec3(q[0], q[1], q[2]) / q[3] + clock[0] * gravity)
            grid[node] = vec4(v[0], v[1], v[2], q[3])

    @wp.kernel(module=f"mpm_grid_{real.__name__}", enable_backward=False)
    def wall(
        nodes: Ints,
        normals: types.Vectors,
        velocities: types.Vectors,
        mode: int,
        friction: real,
        touching: real,
        slot: int,
        grid: types.Nodes,
        impulse: types.Vectors,
        kick: types.Nodes,
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
            else:  # what goes away approaches nothing
                approach = real(0.0)
            v = velocities[i] + u
            grid[nodes[i]] = vec4(v[0], v[1], v[2], q[3])
            change = v - before
            wp.atomic_add(impulse, slot, q[3] * change)
            if kick.shape[0] > 0 and q[3] > touching:
                kick[nodes[i]] += vec4(change[0], change[1], change[2], approach)

    @wp.kernel(module=f"mpm_grid_{real.__name__}", enable_backward=False)
    def hold(nodes: Ints, still: types.Reals, slot: int, grid: types.Nodes, impulse: types.Vectors):
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
    Cloud, Frame, vec3 = types.Cloud, types.Frame, types.vec3
    mat33 = types.mat33
    place, inside, _, gather = transfer_functions(real)

    @wp.struct
    class Bodies:
        """Bodies: mass, place of the centre at rest and now, rotation, inertia, momenta, speeds."""

        mass: types.Reals
        start: types.Vectors
        centre: types.Vectors
        rotation: types.Tensors
        inertia: types.Tensors
        momentum: types.Vectors
        turning: types.Vectors
        push: types.Vectors
        torque: types.Vectors
        approach: types.Reals
        extra: types.Vectors
        velocity: types.Vectors
        spin: types.Vectors

    @wp.func
    def axial(C: mat33):
        return vec3(C[2, 1] - C[1, 2], C[0, 2] - C[2, 0], C[1, 0] - C[0, 1])

    @wp.kernel(module="unique", enable_backward=False, module_options=OPTIONS)
    def sum_momenta(
        first: int, cloud: Cloud, frame: Frame, grid: types.Nodes, kick: types.Nodes, bodies: Bodies
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
    def settle(bodies: Bodies, clock: types.Reals, rest: real):
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


@cache
def fly_kernel(real: Any) -> Any:
    """Particles that fly by themselves: they fall freely, and land on walls as balls do.

    (first, rows, cloud, gravity, clock, normals, heights, velocities, modes, frictions, impulse):
    ``rows`` (m,) of them; of walls (w,) the planes that touch them nearest to each, (w, m). What
    comes upon a wall keeps the speed that takes it there, and is braked as Coulomb's law says by
    what was taken; C and F stay, and with them the angular momentum.
    """
    types = types_of(real)
    Cloud, vec3 = types.Cloud, types.vec3

    @wp.kernel(module="unique", enable_backward=False)
    def fly(
        first: int,
        rows: Ints,
        cloud: Cloud,
        gravity: vec3,
        clock: types.Reals,
        normals: wp.array2d(dtype=vec3),
        heights: wp.array2d(dtype=real),
        velocities: types.Vectors,
        modes: Ints,
        frictions: types.Reals,
        impulse: types.Vectors,
    ):
        i = first + wp.tid()
        p = rows[i]
        dt = clock[0]
        x = cloud.x[p]
        v = clock[1] * (cloud.v[p] + dt * gravity)
        for w in range(modes.shape[0]):
            n = normals[w, i]
            gap = wp.max(wp.dot(n, x) - heights[w, i], real(0.0))
            u = v - velocities[w]
            into = wp.dot(u, n)
            if gap + dt * into < real(0.0) or (
                gap == real(0.0) and modes[w] != wp.static(int(Touch.SEPARATE))
            ):
                slide = u - into * n
                speed = wp.length(slide)
                if modes[w] == wp.static(int(Touch.STICKY)):
                    u = vec3()
                elif modes[w] == wp.static(int(Touch.SLIP)):
                    u = slide
                else:
                    u = -gap / dt * n
                    if speed > real(0.0):
                        taken = frictions[w] * (-gap / dt - into)
                        u = u + wp.max(real(0.0), real(1.0) - taken / speed) * slide
                wp.atomic_add(impulse, w, cloud.m[p] * (velocities[w] + u - v))
                v = velocities[w] + u
        cloud.v[p] = v
        cloud.x[p] = x + dt * v

    return fly


@cache
def order_kernels(real: Any) -> SimpleNamespace:
    """Kernels that sort particles by cells, and list the nodes that they reach.

    ``key`` (first, span, cloud, frame, keys, rows) numbers cells span by span; ``reorder`` (rows,
    old, old order, cloud, order) takes particles from there; ``occupy`` (cloud, frame, stamp,
    cells) and ``part`` (cloud, frame, drift, stamp, cells, count) find those that fly by
    themselves, ``reach`` (places, alone, frame, drift, stamp, marks, nodes, count) lists the nodes
    of the others. What another ``stamp`` marked is not marked.
    """
    types = types_of(real)
    Cloud, Frame, vec3 = types.Cloud, types.Frame, types.vec3
    place, inside, _, _ = transfer_functions(real)

    @wp.func
    def first_node(frame: Frame, g: vec3):
        """Lowest of the 27 nodes around a place; the nearest that there is outside."""
        i = wp.clamp(int(wp.floor(g[0])), 0, frame.nx - 3)
        j = wp.clamp(int(wp.floor(g[1])), 0, frame.ny - 3)
        k = wp.clamp(int(wp.floor(g[2])), 0, frame.nz - 3)
        return wp.vec3i(i, j, k)

    @wp.kernel(module=f"mpm_grid_{real.__name__}", enable_backward=False)
    def key(first: int, span: int, cloud: Cloud, frame: Frame, keys: Ints, rows: Ints):
        p = first + wp.tid()
        n = first_node(frame, place(frame, cloud.x[p]))
        keys[p] = ((span * frame.nx + n[0]) * frame.ny + n[1]) * frame.nz + n[2]
        rows[p] = p

    @wp.kernel(module=f"mpm_grid_{real.__name__}", enable_backward=False)
    def reorder(rows: Ints, old: Cloud, old_order: Ints, cloud: Cloud, order: Ints):
        p = wp.tid()
        s = rows[p]
        order[p] = old_order[s]
        cloud.x[p] = old.x[s]
        cloud.rest[p] = old.rest[s]
        cloud.v[p] = old.v[s]
        cloud.C[p] = old.C[s]
        cloud.H[p] = old.H[s]
        cloud.total[p] = old.total[s]
        cloud.m[p] = old.m[s]
        cloud.volume[p] = old.volume[s]
        cloud.mu[p] = old.mu[s]
        cloud.lam[p] = old.lam[s]
        cloud.k[p] = old.k[s]
        cloud.q[p] = old.q[s]
        cloud.body[p] = old.body[s]
        cloud.alone[p] = old.alone[s]
        if cloud.push.shape[0] > 0:
            cloud.push[p] = old.push[s]

    @wp.kernel(module=f"mpm_grid_{real.__name__}", enable_backward=False)
    def occupy(cloud: Cloud, frame: Frame, stamp: int, cells: Ints):
        """A cell of one particle has twice the stamp, one of more has that and one."""
        p = wp.tid()
        g = place(frame, cloud.x[p])
        if inside(frame, g):
            n = first_node(frame, g)
            at = (n[0] * frame.ny + n[1]) * frame.nz + n[2]
            if wp.atomic_max(cells, at, 2 * stamp) >= 2 * stamp:
                wp.atomic_max(cells, at, 2 * stamp + 1)

    @wp.kernel(module=f"mpm_grid_{real.__name__}", enable_backward=False)
    def part(cloud: Cloud, frame: Frame, drift: int, stamp: int, cells: Ints, count: Ints):
        """Whether particles share no node with others, however both ``drift`` until asked again."""
        p = wp.tid()
        g = place(frame, cloud.x[p])
        if cloud.body[p] >= 0:
            return
        if not inside(frame, g):
            if cloud.alone[p] == 0:
                cloud.alone[p] = LOST
            wp.atomic_add(count, 1, 1)
            return
        n = first_node(frame, g)
        at = (n[0] * frame.ny + n[1]) * frame.nz + n[2]
        cloud.alone[p] = 0
        if cells[at] > 2 * stamp:
            return
        far = 2 + 2 * drift
        for i in range(wp.max(n[0] - far, 0), wp.min(n[0] + far + 1, frame.nx)):
            for j in range(wp.max(n[1] - far, 0), wp.min(n[1] + far + 1, frame.ny)):
                for k in range(wp.max(n[2] - far, 0), wp.min(n[2] + far + 1, frame.nz)):
                    other = (i * frame.ny + j) * frame.nz + k
                    if other != at and cells[other] >= 2 * stamp:
                        return
        cloud.alone[p] = APART
        wp.atomic_add(count, 1, 1)

    @wp.kernel(module=f"mpm_grid_{real.__name__}", enable_backward=False)
    def reach(
        x: types.Vectors,
        alone: Ints,
        frame: Frame,
        drift: int,
        stamp: int,
        marks: Ints,
        nodes: Ints,
        count: Ints,
    ):
        """One of the particles of a cell that follow each other does it for all."""
        p = wp.tid()
        g = place(frame, x[p])
        if alone[p] != 0 or not inside(frame, g):
            return
        n = first_node(frame, g)
        if p > 0:
            before = place(frame, x[p - 1])
            if inside(frame, before):
                if first_node(frame, before) == n:
                    return
        for i in range(wp.max(n[0] - drift, 0), wp.min(n[0] + 3 + drift, frame.nx)):
            for j in range(wp.max(n[1] - drift, 0), wp.min(n[1] + 3 + drift, frame.ny)):
                for k in range(wp.max(n[2] - drift, 0), wp.min(n[2] + 3 + drift, frame.nz)):
                    node = (i * frame.ny + j) * frame.nz + k
                    if wp.atomic_max(marks, node, stamp) < stamp:
                        row = wp.atomic_add(count, 0, 1)
                        if row < nodes.shape[0]:
                            nodes[row] = node

    kernels = {"occupy": occupy, "part": part, "reach": reach}
    return SimpleNamespace(key=key, reorder=reorder, **kernels)


# Entries of the survey: maxima, those of the places and of their opposites, and counts.
SPEED, MOVED, SPREAD, WAVE, HIGH, _, _, LOW, _, _, OUTSIDE, NOT_FINITE, INVERTED, COUNT = range(14)
# What maxima of places start from [m].
LEAST = -1e30
# Threads of the survey: each looks at many particles, for maxima of all meet in one number.
LOOKERS = 16384


@cache
def survey_kernel(kind: MaterialClass, real: Any, form: Form = Form.PLAIN) -> Any:
    """(first, count, stride, cloud, frame, listed, survey) for a class: maxima, and counts.

    Each of ``stride`` threads looks at every so manieth particle. ``listed`` are the places for
    which nodes were listed; moves are in spacings. What tore has lost the stiffness of its stretch,
    however far its crack is open; what flies by itself has none, and goes beyond the bounds.
    """
    types = types_of(real)
    place, inside, _, _ = transfer_functions(real)
    vec3, Cloud, Frame = types.vec3, types.Cloud, types.Frame
    fluid, snow = kind == MaterialClass.FLUID, kind == MaterialClass.SNOW
    tears, rigid = form == Form.TEARING, kind == MaterialClass.STATIONARY
    least = wp.constant(real(LEAST))

    @wp.kernel(module="unique", enable_backward=False)
    def look(
        first: int,
        count: int,
        stride: int,
        cloud: Cloud,
        frame: Frame,
        listed: types.Vectors,
        survey: types.Reals,
    ):
        speed = real(0.0)
        moved = real(0.0)
        spread = real(0.0)
        wave = real(0.0)
        high = vec3(least)
        low = vec3(least)
        for p in range(first + wp.tid(), first + count, stride):
            x = cloud.x[p]
            v = cloud.v[p]
            C = cloud.C[p]
            H = cloud.H[p]
            if not wp.isfinite(wp.dot(x, x) + wp.dot(v, v) + wp.ddot(C, C) + wp.ddot(H, H)):
                wp.atomic_add(survey, wp.static(NOT_FINITE), real(1.0))
            else:
                alone = cloud.alone[p]
                if alone != APART and not inside(frame, place(frame, x)):
                    wp.atomic_add(survey, wp.static(OUTSIDE), real(1.0))
                away = (x - listed[p]) / frame.spacing
                most = wp.max(wp.abs(away[0]), wp.max(wp.abs(away[1]), wp.abs(away[2])))
                speed = wp.max(speed, wp.length(v))
                moved = wp.max(moved, most)
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
                if alone == 0:
                    spread = wp.max(spread, wp.sqrt(wp.ddot(C, C)))
                    high = wp.max(high, x)
                    low = wp.max(low, -x)
                    wave = wp.max(wave, wp.sqrt(stiff / density))
        wp.atomic_max(survey, wp.static(SPEED), speed)
        wp.atomic_max(survey, wp.static(MOVED), moved)
        wp.atomic_max(survey, wp.static(SPREAD), spread)
        wp.atomic_max(survey, wp.static(WAVE), wave)
        for k in range(3):
            wp.atomic_max(survey, wp.static(HIGH) + k, high[k])
            wp.atomic_max(survey, wp.static(LOW) + k, low[k])

    return look


@cache
def energy_kernel(kind: MaterialClass, real: Any, form: Form = Form.PLAIN) -> Any:
    """(first, count, stride, cloud, total) for a class: add elastic energies [J], in double.

    Torn particles are left out: theirs is not known. So are damage of jelly and hardening of snow.
    """
    Cloud, eigen = types_of(real).Cloud, stretch_functions(wp.float64)[0]
    tears, gamma = form == Form.TEARING, wp.constant(wp.float64(GAMMA))
    corotated = form == Form.COROTATED or kind == MaterialClass.SNOW
    one, half = wp.constant(wp.float64(1.0)), wp.constant(wp.float64(0.5))

    @wp.func
    def neo_hookean(H: wp.mat33d, lam: wp.float64, mu: wp.float64, bulk: wp.float64):
        energy, _stress = energy_and_stress(H, lam, mu)
        return energy

    @wp.func
    def fluid(H: wp.mat33d, lam: wp.float64, mu: wp.float64, bulk: wp.float64):
        J = one + volume_change(H)
        gained = wp.pow(J, one - gamma) / (gamma - one) + J - gamma / (gamma - one)
        return bulk / gamma * gained

    @wp.func
    def by_stretches(H: wp.mat33d, lam: wp.float64, mu: wp.float64, bulk: wp.float64):
        """Of logarithmic strains; of stretches less one, and the volume's change, if corotated."""
        _axes, d = eigen(H + wp.transpose(H) + H * wp.transpose(H))
        e = wp.vec3d()
        for i in range(3):
            square = wp.max(one + d[i], wp.float64(1e-300))
            if wp.static(corotated):
                e[i] = wp.sqrt(square) - one
            else:
                e[i] = half * wp.log(square)
        grow = e[0] + e[1] + e[2]
        if wp.static(corotated):
            grow = volume_change(H)
        return mu * wp.dot(e, e) + half * lam * grow * grow

    density = by_stretches
    if form in (Form.PLAIN, Form.TEARING) and kind == MaterialClass.JELLY:
        density = neo_hookean
    elif kind == MaterialClass.FLUID:
        density = fluid

    @wp.kernel(module="unique", enable_backward=False)
    def add(first: int, count: int, stride: int, cloud: Cloud, total: Doubles):
        sum = wp.float64(0.0)
        for p in range(first + wp.tid(), first + count, stride):
            torn = bool(False)  # noqa: UP018 (a plain False is a constant to warp)
            if wp.static(tears):
                torn = cloud.q[p] > real(1.0)
            if not torn:
                lam = wp.float64(cloud.lam[p])
                mu = wp.float64(cloud.mu[p])
                W = density(wp.mat33d(cloud.H[p]), lam, mu, wp.float64(cloud.k[p][0]))
                sum += wp.float64(cloud.volume[p]) * W
        wp.atomic_add(total, 0, sum)

    return add
