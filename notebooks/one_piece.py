# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # A scan in one piece
#
# A scan, a point cloud or a generated mesh has no parts and no names. The sentence speaks of parts
# all the same: a network that sees shape and colour finds which cells each clause speaks of.
#
# ## The scan
# A bonsai whose surfaces are melted into one mesh; only their colours are left.

# %%
import autophyx_tet as apx
import numpy as np
import trimesh
from IPython.display import Image as NotebookImage
from scipy.spatial import KDTree

COLOURS = {
    "pot": (30, 80, 100),
    "soil": (60, 40, 35),
    "trunk": (110, 75, 50),
    "foliage": (70, 130, 60),
}
pieces = []
for name, surface in apx.bonsai().geometry.items():
    plain = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
    plain.visual.face_colors = (*COLOURS[name], 255)
    pieces.append(plain)
scan = trimesh.util.concatenate(pieces)
scan.export("scan.ply")
print(len(scan.faces), "triangles in one mesh")

# %% [markdown]
# ## One sentence
# Command line:
# ```
# autophyx-tet convert scan.ply -o scan.msh --up y --units m
# autophyx-tet assign scan.msh --asset scan.ply -o body.msh \
#     --text "ceramic pot, soil, oak trunk, soft leaves"
# ```

# %%
solid = apx.convert("scan.ply", options=apx.ConvertOptions(up="y", units="m"))
body = apx.assign(solid.mesh, "ceramic pot, soil, oak trunk, soft leaves", asset=solid.asset)
print("before:", *solid.mesh.region_names)
for row in body.part_rows():
    print(f"{row['name']:12}{row['material']:24}{row['volume'] * 1e6:6.0f} cm3  {row['why']}")

# %% [markdown]
# ## Was that meant?
# The generator knows what the network was not told: whose volume each tet lies in.

# %%
known = apx.convert(apx.write_bonsai("bonsai.glb")).mesh
_, nearest = KDTree(known.centroids).query(body.mesh.centroids)
truth = np.array(known.region_names)[known.region[nearest]]
meant = {"pot": "pot", "soil": "soil", "trunk": "trunk", "leaf": "foliage"}
found = np.array([meant.get(n.split()[-1], "") for n in body.mesh.region_names])[body.mesh.region]
right = np.average(found == truth, weights=body.mesh.volumes)
print(f"{right:.0%} of the volume is what it should be; of the true parts:")
for name in COLOURS:
    there = truth == name
    share = np.average(found[there] == name, weights=body.mesh.volumes[there])
    print(f"  {name:8}{share:.0%}")
assert right > 0.8  # where soil meets pot and where wood ends in leaves no surface shows
pot = next(row for row in body.part_rows() if row["name"].endswith("pot"))
assert np.isclose(pot["E"], apx.load_table().exact("ceramic").value().E)

# %%
panels = [
    apx.asset_panel(solid.asset, title="One piece"),
    apx.mesh_panel(body.mesh, title="Four parts"),
]
NotebookImage(filename=apx.render_png("one_piece.png", panels, up="y", pixels=320))
