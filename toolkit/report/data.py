"""The numbers of the report as one JSON text: arrays in base64, safe inside a script element."""

from __future__ import annotations

import base64
import json

import numpy as np

from .content import Case, ReportContent
from .scale import PALETTES, PARTS

# Motion is thinned to this many numbers (frames x points x 3), 4.8 MB as base64 of int16: with 5 MB
# of plotly, a page of 20k tets stays below 12 MB.
MOTION_NUMBERS = 1_800_000
# What could end the element or is a line break to older script engines.
_ESCAPES = {ord(c): f"\\u{ord(c):04x}" for c in "<>&\u2028\u2029"}


def payload(content: ReportContent) -> str:
    """JSON text with the geometry of every case (equal ones once), its values and its motion."""
    geometries: list[dict] = []
    meshes: list = []
    cases = []
    for case in content.cases:
        same = (i for i, mesh in enumerate(meshes) if _same_shape(mesh, case.mesh))
        index = next(same, len(meshes))
        if index == len(meshes):
            meshes.append(case.mesh)
            geometries.append(_geometry(case))
        cases.append(
            {
                "geometry": index,
                **_values(case),
                **_motion(case, frames_shown(case, content)),
                **_vibrations(case),
                **_marks(case),
                "state": case.state,
                "clock": case.clock,
                **_touch(case),
                **_dial(case),
            }
        )
    document = {
        "up": content.up,
        "palettes": PALETTES,
        "parts": PARTS,
        "geometries": geometries,
        "cases": cases,
    }
    return json.dumps(document, allow_nan=False).translate(_ESCAPES)


def frames_shown(case: Case, content: ReportContent) -> np.ndarray:
    """Ids of the motion frames that the page has room for, first and last among them."""
    if case.motion is None:
        return np.arange(0)
    frames = len(case.motion)
    room = MOTION_NUMBERS // (len(content.cases) * case.motion[0].size)
    return np.unique(np.linspace(0, frames - 1, min(frames, max(2, room))).round().astype(int))


def _same_shape(a, b) -> bool:
    return (
        np.array_equal(a.points, b.points)
        and np.array_equal(a.tets, b.tets)
        and np.array_equal(a.region, b.region)
        and a.region_names == b.region_names
    )


def _geometry(case: Case) -> dict:
    mesh, look = case.mesh, case.look
    seen = {"colors": look.colors, "index": _packed(look.index, "u1")} if look else None
    return {
        "points": _packed(mesh.points, "<f4"),
        "tets": _packed(mesh.tets, "<u4"),
        "region": _packed(mesh.region, "<u4"),
        "names": list(mesh.region_names),
        "look": seen,
    }


def _values(case: Case) -> dict:
    material = case.mesh.material
    assert material is not None  # Case guarantees it
    values: dict[str, object] = {
        name: _packed(getattr(material, name), "<f4") for name in ("E", "nu", "rho")
    }
    if case.von_mises is not None:
        values["von_mises"] = _packed(case.von_mises, "<f4")
    if case.displacement is not None:
        values["displacement"] = _quantised(case.displacement[None])
    return values


def _motion(case: Case, shown: np.ndarray) -> dict:
    if case.motion is None or case.times is None:
        return {}
    return {"motion": _quantised(case.motion[shown]), "times": case.times[shown].tolist()}


def _vibrations(case: Case) -> dict:
    """Shapes of a largest length of 1 m each, and their frequencies [Hz]."""
    if case.vibrations is None or not case.frequencies:
        return {}
    largest = np.linalg.norm(case.vibrations, axis=2).max(axis=1)
    shapes = case.vibrations / largest[:, None, None]
    return {"vibrations": {**_quantised(shapes), "frequencies": list(case.frequencies)}}


def _marks(case: Case) -> dict:
    """Supports and loads to draw: places [m], and ways relative to the largest load."""
    if case.marks is None:
        return {}
    return {"marks": {name: array.tolist() for name, array in case.marks._asdict().items()}}


def _touch(case: Case) -> dict:
    """The reduced body: what it is stepped with exactly, what it is drawn with in 16-bit steps."""
    if case.touch is None:
        return {}
    model = case.touch.model
    used, faces = np.unique(model.faces, return_inverse=True)
    basis = model.basis[used]
    scales = np.abs(basis).max(axis=(0, 1)) / 32767
    lam, mu = model.lame
    gradients = model.gradients.reshape(len(model.cells), 9, -1).swapaxes(1, 2)
    exact = {"gradients": gradients, "weights": model.weights, "lam": lam, "mu": mu}
    region = np.zeros(len(model.points))
    region[case.mesh.tets.ravel()] = np.repeat(case.mesh.region, 4)
    packed = {
        **{name: _packed(array, "<f8") for name, array in exact.items()},
        "springs": _packed(model.springs, "<f8"),
        "basis": _packed(np.rint(basis / scales), "<i2"),
        "points": _packed(model.points[used], "<f4"),
        "faces": _packed(faces, "<u4"),
        "region": _packed(region[used], "<u4"),
    }
    shown = {"magnification": case.touch.magnification, "slowness": case.touch.slowness}
    return {"touch": {**packed, **shown, "dofs": model.dofs, "scales": scales.tolist()}}


def _dial(case: Case) -> dict:
    """Where the case lies between soft and stiff, and E [Pa] of its parts there."""
    if case.alpha is None:
        return {}
    E, parts = ([getattr(row, name) for row in case.parts] for name in ("E", "name"))
    return {"dial": {"alpha": case.alpha, "text": case.text, "parts": parts, "E": E}}


def _quantised(frames: np.ndarray) -> dict:
    """Displacements as 16-bit steps of ``step`` [m]: an error below 2e-5 of the largest."""
    step = float(np.abs(frames).max(initial=0)) / 32767 or 1.0
    return {
        "step": step,
        "frames": len(frames),
        "steps": _packed(np.rint(frames / step), "<i2"),
    }


def _packed(array: np.ndarray, dtype: str) -> str:
    return base64.b64encode(np.ascontiguousarray(array, dtype=dtype).tobytes()).decode()
