"""What a mesh that a lattice was cut to promises, and how it proves it."""

from __future__ import annotations

from ...fem.scene.mesh import TetMesh
from .conversion_report import Guarantee, InputVolume
from .quality import Quality

# Degrees: dihedral angles of a lattice whose nodes were moved onto sharp edges.
SHARPEST, BLUNTEST = 9.0, 166.0
LATTICE_VOLUME = 0.05  # relative error of volume that a lattice may have: more is too coarse


def lattice_guarantees(
    mesh: TetMesh, measured: Quality, volume: InputVolume, parted: float
) -> tuple[Guarantee, ...]:
    """What a lattice promises: good tets, a closed boundary and the volume, but no distance.

    ``parted`` [m^3] is in pieces that have come off larger ones.
    """
    beyond = max(SHARPEST - measured.dihedral_min, measured.dihedral_max - BLUNTEST, 0.0)
    missed = max(abs(mesh.volume / volume.total - 1) - volume.uncertainty, 0.0)
    return (
        Guarantee("tets without volume", float((mesh.volumes <= 0).sum()), 0),
        Guarantee("boundary edges not on two faces", float(measured.boundary.bad_edges), 0),
        Guarantee("dihedral angle beyond 9 to 166 degrees", beyond, 0, "degrees"),
        Guarantee("relative error of volume", missed, LATTICE_VOLUME),
        Guarantee("share of volume in pieces that fell off", parted / mesh.volume, LATTICE_VOLUME),
    )
