# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels between particles and grid: quadratic B-splines, APIC, MLS-MPM.

Momentum and mass of a node are one ``vec4``, and what is common to the 27 nodes is summed before
them; a class is a kernel of its own, since branches cost more than a launch.
"""

from functools import cache
from typing import Any, NamedTuple

import warp as wp

from ..classes import Form, MaterialClass
from .kernels_laws import law_function

OPTIONS = {"max_unroll": 27}


class Types(NamedTuple):
    """Types of warp of one precision: ``Cloud`` and ``Frame`` are structs."""

    real: Any
    vec3: Any
    vec4: Any
    mat33: Any
    Cloud: Any
    Frame: Any


@cache
def types_of(real: Any) -> Types:
    """Types of ``real`` numbers: wp.float32 or wp.float64."""
    vec3 = wp.types.vector(length=3, dtype=real)
    vec4 = wp.types.vector(length=4, dtype=real)
    mat33 = wp.types.matrix(shape=(3, 3), dtype=real)

    @wp.struct
    class Cloud:
        """Particles: place, velocity, C, H = F - I, mass, volume, Lame, numbers of the class."""

        x: wp.array(dtype=vec3)
        rest: wp.array(dtype=vec3)
        v: wp.array(dtype=vec3)
        C: wp.array(dtype=mat33)
        H: wp.array(dtype=mat33)
        total: wp.array(dtype=mat33)
        m: wp.array(dtype=real)
        volume: wp.array(dtype=real)
        mu: wp.array(dtype=real)
        lam: wp.array(dtype=real)
        k: wp.array(dtype=vec3)
        q: wp.array(dtype=real)
        body: wp.array(dtype=int)
        push: wp.array(dtype=vec3)

    @wp.struct
    class Frame:
        """A grid of (nx, ny, nz) nodes, ``spacing`` [m] apart from ``origin`` on."""

        origin: vec3
        spacing: real
        nx: int
        ny: int
        nz: int

    return Types(real, vec3, vec4, mat33, Cloud, Frame)


class Weights(NamedTuple):
    """Functions of warp: place in the grid, whether its 27 nodes are there, and their weights."""

    place: Any
    inside: Any
    weights: Any


@cache
def weight_functions(real: Any) -> Weights:
    """Weights of quadratic B-splines."""
    vec3, mat33, Frame = types_of(real).vec3, types_of(real).mat33, types_of(real).Frame

    @wp.func
    def place(frame: Frame, x: vec3):
        """Place of the lowest corner of the 27 nodes, in spacings, exact for what lies inside."""
        return (x - frame.origin) / frame.spacing - vec3(real(0.5))

    @wp.func
    def inside(frame: Frame, g: vec3):
        """Whether all 27 nodes are in the grid; false for what is not finite."""
        least = wp.min(g[0], wp.min(g[1], g[2]))
        fits = g[0] < real(frame.nx - 2) and g[1] < real(frame.ny - 2) and g[2] < real(frame.nz - 2)
        return least >= real(0.0) and fits

    @wp.func
    def weights(f: vec3):
        """Weights by node (row) and axis (column), of the place ``f`` above the first node."""
        half = real(0.5)
        a = vec3(real(1.5)) - f
        b = f - vec3(real(1.0))
        c = f - vec3(half)
        most = real(0.75)
        return mat33(
            half * a[0] * a[0], half * a[1] * a[1], half * a[2] * a[2],
            most - b[0] * b[0], most - b[1] * b[1], most - b[2] * b[2],
            half * c[0] * c[0], half * c[1] * c[1], half * c[2] * c[2],
        )  # fmt: skip

    return Weights(place, inside, weights)


@cache
def scatter_kernel(kind: MaterialClass, real: Any, *, lagrangian: bool, form: Form) -> Any:
    """Particles to grid, of one class; ``lagrangian`` weights are those at rest.

    (first, cloud, frame, clock, grid): from the particle ``first`` on. ``clock`` is (dt, damping).
    """
    types, law = types_of(real), law_function(kind, real, form)
    place, inside, _ = weight_functions(real)
    spread = _spread_function(real)
    Cloud, Frame, vec4 = types.Cloud, types.Frame, types.vec4
    plastic = kind != MaterialClass.JELLY
    kept = (plastic or form == Form.TEARING) and kind != MaterialClass.STATIONARY
    plastic = plastic and kept

    @wp.kernel(module="unique", enable_backward=False, module_options=OPTIONS)
    def scatter(
        first: int,
        cloud: Cloud,
        frame: Frame,
        clock: wp.array(dtype=real),
        grid: wp.array(dtype=vec4),
    ):
        p = first + wp.tid()
        at = cloud.x[p]
        if wp.static(lagrangian):
            at = cloud.rest[p]
        g = place(frame, at)
        if inside(frame, g):
            dt = clock[0]
            C = cloud.C[p]
            H, tau, q = law(cloud.H[p], C, cloud.mu[p], cloud.lam[p], cloud.k[p], cloud.q[p], dt)
            if wp.static(plastic):
                cloud.H[p] = H
            if wp.static(kept):
                cloud.q[p] = q
            if wp.static(lagrangian):
                F = H + wp.identity(n=3, dtype=real)
                tau = tau * wp.transpose(wp.inverse(F))
            inv = real(1.0) / frame.spacing
            m = cloud.m[p]
            A = (-dt * cloud.volume[p] * real(4.0) * inv) * tau + (m * frame.spacing) * C
            spread(frame, g, A, m, cloud.v[p], grid)

    return scatter


@cache
def _spread_function(real: Any) -> Any:
    """Sum of mass and momentum over the 27 nodes."""
    types = types_of(real)
    vec3, vec4, mat33, Frame = types.vec3, types.vec4, types.mat33, types.Frame
    weights = weight_functions(real).weights

    @wp.func
    def spread(frame: Frame, g: vec3, A: mat33, m: real, v: vec3, grid: wp.array(dtype=vec4)):
        i = int(g[0])
        j = int(g[1])
        k = int(g[2])
        f = g - vec3(real(i), real(j), real(k)) + vec3(real(0.5))
        w = weights(f)
        o = vec3(real(0.0), real(1.0), real(2.0))
        mv = m * v - A * f
        mom = vec4(mv[0], mv[1], mv[2], m)
        a0 = vec4(A[0, 0], A[1, 0], A[2, 0], real(0.0))
        a1 = vec4(A[0, 1], A[1, 1], A[2, 1], real(0.0))
        a2 = vec4(A[0, 2], A[1, 2], A[2, 2], real(0.0))
        base = (i * frame.ny + j) * frame.nz + k
        for a in range(3):
            ma = w[a, 0] * (mom + o[a] * a0)
            sa = w[a, 0] * a1
            ca = w[a, 0] * a2
            for b in range(3):
                mb = w[b, 1] * (ma + o[b] * sa)
                cb = w[b, 1] * ca
                at = base + (a * frame.ny + b) * frame.nz
                grid[at] += w[0, 2] * mb
                grid[at + 1] += w[1, 2] * (mb + cb)
                grid[at + 2] += w[2, 2] * (mb + real(2.0) * cb)

    return spread


@cache
def gather_function(real: Any) -> Any:
    """Velocity (and the fourth entry, averaged) and gradient C from the 27 nodes."""
    types = types_of(real)
    vec3, vec4, mat33, Frame = types.vec3, types.vec4, types.mat33, types.Frame
    weights = weight_functions(real).weights

    @wp.func
    def gather(frame: Frame, g: vec3, grid: wp.array(dtype=vec4)):
        i = int(g[0])
        j = int(g[1])
        k = int(g[2])
        f = g - vec3(real(i), real(j), real(k)) + vec3(real(0.5))
        w = weights(f)
        o = vec3(real(0.0), real(1.0), real(2.0))
        base = (i * frame.ny + j) * frame.nz + k
        v = vec4()
        b0 = vec4()
        b1 = vec4()
        b2 = vec4()
        for a in range(3):
            va = vec4()
            for b in range(3):
                at = base + (a * frame.ny + b) * frame.nz
                u0 = w[0, 2] * grid[at]
                u1 = w[1, 2] * grid[at + 1]
                u2 = w[2, 2] * grid[at + 2]
                t = u0 + u1 + u2
                va += w[b, 1] * t
                b1 += (w[a, 0] * w[b, 1] * o[b]) * t
                b2 += (w[a, 0] * w[b, 1]) * (u1 + real(2.0) * u2)
            v += w[a, 0] * va
            b0 += (w[a, 0] * o[a]) * va
        s = real(4.0) / frame.spacing
        b0 = s * (b0 - f[0] * v)
        b1 = s * (b1 - f[1] * v)
        b2 = s * (b2 - f[2] * v)
        C = mat33(b0[0], b1[0], b2[0], b0[1], b1[1], b2[1], b0[2], b1[2], b2[2])
        return v, C

    return gather


@cache
def push_kernel(real: Any) -> Any:
    """Kernel (first, cloud, clock): velocities grow by the accelerations ``cloud.push``."""
    Cloud = types_of(real).Cloud

    @wp.kernel(module="unique", enable_backward=False)
    def push(first: int, cloud: Cloud, clock: wp.array(dtype=real)):
        p = first + wp.tid()
        cloud.v[p] = cloud.v[p] + clock[0] * cloud.push[p]

    return push


@cache
def move_kernel(real: Any, *, lagrangian: bool, carries: bool) -> Any:
    """Grid to particles: (first, cloud, frame, clock, grid).

    With ``carries`` the total deformation is followed beside the elastic one.
    """
    types = types_of(real)
    place, inside, _ = weight_functions(real)
    gather = gather_function(real)
    Cloud, Frame, vec3, vec4 = types.Cloud, types.Frame, types.vec3, types.vec4

    @wp.kernel(module="unique", enable_backward=False, module_options=OPTIONS)
    def move(
        first: int,
        cloud: Cloud,
        frame: Frame,
        clock: wp.array(dtype=real),
        grid: wp.array(dtype=vec4),
    ):
        p = first + wp.tid()
        x = cloud.x[p]
        at = x
        if wp.static(lagrangian):
            at = cloud.rest[p]
        g = place(frame, at)
        if inside(frame, g):
            dt = clock[0]
            u, C = gather(frame, g, grid)
            v = vec3(u[0], u[1], u[2])
            cloud.v[p] = v
            cloud.C[p] = C
            cloud.x[p] = x + dt * v
            D = dt * C
            H = cloud.H[p]
            if wp.static(lagrangian):
                cloud.H[p] = H + D
            else:
                cloud.H[p] = H + (D + D * H)
            if wp.static(carries):
                T = cloud.total[p]
                cloud.total[p] = T + (D + D * T)

    return move
