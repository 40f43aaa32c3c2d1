# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernel that looks over the particles: how fast, how far, how stiff, how many are lost."""

from functools import cache
from typing import Any

import warp as wp

from ..classes import Form, MaterialClass
from .kernels_stretch import stretch_functions
from .kernels_transfer import types_of, weight_functions

# Entries of the survey.
SPEED, MOVED, SPREAD, WAVE, OUTSIDE, NOT_FINITE, INVERTED, COUNT = range(8)


@cache
def survey_kernel(kind: MaterialClass, real: Any, form: Form = Form.PLAIN) -> Any:
    """(first, cloud, frame, listed, found) for a class: maxima, and counts of the last entries.

    ``listed`` are the places for which nodes were listed; moves are in spacings. What tore has lost
    the stiffness of its stretch, however far its crack is open.
    """
    types = types_of(real)
    place, inside, _ = weight_functions(real)
    vec3, Cloud, Frame = types.vec3, types.Cloud, types.Frame
    volume_change = stretch_functions(real).volume_change
    fluid, snow = kind == MaterialClass.FLUID, kind == MaterialClass.SNOW
    tears, rigid = form == Form.TEARING, kind == MaterialClass.STATIONARY

    @wp.kernel(module="unique", enable_backward=False)
    def survey(
        first: int,
        cloud: Cloud,
        frame: Frame,
        listed: wp.array(dtype=vec3),
        found: wp.array(dtype=real),
    ):
        p = first + wp.tid()
        x = cloud.x[p]
        v = cloud.v[p]
        C = cloud.C[p]
        H = cloud.H[p]
        if not wp.isfinite(wp.dot(x, x) + wp.dot(v, v) + wp.ddot(C, C) + wp.ddot(H, H)):
            wp.atomic_add(found, wp.static(NOT_FINITE), real(1.0))
        else:
            if not inside(frame, place(frame, x)):
                wp.atomic_add(found, wp.static(OUTSIDE), real(1.0))
            away = (x - listed[p]) / frame.spacing
            most = wp.max(wp.abs(away[0]), wp.max(wp.abs(away[1]), wp.abs(away[2])))
            wp.atomic_max(found, wp.static(SPEED), wp.length(v))
            wp.atomic_max(found, wp.static(MOVED), most)
            wp.atomic_max(found, wp.static(SPREAD), wp.sqrt(wp.ddot(C, C)))
            J = real(1.0) + volume_change(H)
            if J <= real(0.0):
                wp.atomic_add(found, wp.static(INVERTED), real(1.0))
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
            wp.atomic_max(found, wp.static(WAVE), wp.sqrt(stiff / density))

    return survey
