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
# # One chair, two sentences, two motions
#
# The same chair is said to have an oak seat, then a foam one. The mesh is made once, the load (its
# own weight) is the same, and only the words differ.
#
# ## The chair
# Six named boxes; glTF has y up and metres. Any GLB with named parts does as well.

# %%
from pathlib import Path

import autophyx_tet as apx
import numpy as np
import trimesh
from IPython.display import Image as NotebookImage
from PIL import Image

parts = {
    "front left leg": ((0.05, 0.45, 0.05), (-0.2, 0.225, 0.2)),
    "front right leg": ((0.05, 0.45, 0.05), (0.2, 0.225, 0.2)),
    "rear left leg": ((0.05, 0.90, 0.05), (-0.2, 0.45, -0.2)),
    "rear right leg": ((0.05, 0.90, 0.05), (0.2, 0.45, -0.2)),
    "seat": ((0.45, 0.06, 0.45), (0, 0.48, 0)),
    "back": ((0.35, 0.25, 0.03), (0, 0.75, -0.2)),
}  # name: extents [m], centre [m]
chair = trimesh.Scene()
for name, (extents, centre) in parts.items():
    place = trimesh.transformations.translation_matrix(centre)
    chair.add_geometry(
        trimesh.creation.box(extents, transform=place), node_name=name, geom_name=name
    )
chair.export("chair.glb")
# %% [markdown]
# ## Two sentences
# Command line:
# ```
# autophyx-tet run chair.glb -o out --edge-length-rel 0.04 \
#     --text "the legs and the back are oak, the seat is oak" \
#     --text "the legs and the back are oak, the seat is firm foam"
# ```

# %%
texts = (
    "the legs and the back are oak, the seat is oak",
    "the legs and the back are oak, the seat is firm foam",
)
options = apx.ConvertOptions(edge_length_rel=0.04)
result = apx.run("chair.glb", texts, output=Path("out"), convert_options=options)
print(*sorted(path.name for path in Path("out").iterdir()))
hard, soft = result.cases
for case in result.cases:
    print(f"\n{case.assignment.text}: {case.assignment.mesh.mass:.2f} kg")
    for verdict in case.simulation.verdicts():
        print(" ", verdict.sentence)

# %% [markdown]
# ## What the words changed

# %%
values = [{row["name"]: row["E"] for row in case.assignment.part_rows()} for case in result.cases]
oak, foam = (apx.load_table().exact(name).value() for name in ("oak", "firm foam"))
moved = [case.simulation.solved.max_displacement for case in result.cases]
print(f"the seat: {values[0]['seat']:.3g} and {values[1]['seat']:.3g} Pa")
print(f"moved by {moved[0] * 1e6:.2g} µm and {moved[1] * 1e3:.2g} mm")
assert values[1]["seat"] < values[0]["seat"] / 1e4
assert np.isclose(values[1]["front left leg"], values[0]["front left leg"])
assert np.isclose(values[1]["seat"], foam.E, rtol=1e-6)
assert moved[1] > 100 * moved[0]

# %% [markdown]
# ## Two motions
# Both come on under the same weight and are drawn larger by the same factor: oak does not move for
# the eye. `out/report.html` plays them too, with a slider for the factor; it opens in any browser,
# without a network.

# %%
frames = 10
there = np.linspace(0, 1, frames // 2 + 1)
load = np.concatenate([there, there[-2:0:-1]])  # it comes and goes
factor = apx.exaggeration(soft.assignment.mesh, soft.simulation.displacement)
scale = apx.Scale("moved by", "m", "displacement", 0.0, float(moved[1]))
panels = []
for case, words in ((hard, "Oak seat"), (soft, "Foam seat")):
    film = load[:, None, None] * case.simulation.displacement
    panels.append(
        apx.mesh_panel(
            case.assignment.mesh,
            np.linalg.norm(film, axis=2),
            on="points",
            scale=scale,
            title=f"{words}, × {factor:g}",
            displacement=film,
            factor=factor,
        )
    )
path = apx.render_animation(
    "motions.gif", panels, up=result.conversion.asset.up, pixels=144, samples=2
)
with Image.open(path) as picture:
    assert picture.n_frames == frames
NotebookImage(filename=path)
