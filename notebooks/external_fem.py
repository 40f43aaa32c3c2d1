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
# # The same sag in CalculiX and here
#
# A bench of oak with a foam cushion is meshed, given its materials, and solved twice: by our
# solver, and by CalculiX (`ccx`), a program of other people with nothing of ours in it. Mesh,
# materials, supports and load go over in one file; the displacement of every point comes back.
#
# ## The bench
# glTF has y up and metres.

# %%
import subprocess
from pathlib import Path

import autophyx_tet as apx
import matplotlib.pyplot as plt
import numpy as np
import trimesh
from PIL import Image

parts = {
    "left leg": ((0.06, 0.40, 0.30), (-0.5, 0.20, 0)),
    "right leg": ((0.06, 0.40, 0.30), (0.5, 0.20, 0)),
    "plank": ((1.20, 0.05, 0.30), (0, 0.425, 0)),
    "cushion": ((0.90, 0.06, 0.28), (0, 0.48, 0)),
}  # name: extents [m], centre [m]
bench = trimesh.Scene()
for name, (extents, centre) in parts.items():
    block = trimesh.creation.box(
        extents, transform=trimesh.transformations.translation_matrix(centre)
    )
    bench.add_geometry(block, node_name=name, geom_name=name)
bench.export("bench.glb")

# %% [markdown]
# ## Mesh, materials, our answer
# CalculiX gets the quadratic tets that ours are too: the same discrete problem, not only the same
# body.

# %%
solid = apx.convert("bench.glb", options=apx.ConvertOptions(edge_length_rel=0.04))
text = "the legs and the plank are oak, the cushion is firm foam"
body = apx.assign(solid.mesh, text, asset=solid.asset)
up = solid.asset.up
ours = apx.simulate(body.mesh, up=up)
largest = ours.solved.max_displacement
print(f"{len(body.mesh.tets):,} tets, {body.mesh.mass:.1f} kg, sags by {largest * 1e6:.1f} µm")
Image.open(
    apx.render_png(
        "bench.png",
        apx.story(solid.asset, body.mesh, ours.displacement),
        up=up,
        pixels=240,
        samples=2,
    )
)

# %% [markdown]
# ## CalculiX
# Command line: `autophyx-tet export bench.msh --for calculix -o bench.inp`, then `ccx bench`.

# %%
apx.export(body.mesh, "calculix", output=Path("bench.inp"), options=apx.ExportOptions(up=up))
subprocess.run(["ccx", "bench"], check=True, capture_output=True, timeout=300)
rows = [line.split() for line in Path("bench.dat").read_text().splitlines()]
theirs = np.array([row[1:] for row in rows if len(row) == 4 and row[0].isdigit()], dtype=float)
difference = np.linalg.norm(theirs - ours.displacement, axis=1)
share = difference.max() / largest
print(f"{len(theirs):,} points; the largest difference is {share:.1e} of the largest displacement")
assert theirs.shape == body.mesh.points.shape
assert share < 1e-5

# %% [markdown]
# ## Point by point

# %%
figure, axis = plt.subplots(figsize=(4, 3.6), dpi=80)
axis.loglog(
    np.linalg.norm(theirs, axis=1) * 1e6, np.linalg.norm(ours.displacement, axis=1) * 1e6, "."
)
axis.set(xlabel="CalculiX [µm]", ylabel="autophyx-tet [µm]", title="Displacement of every point")
axis.axline((1, 1), (2, 2), color="k", linewidth=0.5)
figure.tight_layout()
