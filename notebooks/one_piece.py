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
# all the same: the thing is cut into regions of like look, and a network says which clause speaks
# of which region.
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
#     --text "ceramic pot, oak trunk, soft leaves"
# ```

# %%
solid = apx.convert("scan.ply", options=apx.ConvertOptions(up="y", units="m"))
SENTENCE = "ceramic pot, oak trunk, soft leaves"
body = apx.assign(solid.mesh, SENTENCE, asset=solid.asset)
print("before:", *solid.mesh.region_names)
for row in body.part_rows():
    print(f"{row['name']:12}{row['material']:24}{row['volume'] * 1e6:6.0f} cm3  {row['why']}")
print(*body.warnings, sep="\n")

# %% [markdown]
# ## Its regions, by number
# The report shows the same picture, `assign --json` the same rows.

# %%
rows = body.region_rows()
for row in rows[:6]:
    print(row["number"], row["colour"], f"{row['fraction']:.0%} of the volume:", row["part"])
NotebookImage(data=apx.region_png(body.regions.number, body.field.grid, up="y"))

# %% [markdown]
# ## Was that meant?
# The generator knows what the network was not told: whose volume each tet lies in. Of the soil only
# the surface is seen; what fills the pot below it takes after the pot.

# %%
known = apx.convert(apx.write_bonsai("bonsai.glb")).mesh
_, nearest = KDTree(known.centroids).query(body.mesh.centroids)
truth = np.array(known.region_names)[known.region[nearest]]
names = np.array(body.mesh.region_names)[body.mesh.region]
for said, meant in {"pot": "pot", "trunk": "trunk", "leaf": "foliage"}.items():
    there = truth == meant
    share = np.average(
        [name.endswith(said) for name in names[there]], weights=body.mesh.volumes[there]
    )
    print(f"{meant:8}{share:.0%} of it found")
    assert share > 0.8  # where wood ends in leaves no surface shows

# %% [markdown]
# ## Corrected by hand
# Nobody spoke of the soil. A point on it is enough, or its number:
# ```
# autophyx-tet assign scan.msh --asset scan.ply -o body.msh --at "0,0.09,0=soil" \
#     --text "ceramic pot, oak trunk, soft leaves"
# ```

# %%
mended = apx.assign(solid.mesh, SENTENCE, asset=solid.asset, at=("0.08,0.078,0.04=soil",))
for row in mended.part_rows():
    print(f"{row['name']:12}{row['material']:24}{row['volume'] * 1e6:6.0f} cm3  {row['why']}")
soil = next(row for row in mended.part_rows() if row["name"].startswith("region"))
assert np.isclose(soil["E"], apx.load_table().exact("soil").value().E)

# %% [markdown]
# ## Two motions
# The same scan with a trunk of oak, and with the region of the trunk of polyethylene: both under
# their own weight.

# %%
trunk = next(row["number"] for row in rows if row["part"].endswith("trunk"))
other = apx.assign(solid.mesh, SENTENCE, asset=solid.asset, region=(f"{trunk}=polyethylene",))
still = {"oak": apx.simulate(body.mesh, up="y"), "polyethylene": apx.simulate(other.mesh, up="y")}
for name, rest in still.items():
    print(f"{name:13}{rest.numbers['max_displacement'] * 1e3:.3g} mm")
panels = [
    apx.mesh_panel(
        rest.mesh, title=name, displacement=rest.displacement,
        factor=apx.exaggeration(rest.mesh, rest.displacement),
    )
    for name, rest in still.items()
]  # fmt: skip
NotebookImage(filename=apx.render_png("motions.png", panels, up="y", pixels=140))

# %%
pictures = [
    apx.asset_panel(solid.asset, title="One piece"),
    apx.mesh_panel(body.mesh, title="Three parts"),
]
NotebookImage(filename=apx.render_png("one_piece.png", pictures, up="y", pixels=140))
