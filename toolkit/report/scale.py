"""Colour scales: values to colours, and the round numbers that stand beside them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ...fem.errors import InputError

# Perceptually ordered maps (viridis, cividis, plasma, inferno, mako), cut where they are nearly
# black; the report draws with the same.
PALETTES: dict[str, tuple[str, ...]] = {
    "E": ("#472d7b", "#3e4989", "#31688e", "#26828e", "#1f9e89", "#35b779", "#6ece58", "#b5de2b",
          "#fde725"),
    "nu": ("#123570", "#3b496c", "#575d6d", "#707173", "#8a8678", "#a59c74", "#c3b369", "#e1cc55",
           "#fee838"),
    "rho": ("#35264c", "#403a75", "#3d5296", "#366da0", "#3487a6", "#35a1ab", "#43bbad", "#6cd3ad",
            "#ade3c0", "#def5e5"),
    "displacement": ("#46039f", "#7201a8", "#9c179e", "#bd3786", "#d8576b", "#ed7953", "#fb9f3a",
                     "#fdca26", "#f0f921"),
    "von_mises": ("#420a68", "#6a176e", "#932667", "#bc3754", "#dd513a", "#f37819", "#fca50a",
                  "#f6d746", "#fcffa4"),
}  # fmt: skip
# Colours of parts: muted, told apart by hue, repeated after the last.
PARTS = (
    "#5b8db8", "#d19a55", "#6fa86a", "#b7656c", "#8d7fb5", "#5fb0ac", "#c2a847", "#a0785f",
    "#8a9099", "#d08fb4",
)  # fmt: skip
SINGLE = 1e-6  # relative span below which all values count as one


def rgb(words: str) -> Float[np.ndarray, "3"]:
    """Colour in [0, 1] of ``#rrggbb``."""
    return np.array([int(words[i : i + 2], 16) for i in (1, 3, 5)]) / 255


@dataclass(frozen=True)
class Scale:
    """Values from ``lo`` to ``hi`` on a palette, with a label and a unit; ``log`` by decades."""

    label: str
    unit: str
    palette: str
    lo: float
    hi: float
    log: bool = False

    def __post_init__(self) -> None:
        if self.palette not in PALETTES:
            raise InputError(f"unknown palette {self.palette!r}, wanted {', '.join(PALETTES)}")
        if not self.lo <= self.hi or (self.log and not self.lo > 0):
            raise InputError(f"scale from {self.lo} to {self.hi}: wanted lo <= hi, above 0 if log")

    @classmethod
    def around(cls, values, *, label: str, unit: str, palette: str, log: bool = False) -> Scale:
        """Return the scale that spans all ``values``."""
        return cls(label, unit, palette, float(np.min(values)), float(np.max(values)), log)

    @property
    def single(self) -> bool:
        """Whether the scale holds one value only."""
        return self.hi - self.lo <= SINGLE * max(abs(self.lo), abs(self.hi))

    def share(self, values: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """Place of values on the scale, in [0, 1]; one half where it holds one value only."""
        if self.single:
            return np.full(np.shape(values), 0.5)
        inside = np.clip(values, self.lo, self.hi)
        if self.log:
            return np.log(inside / self.lo) / np.log(self.hi / self.lo)
        return (inside - self.lo) / (self.hi - self.lo)

    def colors(self, values: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n 3"]:
        """Colour (sRGB, [0, 1]) of values."""
        stops = np.array([rgb(stop) for stop in PALETTES[self.palette]])
        at = self.share(values)
        places = np.linspace(0, 1, len(stops))
        return np.stack([np.interp(at, places, stops[:, i]) for i in range(3)], axis=-1)
