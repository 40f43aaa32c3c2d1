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
# # A point cloud: to a simulation and back
#
# A scan is points on a surface, with gaps. Here the scan of a cork float, an ellipsoid of
# 24 x 16 x 12 cm, becomes a tet mesh with materials, stands under gravity, and every point of the
# scan gets `E` [Pa], `nu` and `rho` [kg/m³].
#
# ## The scan
# 6,000 points in millimetres, an intensity for each, and 60 points that the scanner missed.

# %%
from pathlib import Path

import autophyx_tet as apx
import numpy as np
from autophyx_tet.converters import (
    PointTable,
    field_from_points,
    read_points,
    sample_material,
    write_points,
)
from PIL import Image

count = 6_000
semi_axes = np.array([0.12, 0.08, 0.06])  # m
z = 1 - (2 * np.arange(count) + 1) / count
turn = np.arange(count) * np.pi * (3 - 5**0.5)  # the golden angle spreads them evenly
sphere = np.stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z], axis=1)
scan = sphere * semi_axes * 1e3  # mm
scan[::100] = np.nan
columns = {**dict(zip("xyz", scan.T, strict=True)), "intensity": np.arange(count, dtype=np.float32)}
write_points("float.pcd", PointTable(columns))

# %% [markdown]
# ## Points to tets
# A surface is reconstructed through the points. Command line:
# ```
# autophyx-tet convert float.pcd --units mm --up z --edge-length-rel 0.1 \
#     --epsilon-rel 3e-3 -o float.msh
# ```

# %%
options = apx.ConvertOptions(units="mm", up="z", edge_length_rel=0.1, epsilon_rel=3e-3)
solid = apx.convert("float.pcd", output=Path("float.msh"), options=options)
volume = 4 / 3 * np.pi * semi_axes.prod()
print(
    f"{len(solid.mesh.tets):,} tets, {solid.mesh.volume * 1e3:.3f} l; wanted {volume * 1e3:.3f} l"
)
assert abs(solid.mesh.volume / volume - 1) < 0.03

# %% [markdown]
# ## A sentence to a material, and its own weight

# %%
body = apx.assign("float.msh", "it is made of cork", output=Path("cork.msh"))
cork = apx.load_table().exact("cork").value()
sag = apx.simulate("cork.msh")
print(f"{body.mesh.mass * 1e3:.0f} g;", *(verdict.sentence for verdict in sag.verdicts()))
assert np.allclose(body.mesh.material.E, cork.E, rtol=1e-6)
assert abs(body.mesh.mass / (cork.rho * volume) - 1) < 0.03
assert sag.solved.sag_ratio < 0.01
Image.open(
    apx.render_png(
        "float.png",
        apx.story(solid.asset, body.mesh, sag.solved.displacement),
        pixels=240,
        samples=2,
    )
)

# %% [markdown]
# ## Back onto the points
# The intensity stays bit for bit, missed points stay in their place without a value. Command line:
# `autophyx-tet transfer cork.msh float.pcd -o float_physics.pcd`

# %%
carried = apx.transfer("cork.msh", "float.pcd", output=Path("float_physics.pcd"))
points = read_points("float_physics.pcd").columns
seen = np.isfinite(points["x"])
print(*carried.warnings)
assert np.array_equal(points["intensity"], columns["intensity"])
assert carried.done.n_invalid == 60 == (~seen).sum()
assert np.allclose(points["E"][seen], cork.E, rtol=1e-6)
assert np.isnan(points["E"][~seen]).all()

# %% [markdown]
# ## A labelled cloud as the source
# Points that have `E nu rho` already, ours or another predictor's, give a field of their own.
# Here the front half of the float is turned into rubber, point by point, and meshed bodies
# take it from there.

# %%
rubber = apx.load_table().exact("soft rubber").value()
front = seen & (points["x"] > 0)
labelled = {name: points[name][seen].astype(float) for name in "xyz"}
labelled = {name: values * 1e-3 for name, values in labelled.items()}  # to metres
for name in ("E", "nu", "rho"):
    labelled[name] = np.where(front, getattr(rubber, name), getattr(cork, name))[seen]
two = sample_material(solid.mesh, field_from_points(PointTable(labelled), cells=48)).mesh
print(f"{two.mass * 1e3:.0f} g with the front half in rubber")
assert abs(two.mass / (volume * (cork.rho + rubber.rho) / 2) - 1) < 0.05
