"""Tet meshes that exist already: imported as they are, scaled, checked and reported."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...converters.mesh.meshdata import read_data
from ...fem.mesh import TetMesh, boundary_faces
from ...predictors.asset import Asset, Part, PlainMesh, UpAxis
from ..asset.load import Unit, scaled
from ..asset.repair import RepairReport
from .guarantees import ConversionReport, Distances, Region, separate, sound
from .quality import quality

SUFFIXES = (".msh", ".vtk", ".vtu", ".mesh")


class ImportedTets(NamedTuple):
    """A tet mesh [m] from a file, its outer surfaces as an asset, and what was measured."""

    asset: Asset
    mesh: TetMesh
    report: ConversionReport


def import_tets(
    path: str | Path,
    *,
    size: float | None = None,
    units: Unit | None = None,
    up: UpAxis | None = None,
) -> ImportedTets:
    """Take over a tet mesh: its regions become parts, only its boundary is made manifold.

    path: File of one of ``SUFFIXES``.
    size, units, up: As for ``load_asset``.
    Raises InputError: Where the file cannot be read, holds no tet, or a tet is flat.
    """
    path = Path(path)
    data = read_data(path)
    given = data.mesh
    # The closed surface of every region, in the units of the file
    parts = []
    for number, name in enumerate(given.region_names):
        faces = boundary_faces(given.tets[given.region == number]).faces
        if len(faces):
            used, index = np.unique(faces, return_inverse=True)
            surface = PlainMesh(given.points[used], index.reshape(-1, 3))
            parts.append(Part(name, surface, (name,)))
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    asset = scaled(
        Asset(
            path.stem, tuple(parts), source=str(path), source_hash=digest, warnings=data.warnings
        ),
        size=size,
        units=units,
        up=up,
    )
    apart = separate(given.points * asset.metres_per_unit, given.tets)
    mesh = TetMesh(
        apart.points, apart.tets, given.region[apart.origin], region_names=given.region_names
    )
    if given.material is not None and not apart.split_edges:
        mesh = mesh.with_material(given.material)
    # What can be measured without a surface to compare with
    measured, volumes = quality(mesh), mesh.region_volumes()
    tets = np.bincount(mesh.region, minlength=len(mesh.region_names))
    a, b = mesh.points[mesh.tets[:, 0]], mesh.points[mesh.tets[:, 1]]
    report = ConversionReport(
        repair=RepairReport(),
        attempts=(),
        guarantees=sound(mesh, measured),
        quality=measured,
        regions=tuple(
            Region(name, int(n), float(v), float(v))
            for name, n, v in zip(mesh.region_names, tets, volumes, strict=True)
        ),
        diagonal=float(np.linalg.norm(np.ptp(mesh.bounds, axis=0))),
        edge_length=float(np.median(np.linalg.norm(b - a, axis=1))),
        epsilon=0.0,
        input_volume=mesh.volume,
        distances=Distances(0.0, 0.0),
        split_edges=apart.split_edges,
        doubled_points=apart.doubled_points,
    )
    return ImportedTets(asset, mesh, report)
