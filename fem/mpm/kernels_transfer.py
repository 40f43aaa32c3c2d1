# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels between particles and grid: quadratic B-splines, APIC, MLS-MPM; stress by class.

Momentum and mass of a node are one ``vec4``, and what is common to the 27 nodes is summed before
them; a class is a kernel of its own, since branches cost more than a launch. Read from the tensors
(``stretch_functions``) over the classes (``class_laws``) and the splines (``transfer_functions``)
to the two kernels of a step, ``scatter_kernel`` and ``move_kernel``.
"""

from functools import cache
from typing import Any, NamedTuple

import warp as wp

from ..laws import neo_hookean
from ..laws.kernels_tensor import Ints, volume_change
from .materials import Form, MaterialClass

OPTIONS = {"max_unroll": 27}
# A crack whose stress is GONE to this fraction and that is open by more than the reach of two
# splines closes on its own faces no more: what is stretched further is as if stretched by this.
GONE, OPEN = 1e-9, 4.0
# What flies by itself: it shares no node with another, or it left the grid and meets none.
APART, LOST = 1, 2


class Types(NamedTuple):
    """Types of warp of one precision: ``Cloud`` and ``Frame`` are structs, the last are arrays."""

    real: Any
    vec3: Any
    vec4: Any
    mat33: Any
    Cloud: Any
    Frame: Any
    Reals: Any
    Vectors: Any
    Nodes: Any
    Tensors: Any


@cache
def types_of(real: Any) -> Types:
    """Types of ``real`` numbers: wp.float32 or wp.float64."""
    vec3 = wp.types.vector(length=3, dtype=real)
    vec4 = wp.types.vector(length=4, dtype=real)
    mat33 = wp.types.matrix(shape=(3, 3), dtype=real)
    arrays = [wp.array(dtype=dtype) for dtype in (real, vec3, vec4, mat33)]
    Reals, Vectors, _, Tensors = arrays

    @wp.struct
    class Cloud:
        """Particles: place, velocity, C, H = F - I, mass, volume, Lame, numbers of the class.

        ``alone`` is ``APART`` or ``LOST`` of what flies by itself, else 0.
        """

        x: Vectors
        rest: Vectors
        v: Vectors
        C: Tensors
        H: Tensors
        total: Tensors
        m: Reals
        volume: Reals
        mu: Reals
        lam: Reals
        k: Vectors
        q: Reals
        body: Ints
        alone: Ints
        push: Vectors

    @wp.struct
    class Frame:
        """A grid of (nx, ny, nz) nodes, ``spacing`` [m] apart from ``origin`` on."""

        origin: vec3
        spacing: real
        nx: int
        ny: int
        nz: int

    return Types(real, vec3, vec4, mat33, Cloud, Frame, *arrays)


@cache
def stretch_functions(real: Any) -> tuple[Any, ...]:
    """Eigenvectors, roots, logarithms and exponentials of tensors of ``real`` numbers.

    Functions of warp: (eigen, symmetric, root, positive, hencky, exponential).
    Displacement gradients H = F - I go in, so that small strains keep their digits in single
    precision. ``wp.svd3`` loses half of its digits and takes three times as long.
    """
    vec3, mat33 = types_of(real).vec3, types_of(real).mat33
    double = real is wp.float64
    tiny = wp.constant(real(1e-300 if double else 1e-30))
    digits = wp.constant(real(1e-15 if double else 1e-7))
    least = wp.constant(real((1e-15 if double else 1e-7) - 1.0))
    # Squared norms to which approximants hold: of the logarithm to 6e-11, of the exponential to
    # 1e-12, and its series of three terms to 4e-14.
    near_log, near_exp = wp.constant(real(0.04)), wp.constant(real(0.01))
    nearest = wp.constant(real(1e-6))

    @wp.func
    def turn(A: mat33, V: mat33, p: int, q: int, r: int):
        """One rotation of Jacobi's method in the plane of p and q."""
        off = A[p, q]
        if wp.abs(off) > tiny:
            theta = (A[q, q] - A[p, p]) / (real(2.0) * off)
            t = real(1.0) / (wp.abs(theta) + wp.sqrt(theta * theta + real(1.0)))
            if theta < real(0.0):
                t = -t
            c = real(1.0) / wp.sqrt(t * t + real(1.0))
            s = t * c
            A[p, p] = A[p, p] - t * off
            A[q, q] = A[q, q] + t * off
            A[p, q] = real(0.0)
            A[q, p] = real(0.0)
            u = A[r, p]
            v = A[r, q]
            A[r, p] = c * u - s * v
            A[p, r] = A[r, p]
            A[r, q] = s * u + c * v
            A[q, r] = A[r, q]
            for i in range(3):
                u = V[i, p]
                v = V[i, q]
                V[i, p] = c * u - s * v
                V[i, q] = s * u + c * v
        return A, V

    @wp.func
    def eigen(S: mat33):
        """Eigenvectors, in columns, and eigenvalues of a symmetric tensor."""
        A = real(0.5) * (S + wp.transpose(S))
        V = wp.identity(n=3, dtype=real)
        for _ in range(10):
            size = wp.abs(A[0, 0]) + wp.abs(A[1, 1]) + wp.abs(A[2, 2])
            if wp.abs(A[0, 1]) + wp.abs(A[0, 2]) + wp.abs(A[1, 2]) <= digits * size:
                break
            A, V = turn(A, V, 0, 1, 2)
            A, V = turn(A, V, 0, 2, 1)
            A, V = turn(A, V, 1, 2, 0)
        return V, vec3(A[0, 0], A[1, 1], A[2, 2])

    @wp.func
    def symmetric(V: mat33, d: vec3):
        """V diag(d) V^T."""
        return V * wp.diag(d) * wp.transpose(V)

    @wp.func
    def root(X: mat33):
        """sqrt(I + X) - I of a symmetric X of a norm below 0.08."""
        X2 = X * X
        X3 = X2 * X
        eye = wp.identity(n=3, dtype=real)
        low = eye + real(1.25) * X + real(0.375) * X2 + real(0.015625) * X3
        top = real(0.5) * X + real(0.5) * X2 + real(0.09375) * X3
        return top * wp.inverse(low)

    @wp.func
    def positive(S: mat33):
        """Whether a symmetric tensor is positive definite (Sylvester)."""
        minor = S[0, 0] * S[1, 1] - S[0, 1] * S[1, 0]
        return S[0, 0] > real(0.0) and minor > real(0.0) and wp.determinant(S) > real(0.0)

    @wp.func
    def hencky(H: mat33):
        """Logarithmic strain 1/2 log F F^T."""
        X = H + wp.transpose(H) + H * wp.transpose(H)
        eye = wp.identity(n=3, dtype=real)
        out = mat33()
        if wp.ddot(X, X) < near_log:
            X2 = X * X
            X3 = X2 * X
            X4 = X2 * X2
            top = X + real(1.5) * X2 + real(260.0 / 420.0) * X3 + real(25.0 / 420.0) * X4
            low = eye + real(2.0) * X + real(540.0 / 420.0) * X2
            low = low + real(120.0 / 420.0) * X3 + real(6.0 / 420.0) * X4
            out = real(0.5) * top * wp.inverse(low)
        else:
            V, d = eigen(X)
            for i in range(3):
                d[i] = real(0.5) * wp.log(real(1.0) + wp.max(d[i], least))
            out = symmetric(V, d)
        return out

    @wp.func
    def exponential(S: mat33):
        """exp(S) - I of a symmetric tensor."""
        eye = wp.identity(n=3, dtype=real)
        out = mat33()
        n2 = wp.ddot(S, S)
        if n2 < nearest:
            S2 = S * S
            out = S + real(0.5) * S2 + real(1.0 / 6.0) * (S2 * S)
        elif n2 < near_exp:
            S2 = S * S
            odd = real(0.5) * S + real(1.0 / 120.0) * (S2 * S)
            out = real(2.0) * wp.inverse(eye + real(0.1) * S2 - odd) * odd
        else:
            V, d = eigen(S)
            for i in range(3):
                d[i] = wp.exp(d[i]) - real(1.0)
            out = symmetric(V, d)
        return out

    return eigen, symmetric, root, positive, hencky, exponential


