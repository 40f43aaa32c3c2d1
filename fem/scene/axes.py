"""The names of the axes that may point up, for whoever loads nothing else."""

from __future__ import annotations

from typing import Literal

UpAxis = Literal["x", "y", "z", "-x", "-y", "-z"]
