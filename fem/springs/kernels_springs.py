# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels of spring networks: what planes push, what springs pull, and the step.

Every anchor gathers its own springs. A spring is evaluated from both ends with the very same
numbers but for their signs, so that the forces of a pair cancel to the last bit.
"""

import warp as wp


@wp.struct
class Springs:
    """Springs by anchor, ``first`` ... (anchors + 1): far end, stiffness, length, dashpot."""

    first: wp.array(dtype=int)
    other: wp.array(dtype=int)
    stiffness: wp.array(dtype=wp.float64)
    length: wp.array(dtype=wp.float64)
    dashpot: wp.array(dtype=wp.float64)
    load: wp.array(dtype=wp.vec3d)
    ground: wp.array(dtype=wp.vec3d)
    inverse_mass: wp.array(dtype=wp.vec3d)
    rest: wp.array(dtype=wp.vec3d)


@wp.struct
class Contacts:
    """Points of the surface, the anchors that they follow, and planes that they meet.

    By point: ``first``, ``anchor``, ``weight``; by anchor: ``back``, ``point``, ``share``. Planes
    have a ``place`` and a ``speed``; a point is pushed from ``reach`` on, with ``stiffness``, and
    is rubbed with at most ``grip`` [N s/m].
    """

    first: wp.array(dtype=int)
    anchor: wp.array(dtype=int)
    weight: wp.array(dtype=wp.float64)
    back: wp.array(dtype=int)
    point: wp.array(dtype=int)
    share: wp.array(dtype=wp.float64)
    rest: wp.array(dtype=wp.vec3d)
    stiffness: wp.array(dtype=wp.float64)
    grip: wp.array(dtype=wp.float64)
    place: wp.array(dtype=wp.vec3d)
    normal: wp.array(dtype=wp.vec3d)
    speed: wp.array(dtype=wp.vec3d)
    reach: wp.float64
    friction: wp.float64


@wp.struct
class Now:
    """State of the anchors; forces on the points of the surface, and what planes gave so far."""

    x: wp.array(dtype=wp.vec3d)
    v: wp.array(dtype=wp.vec3d)
    a: wp.array(dtype=wp.vec3d)
    push: wp.array(dtype=wp.vec3d)
    impulse: wp.array(dtype=wp.vec3d)
    clock: wp.array(dtype=wp.float64)


@wp.func
def push_of(p: int, contacts: Contacts, now: Now, time: wp.float64, dt: wp.float64):
    """Force of all planes on a point of the surface [N]; Coulomb friction, at most a stop."""
    v = wp.vec3d()
    x = contacts.rest[p] + v
    for e in range(contacts.first[p], contacts.first[p + 1]):
        a, w = contacts.anchor[e], contacts.weight[e]
        x += w * now.x[a]
        v += w * now.v[a]
    total = wp.vec3d()
    planes = contacts.place.shape[0]
    for o in range(planes):
        n = contacts.normal[o]
        gap = wp.dot(x - contacts.place[o] - time * contacts.speed[o], n)
        if gap < contacts.reach:
            normal = contacts.stiffness[p] * (contacts.reach - gap)
            slip = v - contacts.speed[o]
            slip -= wp.dot(slip, n) * n
            speed = wp.length(slip)
            force = normal * n
            if contacts.friction > wp.float64(0.0) and speed > wp.float64(0.0):
                force -= wp.min(contacts.friction * normal / speed, contacts.grip[p]) * slip
            now.impulse[p * planes + o] += dt * force
            total += force
    return total


@wp.func
def acceleration(i: int, springs: Springs, contacts: Contacts, now: Now):
    """Acceleration [m/s^2] of an anchor by its springs, loads, and contacts around it."""
    x, v = now.x[i], now.v[i]
    force = springs.load[i] - wp.cw_mul(springs.ground[i], x - springs.rest[i])
    for e in range(springs.first[i], springs.first[i + 1]):
        j = springs.other[e]
        d = now.x[j] - x
        length = wp.length(d)
        pull = springs.stiffness[e] * (length - springs.length[e])
        c = springs.dashpot[e]
        if c > wp.float64(0.0):
            pull += c * wp.dot(now.v[j] - v, d) / length
        force += (pull / length) * d
    if contacts.back.shape[0] > 0:
        for e in range(contacts.back[i], contacts.back[i + 1]):
            force += contacts.share[e] * now.push[contacts.point[e]]
    return wp.cw_mul(springs.inverse_mass[i], force)


@wp.kernel(enable_backward=False)
def meet(contacts: Contacts, now: Now, counted: wp.float64):
    """Forces of the planes on the points of the surface; their impulses count so many times."""
    p = wp.tid()
    now.push[p] = push_of(p, contacts, now, now.clock[0], counted * now.clock[1])


@wp.kernel(enable_backward=False)
def pull(springs: Springs, contacts: Contacts, now: Now):
    """Accelerations of the anchors."""
    i = wp.tid()
    now.a[i] = acceleration(i, springs, contacts, now)


@wp.kernel(enable_backward=False)
def move(now: Now):
    """Symplectic Euler: v += dt a, x += dt v."""
    i = wp.tid()
    dt = now.clock[1]
    now.v[i] += dt * now.a[i]
    now.x[i] += dt * now.v[i]


@wp.kernel(enable_backward=False)
def tick(now: Now):
    """Advance the clock."""
    now.clock[0] += now.clock[1]


@wp.kernel(enable_backward=False)
def follow(steps: int, springs: Springs, contacts: Contacts, now: Now):
    """Take ``steps`` steps in one thread: on a CPU a launch costs as much as many springs."""
    dt = now.clock[1]
    for _step in range(steps):
        for p in range(contacts.rest.shape[0]):
            now.push[p] = push_of(p, contacts, now, now.clock[0], dt)
        for i in range(now.x.shape[0]):
            now.a[i] = acceleration(i, springs, contacts, now)
        for i in range(now.x.shape[0]):
            now.v[i] += dt * now.a[i]
            now.x[i] += dt * now.v[i]
        now.clock[0] += dt