@cache
def class_laws(real: Any) -> dict[tuple[MaterialClass, Form], Any]:
    """Return mapping and Kirchhoff stress of the seven classes, and of the forms of jelly.

    Each is (H, C, mu, lam, k, q, dt) -> (H, tau, q): H = F - I of the elastic part, C the gradient
    of velocity [1/s], Lame parameters [Pa], the numbers ``k`` of ``Substance.numbers``, the state
    q, the step [s]. With eps = 1/2 log F F^T and d its deviator, every return is
    F <- exp(eps_new - eps) F.
    """
    vec3, mat33 = types_of(real).vec3, types_of(real).mat33
    eigen, symmetric, root, positive, hencky, exponential = stretch_functions(real)
    kirchhoff = neo_hookean.kirchhoff
    two_thirds = wp.constant(real(2.0 / 3.0))
    root_two_thirds = wp.constant(real((2.0 / 3.0) ** 0.5))
    gone, far = wp.constant(real(GONE)), wp.constant(real(OPEN))

    @wp.func
    def jelly(H: mat33, C: mat33, mu: real, lam: real, k: vec3, q: real, dt: real):
        return H, kirchhoff(H, lam, mu), q

    @wp.func
    def tearing(H: mat33, C: mat33, mu: real, lam: real, k: vec3, q: real, dt: real):
        """Rankine damage: k = (f_t, softening H_s, 0), q the largest sigma_1 / f_t so far.

        What is torn off and alone keeps its C, so that F would grow by exp(C t) without end.
        """
        tau = kirchhoff(H, lam, mu)
        if q > real(1.0) or wp.ddot(tau, tau) > k[0] * k[0]:
            V, s = eigen(tau)
            q = wp.max(q, wp.max(s[0], wp.max(s[1], s[2])) / k[0])
            if q > real(1.0):
                keep = wp.exp(-k[1] * (q - real(1.0))) / q
                for i in range(3):
                    s[i] = wp.min(s[i], keep * wp.max(s[i], real(0.0)))
                tau = symmetric(V, s)
                if keep < gone and wp.ddot(H, H) > far * far:
                    W, d = eigen(H + wp.transpose(H) + H * wp.transpose(H))
                    for i in range(3):
                        full = wp.sqrt(real(1.0) + wp.max(d[i], real(0.0)))
                        d[i] = wp.min(far / full, real(1.0)) - real(1.0)
                    R = symmetric(W, d)
                    H = H + R + R * H
        return H, tau, q

    @wp.func
    def stretched(S: mat33, grow: real, mu: real, lam: real):
        """Fixed corotated stress 2 mu (V - I) V + lam (J - 1) J I of S = V - I (Stomakhin 2012)."""
        volumetric = lam * grow * (real(1.0) + grow)
        return real(2.0) * mu * (S + S * S) + volumetric * wp.identity(n=3, dtype=real)

    @wp.func
    def corotated(H: mat33, C: mat33, mu: real, lam: real, k: vec3, q: real, dt: real):
        X = H + wp.transpose(H) + H * wp.transpose(H)
        S = mat33()
        if wp.ddot(X, X) < real(0.0064):
            S = root(X)
        else:
            V, d = eigen(X)
            for i in range(3):
                d[i] = wp.sqrt(wp.max(real(1.0) + d[i], real(0.0))) - real(1.0)
            S = symmetric(V, d)
        return H, stretched(S, volume_change(H), mu, lam), q

    @wp.func
    def rigid(H: mat33, C: mat33, mu: real, lam: real, k: vec3, q: real, dt: real):
        """No stress: rigid bodies carry momentum alone."""
        return H, mat33(), q

    @wp.func
    def linear(e: mat33, mu: real, lam: real):
        return real(2.0) * mu * e + lam * wp.trace(e) * wp.identity(n=3, dtype=real)

    @wp.func
    def deviator(e: mat33):
        return e - (wp.trace(e) / real(3.0)) * wp.identity(n=3, dtype=real)

    @wp.func
    def moved(H: mat33, f: mat33):
        """F <- exp(f) F on H = F - I."""
        X = exponential(f)
        return H + X + X * H

    @wp.func
    def metal(H: mat33, C: mat33, mu: real, lam: real, k: vec3, q: real, dt: real):
        """Von Mises with linear hardening: k = (sigma_y, H, 0), q the plastic strain."""
        e = hencky(H)
        d = deviator(e)
        n = wp.sqrt(wp.ddot(d, d))
        over = real(2.0) * mu * n - wp.sqrt(two_thirds) * (k[0] + k[1] * q)
        if over > real(0.0):
            slip = over / (real(2.0) * mu + two_thirds * k[1])
            f = (-slip / n) * d
            H = moved(H, f)
            e = e + f
            q = q + wp.sqrt(two_thirds) * slip
        return H, linear(e, mu, lam), q

    @wp.func
    def sand(H: mat33, C: mat33, mu: real, lam: real, k: vec3, q: real, dt: real):
        """Drucker-Prager (Klar 2016), volume correction q of Tampubolon et al. 2017."""
        e = hencky(H)
        t = wp.trace(e) + q
        if t >= real(0.0):
            H = mat33()
            q = t
            e = mat33()
        else:
            f = (q / real(3.0)) * wp.identity(n=3, dtype=real)
            d = deviator(e)
            n = wp.sqrt(wp.ddot(d, d))
            over = n + k[0] * t * (real(3.0) * lam + real(2.0) * mu) / (real(2.0) * mu)
            if over > real(0.0):
                f = f - (over / n) * d
            if q != real(0.0) or over > real(0.0):
                H = moved(H, f)
                e = e + f
            q = real(0.0)
        return H, linear(e, mu, lam), q

    @wp.func
    def visplas(H: mat33, C: mat33, mu: real, lam: real, k: vec3, q: real, dt: real):
        """Herschel-Bulkley (Yue et al. 2015): k = (sigma_y, eta, h)."""
        e = hencky(H)
        d = deviator(e)
        n = wp.sqrt(wp.ddot(d, d))
        over = real(2.0) * mu * n - root_two_thirds * k[0]
        if over > real(0.0):
            # Stress over the yield: eta (slip / dt)^h = over - 2 mu slip; convex in slip^h.
            slip = over / (real(2.0) * mu + k[1] / dt)
            if k[2] != real(1.0) and k[1] > real(0.0):
                left = over
                for _ in range(60):
                    # Of the stress left: slip / dt = (left / eta)^(1/h), halved if it overshoots.
                    rate = wp.pow(left / k[1], real(1.0) / k[2])
                    miss = left + real(2.0) * mu * dt * rate - over
                    slope = real(1.0) + real(2.0) * mu * dt * rate / (k[2] * left)
                    next = wp.max(left - miss / slope, real(0.5) * left)
                    done = wp.abs(next - left) <= real(1e-14) * over
                    left = next
                    if done:
                        break
                slip = (over - left) / (real(2.0) * mu)
            f = (-slip / n) * d
            H = moved(H, f)
            e = e + f
        return H, linear(e, mu, lam), q

    @wp.func
    def fluid(H: mat33, C: mat33, mu: real, lam: real, k: vec3, q: real, dt: real):
        """Cole's equation of state, viscosity: k = (K, gamma, eta); H[0, 0] holds J - 1."""
        eye = wp.identity(n=3, dtype=real)
        J = wp.max(real(1.0) + volume_change(H), real(1e-3))
        H = mat33()
        H[0, 0] = J - real(1.0)
        pressure = k[0] / k[1] * (wp.pow(J, -k[1]) - real(1.0))
        spread = deviator(real(0.5) * (C + wp.transpose(C)))
        return H, J * (real(2.0) * k[2] * spread - pressure * eye), q

    @wp.func
    def clamped(X: mat33, H: mat33, k: vec3, q: real):
        """Clamp the stretches of b = I + X: new H, J_p and stretches less one, as a tensor."""
        V, d = eigen(X)
        s = vec3()
        r = vec3()  # clamped over unclamped stretches, less one
        for i in range(3):
            full = wp.sqrt(wp.max(real(1.0) + d[i], real(1e-12))) - real(1.0)
            s[i] = wp.clamp(full, -k[0], k[1])
            r[i] = (s[i] - full) / (real(1.0) + full)
            q = q / (real(1.0) + r[i])
        R = symmetric(V, r)
        return H + R + R * H, q, symmetric(V, s)

    @wp.func
    def snow(H: mat33, C: mat33, mu: real, lam: real, k: vec3, q: real, dt: real):
        """Stretches in [1 - k0, 1 + k1], hardening exp(k2 (1 - J_p)) (Stomakhin 2013)."""
        eye = wp.identity(n=3, dtype=real)
        X = H + wp.transpose(H) + H * wp.transpose(H)
        least = (k[0] - real(2.0)) * k[0]
        most = (k[1] + real(2.0)) * k[1]
        S = mat33()
        # Most particles are within the clamps: no eigenvectors are needed to know that.
        small = wp.ddot(X, X) < real(0.0064)
        if small and positive(most * eye - X) and positive(X - least * eye):
            S = root(X)
        else:
            H, q, S = clamped(X, H, k, q)
        hard = wp.exp(wp.clamp(k[2] * (real(1.0) - q), real(-5.0), real(5.0)))
        return H, hard * stretched(S, volume_change(S), mu, lam), q

    jellies = {Form.PLAIN: jelly, Form.TEARING: tearing, Form.COROTATED: corotated}
    others = {
        MaterialClass.METAL: metal,
        MaterialClass.SAND: sand,
        MaterialClass.VISPLAS: visplas,
        MaterialClass.FLUID: fluid,
        MaterialClass.SNOW: snow,
        MaterialClass.STATIONARY: rigid,
    }
    by_form = {(MaterialClass.JELLY, form): law for form, law in jellies.items()}
    return by_form | {(kind, Form.PLAIN): law for kind, law in others.items()}


