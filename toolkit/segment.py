"""The verb `segment`: a thing in one piece as named parts, by what looks and shells tell apart."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ..fem.mesh import TetMesh
from ..predictors.appearance.features import Appearance, cell_appearance, fill
from ..predictors.appearance.surface import skin_of, surface_voxels
from ..predictors.asset import Asset, Part, PlainMesh, UpAxis, upright
from ..predictors.grid import Grid, PartVoxels
from ..predictors.matter import LOOK
from ..predictors.regions.division import Regions, apart, cut, region_name, region_numbers
from .asset import Unit, path_of
from .asset.document import check_file

CELLS = 64  # along the longest side
FINEST = 2.0  # cells: the longest edge of a triangle, so that each lies in one region


@dataclass(frozen=True, eq=False)
class Segmented:
    """Regions of an asset as ``parts``, the largest first, and the file they were written to."""

    parts: Asset
    fractions: tuple[float, ...]
    files: tuple[Path, ...] = ()

    def document(self) -> dict[str, Any]:
        """Return what ``segment --json`` prints."""
        rows = [
            {"name": part.name, "fraction": fraction, "triangles": len(part.mesh.faces)}
            for part, fraction in zip(self.parts.parts, self.fractions, strict=True)
        ]
        return {"files": self.files, "parts": rows, "warnings": self.parts.warnings}


class Cut(NamedTuple):
    """The cells of an asset, cut into regions that no border of its parts crosses.

    centres: Of the cells (n, 3) [m].
    part: The part that each is of, by number.
    regions: What they are cut into.
    """

    centres: np.ndarray
    part: np.ndarray
    regions: Regions

    def nearest(self, points: Float[np.ndarray, "m 3"], part: int) -> Int[np.ndarray, "m"]:
        """Of points [m] of a part the cells that are nearest, of the part where it has some."""
        from scipy.spatial import KDTree

        mine = np.flatnonzero(self.part == part)
        mine = mine if len(mine) else np.arange(len(self.part))
        return mine[KDTree(self.centres[mine]).query(points)[1]]


def cut_asset(asset: Asset) -> Cut:
    """Cut what the surfaces of an asset enclose; its regions are numbered so for every verb.

    Parts that are regions already, as ``segment`` writes them, keep their numbers.
    """
    from scipy.ndimage import distance_transform_edt

    grid = Grid.around(asset.bounds, cells=CELLS)
    voxels = surface_voxels(asset, grid)
    inside = fill(voxels.occupied)
    cells, looks = np.argwhere(inside), np.zeros((*grid.shape, LOOK))
    shell = np.full(grid.shape, -1)
    centres = grid.to_world(cells)
    looks[inside], shell[inside] = cell_appearance(asset, centres)
    seen = Appearance(looks[..., :3], finish=looks[..., 3:], shell=shell)
    near = distance_transform_edt(~voxels.occupied, return_distances=False, return_indices=True)
    part = voxels.part[tuple(np.asarray(near))][inside]
    if numbers := region_numbers([part.name for part in asset.parts]):
        number = np.array(numbers)[part] - 1
        return Cut(centres, part, cut(cells, seen, asset.up, region=number))
    return Cut(centres, part, apart(cut(cells, seen, asset.up), part))


def cut_voxels(asset: Asset, voxels: PartVoxels, *, up: UpAxis) -> Regions:
    """Return the regions of an asset on the cells of its parts, which lie where it does."""
    found = cut_asset(asset)
    cells, names = np.argwhere(voxels.occupied), [part.name for part in asset.parts]
    of_cell, near = voxels.part[voxels.occupied], np.zeros(len(cells), dtype=int)
    for i in np.unique(of_cell):
        name = voxels.part_names[i]
        number = names.index(name) if name in names else -1
        near[of_cell == i] = found.nearest(voxels.grid.to_world(cells[of_cell == i]), number)
    turned = np.rint(upright(cells.astype(float), up)).astype(int)
    there = found.regions
    return Regions(
        turned - turned.min(axis=0), there.looks[near], there.plain[:, near],
        there.region[near], there.shells,
    )  # fmt: skip


def in_one(asset: Asset) -> Asset:
    """Regions of one thing as that thing again: where it was cut there is no surface."""
    if region_numbers(asset.part_names) is None:
        return asset
    before = np.cumsum([0, *(len(part.mesh.vertices) for part in asset.parts)])
    faces = [part.mesh.faces + n for part, n in zip(asset.parts, before, strict=False)]
    points = np.concatenate([part.mesh.vertices for part in asset.parts])
    return replace(asset, parts=(Part(asset.name, PlainMesh(points, np.concatenate(faces))),))


def divided_again(mesh: TetMesh, asset: Asset) -> TetMesh:
    """The mesh of the thing ``in_one`` divided by its regions, as ``assign`` divides it."""
    from ..converters.transfer import divided_by_voxels, voxelize

    voxels, names = voxelize(mesh, cells=CELLS), mesh.region_names
    mine = voxels.part[voxels.occupied] == names.index(asset.name)
    number = cut_voxels(asset, voxels, up=asset.up).region + 1
    found = np.unique(number[mine])
    own = [region_name(n) for n in found.tolist()]
    others = [name for name in names if name != asset.name]
    part = voxels.part.copy()
    part[voxels.occupied] = np.where(
        mine, np.searchsorted(found, number), len(own) + voxels.part[voxels.occupied] - 1
    )
    parts = PartVoxels(voxels.grid, part, (*own, *others))
    parents = [*[names.index(asset.name)] * len(own), *map(names.index, others)]
    return divided_by_voxels(mesh, parts, parents)


def segment(
    asset: str | Path | Asset,
    *,
    output: str | Path | None = None,
    size: float | None = None,
    units: Unit | None = None,
    up: UpAxis | None = None,
) -> Segmented:
    """Cut an asset into regions of like look and shell, each a part with a name.

    Parameters
    ----------
    asset
        File to load, or an asset already loaded.
    output
        The .glb to write; ``run`` takes it, and a text may speak of "region 3".
    size, units, up
        Of a file, as ``load_asset`` takes them; the size in [m].

    Returns
    -------
    Segmented
        ``parts``: an asset with y up, coloured at its corners, in metres [m].

    Raises
    ------
    InputError
        Where the asset cannot be read or the output not be written.

    Examples
    --------
    >>> import autophyx_tet as apx
    >>> made = apx.segment(apx.write_bonsai("bonsai.glb"), output="parts.glb")
    >>> len(made.parts.parts) > 3, made.parts.parts[0].name
    (True, 'region 1')
    """
    import trimesh
    from trimesh.exchange.gltf import export_glb
    from trimesh.remesh import subdivide_to_size
    from trimesh.triangles import points_to_barycentric

    from .asset.load import load_asset

    output = path_of(output)
    if output is not None:
        check_file(output, (".glb",))
    if not isinstance(asset, Asset):
        asset = load_asset(asset, size=size, units=units, up=up)
    found = cut_asset(asset)
    region, finest = found.regions.region, FINEST * float(asset.size.max()) / CELLS
    corners, colours, of = [], [], []
    for number, part in enumerate(asset.parts):
        mesh = part.mesh
        points, faces, source = subdivide_to_size(
            mesh.vertices, mesh.faces, finest, max_iter=20, return_index=True
        )
        triangles = points[faces]
        of.append(region[found.nearest(triangles.mean(axis=1), number)])
        whole = np.repeat(mesh.triangles[source], 3, axis=0)
        weights = points_to_barycentric(whole, triangles.reshape(-1, 3)).clip(0, 1)
        weights = np.nan_to_num(weights, nan=1 / 3)  # of a triangle without an area
        shown = skin_of(mesh)(np.repeat(source, 3), weights / weights.sum(axis=1, keepdims=True))
        corners.append(triangles)
        colours.append(shown.reshape(-1, 3, 4))
    corner, colour, own = map(np.concatenate, (corners, colours, of))
    x, y, z = np.moveaxis(upright(corner, asset.up), -1, 0)
    corner = np.stack([x, z, -y], axis=-1)  # y up, as glTF has it
    scene, parts, fractions = trimesh.Scene(), [], []
    for k in np.unique(own).tolist():
        mine = own == k
        bytes_of = (255 * colour[mine].reshape(-1, 4) + 0.5).astype(np.uint8)
        mesh = trimesh.Trimesh(
            corner[mine].reshape(-1, 3), np.arange(3 * mine.sum()).reshape(-1, 3),
            vertex_colors=bytes_of, process=False,
        )  # fmt: skip
        mesh.merge_vertices()
        name = region_name(k + 1)
        scene.add_geometry(mesh, node_name=name, geom_name=name)
        parts.append(Part(name, mesh, (name,)))
        fractions.append(float((region == k).mean()))
    made = Asset(
        asset.name, tuple(parts), up="y", source=asset.source, source_hash=asset.source_hash,
        samples=asset.samples, size_stated=True, warnings=asset.warnings,
    )  # fmt: skip
    if output is None:
        return Segmented(made, tuple(fractions))
    output.write_bytes(export_glb(scene))
    return Segmented(made, tuple(fractions), (output,))
