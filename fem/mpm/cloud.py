"""Particles on the device: sorted by class and place, copied, looked over and read back."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ..device import start_warp
from ..scene.material import lame_parameters
from .background import BackgroundGrid
from .classes import FLOWING, Form, MaterialClass
from .kernels.kernels_survey import COUNT, survey_kernel
from .kernels.kernels_transfer import types_of
from .particles import Particles

# Arrays that change with time: what a chunk starts from.
CHANGING = ("x", "v", "C", "H", "total", "q")


class ClassSpan(NamedTuple):
    """Particles ``first`` to ``first + count`` in the device's order: of one class.

    ``form`` is that of jelly, ``carries`` whether their total deformation is followed beside the
    elastic one.
    """

    kind: MaterialClass
    form: Form
    first: int
    count: int

    @property
    def rigid(self) -> bool:
        """Whether these are rigid bodies."""
        return self.kind == MaterialClass.STATIONARY

    @property
    def carries(self) -> bool:
        """Whether the elastic deformation is not the whole."""
        plastic = self.kind in (MaterialClass.METAL, MaterialClass.VISPLAS, MaterialClass.SNOW)
        return plastic and self.kind not in FLOWING


class Cloud:
    """Moving particles on a device, in the order of their class and then of the grid.

    Parameters
    ----------
    particles
        What moves: no stationary ones.
    lattice
        The grid.
    device
        'cpu' (float64) or 'cuda' (float32).
    """

    def __init__(self, particles: Particles, lattice: BackgroundGrid, device: str) -> None:
        wp = start_warp()
        self.particles, self.lattice, self.device = particles, lattice, device
        self.real = wp.float64 if device == "cpu" else wp.float32
        self.types = types_of(self.real)
        self.order: Int[np.ndarray, "n"] = self._sorted(particles.x)
        self.spans = self._spans()
        self.struct = self._upload()
        self.strongest_push = 0.0  # m/s^2
        self.frame = self._frame()
        self.listed = wp.clone(self.struct.x)
        self._found = wp.zeros(COUNT, dtype=self.real, device=device)
        self._kept: dict[str, Any] = {}

    def __len__(self) -> int:
        return len(self.order)

    def _keys(self) -> np.ndarray:
        forms = np.array([int(s.form) for s in self.particles.substances])
        forms = np.where(self.particles.rigid < 0, forms[self.particles.substance], Form.PLAIN)
        return len(Form) * self.particles.kinds + forms

    def _sorted(self, x: np.ndarray) -> np.ndarray:
        """Order by class, and by the first node within it."""
        nodes = np.clip(self.lattice.first_nodes(x), 0, np.array(self.lattice.shape) - 3)
        key = self._keys() * self.lattice.count + self.lattice.flat(nodes)
        return np.argsort(key, kind="stable")

    def _spans(self) -> tuple[ClassSpan, ...]:
        keys, first, count = np.unique(
            self._keys()[self.order], return_index=True, return_counts=True
        )
        return tuple(
            ClassSpan(MaterialClass(int(kind)), Form(int(form)), int(a), int(n))
            for kind, form, a, n in zip(*np.divmod(keys, len(Form)), first, count, strict=True)
        )

    def _upload(self) -> Any:
        wp, types, given, order = start_warp(), self.types, self.particles, self.order
        lam, mu = lame_parameters(given.E, given.nu)
        states = np.array([s.state for s in given.substances])[given.substance]
        struct = types.Cloud()

        def put(values: np.ndarray, dtype: Any) -> Any:
            return wp.array(np.ascontiguousarray(values[order]), dtype=dtype, device=self.device)

        struct.x, struct.rest = put(given.x, types.vec3), put(given.x, types.vec3)
        struct.v, struct.k = (
            put(given.velocity, types.vec3),
            put(given.numbers(self.lattice.spacing), types.vec3),
        )
        scalars = {"m": given.mass, "volume": given.volume, "mu": mu, "lam": lam, "q": states}
        for name, values in scalars.items():
            setattr(struct, name, put(values, self.real))
        struct.body = wp.array(given.rigid[order].astype(np.int32), dtype=int, device=self.device)
        struct.push = wp.zeros(0, dtype=types.vec3, device=self.device)
        for name in ("C", "H", "total"):
            setattr(struct, name, wp.zeros(len(self), dtype=types.mat33, device=self.device))
        return struct

    def _frame(self) -> Any:
        frame = self.types.Frame()
        frame.origin = self.types.vec3(*map(float, self.lattice.origin))
        frame.spacing = self.lattice.spacing
        frame.nx, frame.ny, frame.nz = self.lattice.shape
        return frame

    def sort(self) -> None:
        """Put the particles into the order of the grid again, every array in its place."""
        again = self._sorted(self.read("x"))
        inner = np.empty(len(again), dtype=np.int64)
        inner[self.order] = np.arange(len(again))
        moved = inner[again]
        for name in (*CHANGING, "rest", "m", "volume", "mu", "lam", "k", "body"):
            array = getattr(self.struct, name)
            array.assign(array.numpy()[moved])
        if len(self.struct.push):
            self.struct.push.assign(self.struct.push.numpy()[moved])
        self.order = again
        self.mark()

    def mark(self) -> None:
        """Keep the places that nodes are listed for."""
        start_warp().copy(self.listed, self.struct.x)

    def read(self, name: str) -> np.ndarray:
        """Array ``name`` in the order of the particles, float64."""
        found = getattr(self.struct, name).numpy()
        out = np.empty(found.shape, dtype=np.float64)
        out[self.order] = found
        return out

    def write(self, name: str, values: np.ndarray) -> None:
        """Set the array ``name``, given in the order of the particles."""
        getattr(self.struct, name).assign(np.ascontiguousarray(values[self.order]))

    def set_push(self, values: Float[np.ndarray, "n 3"]) -> None:
        """Accelerations [m/s^2] of the particles by outer forces, from now on."""
        given, vec3 = np.ascontiguousarray(values[self.order]), self.types.vec3
        self.struct.push = start_warp().array(given, dtype=vec3, device=self.device)
        self.strongest_push = float(np.linalg.norm(self.struct.push.numpy(), axis=1).max(initial=0))

    def keep(self) -> None:
        """Remember the state."""
        wp = start_warp()
        for name in CHANGING:
            array = getattr(self.struct, name)
            if name not in self._kept:
                self._kept[name] = wp.empty_like(array)
            wp.copy(self._kept[name], array)

    def restore(self) -> None:
        """Go back to what was remembered."""
        for name, array in self._kept.items():
            start_warp().copy(getattr(self.struct, name), array)

    def survey(self) -> Float[np.ndarray, "entries"]:
        """Look over the particles: see the entries of ``kernels.kernels_survey``."""
        wp = start_warp()
        self._found.zero_()
        for span in self.spans:
            given = [span.first, self.struct, self.frame, self.listed, self._found]
            kernel = survey_kernel(span.kind, self.real, span.form)
            wp.launch(kernel, span.count, given, device=self.device)
        return self._found.numpy().astype(np.float64)
