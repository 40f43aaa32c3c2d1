"""The asset: named surface parts in metres, as they look, before any physics."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from ..fem.errors import InputError
from ..fem.scene.up import UpAxis, half_turn

if TYPE_CHECKING:
    import trimesh


def upright(points: Float[np.ndarray, "*n 3"], up: UpAxis) -> Float[np.ndarray, "*n 3"]:
    """Return points turned so that ``up`` becomes z."""
    x, y, z = np.moveaxis(np.asarray(points, dtype=np.float64) * half_turn(up), -1, 0)
    return np.stack({"z": (x, y, z), "y": (x, -z, y), "x": (-z, y, x)}[up[-1]], -1)


class PlainMesh:
    """Triangles without a look; what else a ``trimesh.Trimesh`` has is that of the one it makes.

    To load trimesh takes longer than to read and mend most files.

    vertices, faces: Points (n, 3) [m], and the triangles (m, 3) between them.
    """

    def __init__(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        self._plain = np.asarray(vertices, np.float64), np.asarray(faces, np.int64)

    @cached_property
    def whole(self) -> trimesh.Trimesh:
        """The same as a mesh of trimesh, which holds the truth from then on."""
        from trimesh import Trimesh

        return Trimesh(*self._plain, process=False, validate=False)

    @property
    def vertices(self) -> np.ndarray:
        """Points (n, 3) [m]."""
        return self.whole.vertices if "whole" in self.__dict__ else self._plain[0]

    @vertices.setter
    def vertices(self, vertices: np.ndarray) -> None:
        if "whole" in self.__dict__:
            self.whole.vertices = vertices
        else:
            self._plain = vertices, self._plain[1]

    @property
    def faces(self) -> np.ndarray:
        """Triangles (m, 3)."""
        return self.whole.faces if "whole" in self.__dict__ else self._plain[1]

    @property
    def bounds(self) -> Float[np.ndarray, "2 3"]:
        """Lower and upper corner [m] of the box around the triangles."""
        used = self.vertices[self.faces.reshape(-1)]
        return np.stack([used.min(axis=0), used.max(axis=0)])

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):  # of copies and pickles, which ask before there are any triangles
            raise AttributeError(name)
        return getattr(self.whole, name)


@dataclass(frozen=True, eq=False)
class Part:
    """One named part: a triangle surface [m] with its appearance (``mesh.visual``).

    ``labels`` are all the words the asset has for it: node, group and material names.
    """

    name: str
    mesh: trimesh.Trimesh | PlainMesh
    labels: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Asset:
    """A 3D asset in metres, on its own axes.

    Parameters
    ----------
    name, parts
        What it is called, and its named surfaces [m].
    up
        The axis that points up.
    metres_per_unit
        Metres [m] per unit of the file, already applied to the parts.
    source, source_hash
        The file, and the SHA-256 of it and of what it refers to.
    samples
        What a surface was made through in words ("5,000 points"); nothing of one that the file has.
    size_stated
        Whether the user gave its size or its unit.
    warnings
        Sentences for the user: a missing texture, a unit taken as metres ...

    Examples
    --------
    >>> import autophyx_tet as apx
    >>> asset = apx.load_asset(apx.write_bonsai("bonsai.glb"))
    >>> sorted(asset.part_names), bool(0.3 < asset.size.max() < 0.5)  # m
    (['foliage', 'pot', 'soil', 'trunk'], True)
    """

    name: str
    parts: tuple[Part, ...]
    up: UpAxis = "z"
    metres_per_unit: float = 1.0
    source: str | None = None
    source_hash: str | None = None
    samples: str = ""
    size_stated: bool = False
    warnings: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        if not self.parts:
            raise InputError("asset.asset_part", name=self.name)
        names = [part.name for part in self.parts]
        if len(set(names)) != len(names):
            raise InputError("asset.part_names", names=names)

    @property
    def sampled(self) -> bool:
        """Whether the surface was made through splats, points or a density grid."""
        return bool(self.samples)

    @property
    def part_names(self) -> tuple[str, ...]:
        """Names of the parts, in order."""
        return tuple(part.name for part in self.parts)

    @property
    def bounds(self) -> Float[np.ndarray, "2 3"]:
        """Lower and upper corner [m] of the box around all parts."""
        boxes = np.array([part.mesh.bounds for part in self.parts], dtype=np.float64)
        return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])

    @property
    def size(self) -> Float[np.ndarray, "3"]:
        """Extents [m] of the bounding box."""
        return self.bounds[1] - self.bounds[0]
