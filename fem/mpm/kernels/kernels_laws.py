# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp functions of the seven classes: return mapping, and Kirchhoff stress.

Each is (H, C, mu, lam, k, q, dt) -> (H, tau, q): H = F - I of the elastic part, C the gradient of
velocity [1/s], Lame parameters [Pa], the numbers ``k`` of ``Substance.numbers``, the state q, the
step [s]. With eps = 1/2 log F F^T and d its deviator, every return is F <- exp(eps_new - eps) F.
"""

from functools import cache
from typing import Any

import warp as wp

from ..classes import Form, MaterialClass
from .kernels_stretch import stretch_functions


class _Types:
    """Types of one precision."""

    def __init__(self, real: Any) -> None:
        self.vec3 = wp.types.vector(length=3, dtype=real)
        self.mat33 = wp.types.matrix(shape=(3, 3), dtype=real)


@cache
def law_function(kind: MaterialClass, real: Any, form: Form = Form.PLAIN) -> Any:
    """Function of a class in ``real`` numbers (wp.float32, wp.float64)."""
    if kind == MaterialClass.JELLY:
        return {Form.TEARING: _tearing, Form.COROTATED: _corotated}.get(form, _jelly)(real)
    makers = {
        MaterialClass.METAL: _metal,
        MaterialClass.SAND: _sand,
        MaterialClass.VISPLAS: _visplas,
        MaterialClass.FLUID: _fluid,
        MaterialClass.SNOW: _snow,
        MaterialClass.STATIONARY: _rigid,
    }
    return makers[kind](real)


@cache
def _neo_hookean(real: Any) -> Any:
    """The stable neo-Hookean law of ``laws.neo_hookean``, as Kirchhoff stress."""
    mat33 = _Types(real).mat33
    volume_change = stretch_functions(real).volume_change

    @wp.func
    def kirchhoff(H: mat33, mu: real, lam: real):
        grow = volume_change(H)
        bulk = ((lam + mu) * (real(1.0) + grow) - mu) * grow
        strain = H + wp.transpose(H) + H * wp.transpose(H)
        return mu * strain + bulk * wp.identity(n=3, dtype=real)

    return kirchhoff


def _jelly(real: Any) -> Any:
    vec3, mat33 = _Types(real).vec3, _Types(real).mat33
    kirchhoff = _neo_hookean(real)

    @wp.func
    def jelly(H: mat33, C: mat33, mu: real, lam: real, k: vec3, q: real, dt: real):
        return H, kirchhoff(H, mu, lam), q

    return jelly


def _corotated(real: Any) -> Any:
    """Fixed corotated (Stomakhin et al. 2012): tau = 2 mu (V - I) V + lam (J - 1) J I, V^2 = b."""
    vec3, mat33 = _Types(real).vec3, _Types(real).mat33
    stretch = stretch_functions(real)
    eigen, symmetric, root = stretch.eigen, stretch.symmetric, stretch.root
    volume_change = stretch.volume_change

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
        grow = volume_change(H)
        eye = wp.identity(n=3, dtype=real)
        return H, real(2.0) * mu * (S + S * S) + (lam * grow * (real(1.0) + grow)) * eye, q

    return corotated


def _rigid(real: Any) -> Any:
    """No stress: rigid bodies carry momentum alone."""
    vec3, mat33 = _Types(real).vec3, _Types(real).mat33

    @wp.func
    def rigid(H: mat33, C: mat33, mu: real, lam: real, k: vec3, q: real, dt: real):
        return H, mat33(), q

    return rigid


def _tearing(real: Any) -> Any:
    """Rankine damage on jelly: k = (f_t, softening H_s, 0), q the largest sigma_1 / f_t so far."""
    vec3, mat33 = _Types(real).vec3, _Types(real).mat33
    kirchhoff, stretch = _neo_hookean(real), stretch_functions(real)
    eigen, symmetric = stretch.eigen, stretch.symmetric

    @wp.func
    def tearing(H: mat33, C: mat33, mu: real, lam: real, k: vec3, q: real, dt: real):
        tau = kirchhoff(H, mu, lam)
        if q > real(1.0) or wp.ddot(tau, tau) > k[0] * k[0]:
            V, s = eigen(tau)
            q = wp.max(q, wp.max(s[0], wp.max(s[1], s[2])) / k[0])
            if q > real(1.0):
                keep = wp.exp(-k[1] * (q - real(1.0))) / q
                for i in range(3):
                    s[i] = wp.min(s[i], keep * wp.max(s[i], real(0.0)))
                tau = symmetric(V, s)
        return H, tau, q

    return tearing


@cache
def _linear_hencky(real: Any) -> Any:
    mat33 = _Types(real).mat33

    @wp.func
    def linear(e: mat33, mu: real, lam: real):
        return real(2.0) * mu * e + lam * wp.trace(e) * wp.identity(n=3, dtype=real)

    return linear


@cache
def _moved(real: Any) -> Any:
    """F <- exp(f) F on H = F - I."""
    mat33 = _Types(real).mat33
    exponential = stretch_functions(real).exponential

    @wp.func
    def moved(H: mat33, f: mat33):
        X = exponential(f)
        return H + X + X * H

    return moved


def _metal(real: Any) -> Any:
    """Von Mises with linear hardening: k = (sigma_y, H, 0), q the plastic strain."""
    vec3, mat33 = _Types(real).vec3, _Types(real).mat33
    hencky, linear, moved = stretch_functions(real).hencky, _linear_hencky(real), _moved(real)
    two_thirds = wp.constant(real(2.0 / 3.0))

    @wp.func
    def metal(H: mat33, C: mat33, mu: real, lam: real, k: vec3, q: real, dt: real):
        e = hencky(H)
        d = e - (wp.trace(e) / real(3.0)) * wp.identity(n=3, dtype=real)
        n = wp.sqrt(wp.ddot(d, d))
        over = real(2.0) * mu * n - wp.sqrt(two_thirds) * (k[0] + k[1] * q)
        if over > real(0.0):
            slip = over / (real(2.0) * mu + two_thirds * k[1])
            f = (-slip / n) * d
            H = moved(H, f)
            e = e + f
            q = q + wp.sqrt(two_thirds) * slip
        return H, linear(e, mu, lam), q

    return metal


def _sand(real: Any) -> Any:
    """Drucker-Prager (Klar et al. 2016) with the volume correction q of Tampubolon et al. 2017."""
    vec3, mat33 = _Types(real).vec3, _Types(real).mat33
    hencky, linear, moved = stretch_functions(real).hencky, _linear_hencky(real), _moved(real)

    @wp.func
    def sand(H: mat33, C: mat33, mu: real, lam: real, k: vec3, q: real, dt: real):
        e = hencky(H)
        eye = wp.identity(n=3, dtype=real)
        t = wp.trace(e) + q
        if t >= real(0.0):
            H = mat33()
            q = t
            e = mat33()
        else:
            f = (q / real(3.0)) * eye
            d = e - (wp.trace(e) / real(3.0)) * eye
            n = wp.sqrt(wp.ddot(d, d))
            over = n + k[0] * t * (real(3.0) * lam + real(2.0) * mu) / (real(2.0) * mu)
            if over > real(0.0):
                f = f - (over / n) * d
            if q != real(0.0) or over > real(0.0):
                H = moved(H, f)
                e = e + f
            q = real(0.0)
        return H, linear(e, mu, lam), q

    return sand


def _visplas(real: Any) -> Any:
    """Herschel-Bulkley (Yue et al. 2015): k = (sigma_y, eta, h)."""
    vec3, mat33 = _Types(real).vec3, _Types(real).mat33
    hencky, linear, moved = stretch_functions(real).hencky, _linear_hencky(real), _moved(real)
    share = wp.constant(real((2.0 / 3.0) ** 0.5))

    @wp.func
    def visplas(H: mat33, C: mat33, mu: real, lam: real, k: vec3, q: real, dt: real):
        e = hencky(H)
        d = e - (wp.trace(e) / real(3.0)) * wp.identity(n=3, dtype=real)
        n = wp.sqrt(wp.ddot(d, d))
        over = real(2.0) * mu * n - share * k[0]
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

    return visplas


def _fluid(real: Any) -> Any:
    """Cole's equation of state and viscosity: k = (K, gamma, eta). H holds J - 1 in one corner."""
    vec3, mat33 = _Types(real).vec3, _Types(real).mat33
    volume_change = stretch_functions(real).volume_change

    @wp.func
    def fluid(H: mat33, C: mat33, mu: real, lam: real, k: vec3, q: real, dt: real):
        eye = wp.identity(n=3, dtype=real)
        J = wp.max(real(1.0) + volume_change(H), real(1e-3))
        H = mat33()
        H[0, 0] = J - real(1.0)
        pressure = k[0] / k[1] * (wp.pow(J, -k[1]) - real(1.0))
        spread = real(0.5) * (C + wp.transpose(C)) - (wp.trace(C) / real(3.0)) * eye
        return H, J * (real(2.0) * k[2] * spread - pressure * eye), q

    return fluid


def _snow(real: Any) -> Any:
    """Stretches in [1 - k0, 1 + k1], hardening exp(k2 (1 - J_p)) (Stomakhin et al. 2013)."""
    vec3, mat33 = _Types(real).vec3, _Types(real).mat33
    stretch = stretch_functions(real)
    eigen, symmetric, root = stretch.eigen, stretch.symmetric, stretch.root
    positive, volume_change = stretch.positive, stretch.volume_change

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
        grow = volume_change(S)
        hard = wp.exp(wp.clamp(k[2] * (real(1.0) - q), real(-5.0), real(5.0)))
        tau = real(2.0) * mu * (S + S * S) + (lam * grow * (real(1.0) + grow)) * eye
        return H, hard * tau, q

    return snow