@cache
def transfer_functions(real: Any) -> tuple[Any, Any, Any, Any]:
    """Quadratic B-splines on the 27 nodes around a particle, as functions of warp.

    Its place in the grid, whether its 27 nodes are there, to them and from them.
    """
    types = types_of(real)
    vec3, vec4, mat33, Frame = types.vec3, types.vec4, types.mat33, types.Frame

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

    @wp.func
    def spread(frame: Frame, g: vec3, A: mat33, m: real, v: vec3, grid: types.Nodes):
        """Add mass and momentum to the 27 nodes."""
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

    @wp.func
    def gather(frame: Frame, g: vec3, grid: types.Nodes):
        """Velocity (and the fourth entry, averaged) and gradient C from the 27 nodes."""
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

    return place, inside, spread, gather


@cache
def scatter_kernel(kind: MaterialClass, real: Any, *, lagrangian: bool, form: Form) -> Any:
    """Particles to grid, of one class; ``lagrangian`` weights are those at rest.

    (first, cloud, frame, clock, grid): from the particle ``first`` on. ``clock`` is (dt, damping).
    """
    types = types_of(real)
    place, inside, spread, _ = transfer_functions(real)
    law = class_laws(real)[kind, form]
    Cloud, Frame = types.Cloud, types.Frame
    kept = kind not in (MaterialClass.JELLY, MaterialClass.STATIONARY) or form == Form.TEARING

    @wp.kernel(module="unique", enable_backward=False, module_options=OPTIONS)
    def scatter(first: int, cloud: Cloud, frame: Frame, clock: types.Reals, grid: types.Nodes):
        p = first + wp.tid()
        at = cloud.x[p]
        if wp.static(lagrangian):
            at = cloud.rest[p]
        g = place(frame, at)
        if cloud.alone[p] == 0 and inside(frame, g):
            dt = clock[0]
            C = cloud.C[p]
            H, tau, q = law(cloud.H[p], C, cloud.mu[p], cloud.lam[p], cloud.k[p], cloud.q[p], dt)
            if wp.static(kept):
                cloud.H[p] = H
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
def move_kernel(real: Any, *, lagrangian: bool, carries: bool) -> Any:
    """Grid to particles: (first, cloud, frame, clock, grid).

    With ``carries`` the total deformation is followed beside the elastic one.
    """
    types = types_of(real)
    place, inside, _, gather = transfer_functions(real)
    Cloud, Frame, vec3 = types.Cloud, types.Frame, types.vec3

    @wp.kernel(module="unique", enable_backward=False, module_options=OPTIONS)
    def move(first: int, cloud: Cloud, frame: Frame, clock: types.Reals, grid: types.Nodes):
        p = first + wp.tid()
        x = cloud.x[p]
        at = x
        if wp.static(lagrangian):
            at = cloud.rest[p]
        g = place(frame, at)
        if cloud.alone[p] == 0 and inside(frame, g):
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


@cache
def push_kernel(real: Any) -> Any:
    """Kernel (first, cloud, clock): velocities grow by the accelerations ``cloud.push``."""
    types = types_of(real)
    Cloud = types.Cloud

    @wp.kernel(module="unique", enable_backward=False)
    def push(first: int, cloud: Cloud, clock: types.Reals):
        p = first + wp.tid()
        cloud.v[p] = cloud.v[p] + clock[0] * cloud.push[p]

    return push
