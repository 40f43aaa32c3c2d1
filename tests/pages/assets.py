"""The files that the pages speak of, as small as they can be: what is theirs is their names."""

import sys
from pathlib import Path

import numpy as np
import trimesh
from autophyx_tet.converters import SH_C0, PointTable, standard_columns, write_mesh, write_points
from autophyx_tet.fem import ElementMaterial, TetMesh, box_mesh

PLANT = {  # name: extents [m], centre [m], colour; y is up
    "pot": ((0.16, 0.10, 0.16), (0, 0.05, 0), (30, 80, 100)),
    "soil": ((0.12, 0.02, 0.12), (0, 0.11, 0), (60, 40, 35)),
    "trunk": ((0.04, 0.12, 0.04), (0, 0.18, 0), (110, 75, 50)),
    "foliage": ((0.18, 0.10, 0.18), (0, 0.29, 0), (70, 130, 60)),
}
CHAIR = {
    **{
        f"{side} leg {end}": ((0.06, 0.45, 0.06), (x, 0.225, z), (120, 90, 60))
        for side, x in (("left", -0.2), ("right", 0.2))
        for end, z in (("front", 0.2), ("back", -0.2))
    },
    "seat": ((0.46, 0.08, 0.46), (0, 0.49, 0), (150, 40, 40)),
}


def pieces(parts):
    """Boxes of one asset by name, coloured."""
    found = {}
    for name, (extents, centre, colour) in parts.items():
        box = trimesh.creation.box(extents)
        box.apply_translation(centre)
        box.visual.face_colors = (*colour, 255)
        found[name] = box
    return found


def scene(parts):
    """The boxes as a scene of named nodes."""
    whole = trimesh.Scene()
    for name, box in pieces(parts).items():
        whole.add_geometry(box, node_name=name, geom_name=name)
    return whole


def splats(parts, count):
    """Flat splats on the surfaces of boxes, in metres."""
    tables = []
    for box, (_, _, colour) in zip(pieces(parts).values(), parts.values(), strict=True):
        places, faces = trimesh.sample.sample_surface(box, count, seed=0)
        normals = box.face_normals[faces]
        turn = np.column_stack([1 + normals[:, 2], -normals[:, 1], normals[:, 0], 0 * faces])
        turn[normals[:, 2] < -1 + 1e-9] = 0, 1, 0, 0
        wide = np.sqrt(box.area / count)
        tables.append(
            standard_columns(
                means=places,
                log_scales=np.log(np.tile([wide, wide, wide / 10], (count, 1))),
                rotations=turn / np.linalg.norm(turn, axis=1, keepdims=True),
                opacity=np.full(count, 0.95),
                f_dc=np.tile((np.array(colour) / 255 - 0.5) / SH_C0, (count, 1)),
            )
        )
    return PointTable({name: np.concatenate([t[name] for t in tables]) for name in tables[0]})


def solid(size, cells, parts=("body",), cut=0.0):
    """A box of wood; of two parts where it is ``cut`` [m] along z."""
    mesh = box_mesh(size, cells)
    region = (mesh.centroids[:, 2] > cut).astype(int) if cut else np.zeros(len(mesh.tets), int)
    mesh = TetMesh(mesh.points, mesh.tets, region, tuple(parts))
    return mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=1e9, nu=0.3, rho=700.0))


def write_all(folder):
    """Every file that a page names without making it."""
    for inner in ("out/demo", "chairs"):
        (folder / inner).mkdir(parents=True)
    for name in ("bonsai.glb", "out/demo/bonsai.glb"):
        scene(PLANT).export(folder / name)
    for name in ("chair.glb", "chairs/oak.glb"):
        scene(CHAIR).export(folder / name)
    trimesh.util.concatenate([*pieces(CHAIR).values()]).export(folder / "chairs/steel.obj")
    (folder / "assets.csv").write_text("asset,text,size\nchairs/steel.obj,steel,0.85\n")
    trimesh.util.concatenate([*pieces(PLANT).values()]).export(folder / "scan.ply")
    trimesh.creation.icosphere(subdivisions=2).export(folder / "statue.stl")
    finger = trimesh.creation.box((20, 16, 100))  # millimetres
    finger.apply_translation((0, 0, 50))
    finger.export(folder / "finger.stl")
    write_points(folder / "splats.ply", splats(PLANT, 300))
    write_points(folder / "plant.ply", splats(PLANT, 2000))
    write_mesh(folder / "hammer.msh", solid((0.03, 0.03, 0.2), (1, 1, 5), ("handle", "head"), 0.15))
    write_mesh(folder / "cube.msh", solid((0.1, 0.1, 0.1), (2, 2, 2)))
    write_mesh(folder / "body.msh", solid((0.1, 0.1, 0.1), (2, 2, 2)))


if __name__ == "__main__":
    write_all(Path(sys.argv[1]))
