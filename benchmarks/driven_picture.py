"""The picture of splats that move with a mesh: a bonsai of jelly leans in its pot.

    python benchmarks/driven_picture.py docs/driven_splats.png

Splats lie on the surface of ``make demo``'s bonsai in its colours; `simulate --fix part:pot --load
part:foliage=F,0,0` bends its mesh, of one soft matter, and the splats follow: three shares of F.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
from real_meshes import cache_folder, demo_mesh

COUNT, SIZE = 40_000, 0.006  # splats, and their size as a share of the bonsai's
LIGHT = np.array([2.0, 2.0, 1.0]) / 3  # from where light comes
JELLY = {"E": 1.5e4, "nu": 0.3, "rho": 400.0}
SHOWN = (0.0, 0.5, 1.0)  # of the load
FORCE = 0.015  # [N]
PIXELS = 260
C0 = 0.28209479177387814  # of the harmonic of degree 0


def splats(asset, path: Path, *, total: int = COUNT, share: float = SIZE) -> Path:
    """About ``total`` small round splats all over the parts of an asset, in their colours, lit.

    ``share`` is their size of the asset's.
    """
    import trimesh
    from autophyx_tet.converters.points.gaussians import standard_columns
    from autophyx_tet.converters.points.table import PointTable, write_points
    from autophyx_tet.predictors.appearance.surface import skin_of

    area, points, colours = sum(part.mesh.area for part in asset.parts), [], []
    for part in asset.parts:
        count = round(total * part.mesh.area / area)
        x, faces = trimesh.sample.sample_surface(part.mesh, count, seed=0)[:2]
        weights = trimesh.triangles.points_to_barycentric(part.mesh.triangles[faces], x)
        colour = skin_of(part.mesh)(faces, weights.astype(np.float32))[:, :3]
        lit = 0.5 + 0.5 * (part.mesh.face_normals[faces] @ LIGHT)[:, None]
        colours.append(np.clip(colour * (0.6 + 0.5 * lit) + 0.12 * lit, 0, 1))
        points.append(x)
    x, colour = np.concatenate(points), np.concatenate(colours).astype(float)
    size = np.log(share * np.ptp(x, axis=0).max())
    turns = np.tile([1.0, 0, 0, 0], (len(x), 1))
    columns = standard_columns(
        x, np.full((len(x), 3), size), turns, np.full(len(x), 0.9), (colour - 0.5) / C0
    )
    write_points(path, PointTable(columns))
    return path


def main() -> None:
    """Bend the splats and put three frames side by side."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("picture", type=Path)
    parser.add_argument("--cache", type=Path, default=cache_folder(), help="folder of the mesh")
    options = parser.parse_args()
    from autophyx_tet.converters.mesh.meshdata import read_mesh
    from autophyx_tet.fem.material import ElementMaterial
    from autophyx_tet.toolkit.asset.bonsai import write_bonsai
    from autophyx_tet.toolkit.asset.load import load_asset
    from autophyx_tet.toolkit.simulation.simulate import simulate
    from PIL import Image

    mesh = read_mesh(demo_mesh(options.cache))
    mesh = mesh.with_material(ElementMaterial.uniform(len(mesh.tets), **JELLY))
    with tempfile.TemporaryDirectory() as folder:
        asset = load_asset(write_bonsai(Path(folder) / "bonsai.glb"))
        carrier = splats(asset, Path(folder) / "bonsai.ply")
        moved = simulate(
            mesh, drive=carrier, drive_scale=1.0, output=Path(folder) / "motion", up=asset.up,
            order=1, gravity=0.0, fix=["part:pot"], load={"part:foliage": (FORCE, 0, 0)},
        )  # fmt: skip
        film = Image.open(moved.driven.picture)
        sheet = Image.new("RGB", (PIXELS * len(SHOWN), PIXELS), "white")
        for i, share in enumerate(SHOWN):
            film.seek(round(share * (film.n_frames - 1)))
            frame = film.convert("RGB").resize((PIXELS, PIXELS))
            sheet.paste(frame, (i * PIXELS, 0))
    sheet.quantize(128).save(options.picture, optimize=True)


if __name__ == "__main__":
    main()
