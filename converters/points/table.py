"""Points with named columns: point clouds and Gaussian splats, whatever file they come in."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ...fem.errors import InputError
from ..registry import Keeps

XYZ = ("x", "y", "z")


class Others(NamedTuple):
    """What a file holds beside columns and remarks, as the reader of its format knows it.

    ``title`` is the format's; ``names`` say what another format has no place for.
    """

    title: str
    names: tuple[str, ...]
    value: Any


@dataclass(frozen=True, eq=False)
class PointTable:
    """Points [m] with named columns, each (n,) or (n, k), in the order of their file.

    A point may be invalid (not finite), as in clouds of depth cameras.
    ``comments`` are remarks of the file, and ``others`` whatever else its writer needs to give the
    whole file back.
    """

    columns: Mapping[str, np.ndarray]
    comments: tuple[str, ...] = ()
    others: Others | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        missing = [name for name in XYZ if name not in self.columns]
        if missing:
            raise InputError(f"points need columns x, y, z, got {list(self.columns)}")
        lengths = {name: len(values) for name, values in self.columns.items()}
        if len(set(lengths.values())) != 1 or not len(self):
            raise InputError(f"columns must be of one length > 0, got {lengths}")

    def __len__(self) -> int:
        return len(self.columns["x"])

    @property
    def positions(self) -> Float[np.ndarray, "n 3"]:
        """Positions [m], shape (n, 3), float64."""
        return np.stack([np.asarray(self.columns[name], dtype=np.float64) for name in XYZ], axis=1)

    @property
    def is_splat(self) -> bool:
        """Whether the columns are those of 3D Gaussians."""
        return {"opacity", "scale_0", "rot_0"} <= self.columns.keys()

    def with_columns(self, extra: Mapping[str, np.ndarray], *, comment: str = "") -> PointTable:
        """Return the table with columns replaced in place or appended last."""
        comments = (*self.comments, comment) if comment else self.comments
        return replace(self, columns={**self.columns, **extra}, comments=comments)

    def items(self) -> Iterator[Keeps]:
        """What a file of the table has to keep; of its own format also what stands beside."""
        if len(self.columns) > len(XYZ):
            yield Keeps.COLUMNS
        if any(name.startswith("f_rest_") for name in self.columns):
            yield Keeps.HARMONICS
        if self.comments:
            yield Keeps.REMARKS
        if self.others is not None and self.others.names:
            yield Keeps.OTHERS
