"""Units of length that a file may be in, for files that do not say so themselves."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

Unit = Literal["mm", "cm", "m", "in"]
METRES: Mapping[Unit, float] = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}
