# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels of spring networks: sight, what planes push, what springs pull, and the step.

One thread takes every spring once, and its force with either sign, so that the forces of a pair
cancel to the last bit; all steps of a chunk are one launch, which costs as much as many springs.
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

    By point: ``first``, ``anchor``, ``weight``. Planes have a ``place`` and a ``speed``; a point is
    pushed from ``reach`` on, with ``stiffness``, and is rubbed with at most ``grip`` [N s/m].
    """

    first: wp.array(dtype=int)
    anchor: wp.array(dtype=int)
    weight: wp.array(dtype=wp.float64)
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
def accelerate(counted: wp.float64, springs: Springs, contacts: Contacts, now: Now):
    """Accelerations of all anchors in one thread; impulses of planes count so many times dt."""
    for p in range(contacts.rest.shape[0]):
        now.push[p] = push_of(p, contacts, now, now.clock[0], counted * now.clock[1])
    count = now.x.shape[0]
    for i in range(count):
        now.a[i] = springs.load[i] - wp.cw_mul(springs.ground[i], now.x[i] - springs.rest[i])
    for p in range(contacts.rest.shape[0]):
        for e in range(contacts.first[p], contacts.first[p + 1]):
            now.a[contacts.anchor[e]] += contacts.weight[e] * now.push[p]
    for i in range(count):
        x, v = now.x[i], now.v[i]
        total = wp.vec3d()
        for e in range(springs.first[i], springs.first[i + 1]):
            j = springs.other[e]
            d = now.x[j] - x
            length = wp.length(d)
            pull = springs.stiffness[e] * (length - springs.length[e])
            c = springs.dashpot[e]
            if c > wp.float64(0.0):
                pull += c * wp.dot(now.v[j] - v, d) / length
            force = (pull / length) * d
            total += force
            now.a[j] -= force
        now.a[i] += total
    for i in range(count):
        now.a[i] = wp.cw_mul(springs.inverse_mass[i], now.a[i])


@wp.kernel(enable_backward=False)
def balance(springs: Springs, contacts: Contacts, now: Now):
    """Accelerations where the anchors are now; no time passes."""
    accelerate(wp.float64(0.0), springs, contacts, now)


@wp.kernel(enable_backward=False)
def follow(steps: int, springs: Springs, contacts: Contacts, now: Now):
    """Take ``steps`` steps of symplectic Euler: v += dt a, x += dt v."""
    dt = now.clock[1]
    for _step in range(steps):
        accelerate(wp.float64(1.0), springs, contacts, now)
        for i in range(now.x.shape[0]):
            now.v[i] += dt * now.a[i]
            now.x[i] += dt * now.v[i]
        now.clock[0] += dt


@wp.kernel(enable_backward=False)
def crosses(
    mesh: wp.uint64, start: wp.array(dtype=wp.vec3), end: wp.array(dtype=wp.vec3),
    hit: wp.array(dtype=int),
):  # fmt: skip
    """1 where the segment meets a face of the mesh."""
    i = wp.tid()
    way = end[i] - start[i]
    length = wp.length(way)
    if length > 0.0:
        query = wp.mesh_query_ray(mesh, start[i], way / length, length)
        if query.result:
            hit[i] = 1


@wp.kernel(enable_backward=False)
def depths(mesh: wp.uint64, points: wp.array(dtype=wp.vec3), out: wp.array(dtype=float)):
    """Distance of every point from the mesh, whose size is one."""
    i = wp.tid()
    query = wp.mesh_query_point_no_sign(mesh, points[i], 10.0)
    if query.result:
        place = wp.mesh_eval_position(mesh, query.face, query.u, query.v)
        out[i] = wp.length(points[i] - place)
