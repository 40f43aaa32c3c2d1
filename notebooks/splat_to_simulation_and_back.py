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
# # Gaussian splats: to a simulation and back
#
# A splat scene is a cloud of small coloured discs: it has no inside, no unit and no material.
# Here a ball of splats becomes a watertight tet mesh, a sentence gives it foam, gravity loads
# it, and every splat gets its Young's modulus `E` [Pa], Poisson's ratio `nu` and density `rho`
# [kg/m³] back.
#
# ## The scene
# 8,000 discs on the unit sphere, each facing outwards, as a trained scene would have them.

# %%
from pathlib import Path

import autophyx_tet as apx
import numpy as np
from autophyx_tet.converters import PointTable, read_points, standard_columns, write_points
from PIL import Image

count = 8_000
z = 1 - (2 * np.arange(count) + 1) / count
turn = np.arange(count) * np.pi * (3 - 5**0.5)  # the golden angle spreads them evenly
normals = np.stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z], axis=1)
half_way = np.column_stack([1 + z, -normals[:, 1], normals[:, 0], np.zeros(count)])  # z onto normal
columns = standard_columns(
    means=normals,
    log_scales=np.log(np.tile([0.03, 0.03, 0.003], (count, 1))),
    rotations=half_way / np.linalg.norm(half_way, axis=1, keepdims=True),
    opacity=np.full(count, 0.8),
    f_dc=np.tile([1.2, -0.6, -0.9], (count, 1)),
)
write_points("ball.ply", PointTable(columns))

# %% [markdown]
# ## Splats to tets
# The scene has no metres: `size` says that its longest side is 20 cm. Command line:
# ```
# autophyx-tet convert ball.ply --size 0.2 --up z --edge-length-rel 0.1 \
#     --epsilon-rel 3e-3 -o ball.msh
# ```

# %%
options = apx.ConvertOptions(size=0.2, up="z", edge_length_rel=0.1, epsilon_rel=3e-3)
solid = apx.convert("ball.ply", output=Path("ball.msh"), options=options)
volume = 4 / 3 * np.pi * 0.1**3
print(
    f"{len(solid.mesh.tets):,} tets, {solid.mesh.volume * 1e3:.3f} l; wanted {volume * 1e3:.3f} l"
)
assert abs(solid.mesh.volume / volume - 1) < 0.04

# %% [markdown]
# ## A sentence to a material

# %%
body = apx.assign("ball.msh", "a ball of firm foam", output=Path("foam.msh"))
foam = apx.load_table().exact("firm foam").value()
print(f"E {foam.E:.3g} Pa, nu {foam.nu:.3g}, rho {foam.rho:.4g} kg/m³, {body.mesh.mass:.2f} kg")
assert np.allclose(body.mesh.material.E, foam.E, rtol=1e-6)
assert abs(body.mesh.mass / (foam.rho * volume) - 1) < 0.04

# %% [markdown]
# ## Under its own weight

# %%
sag = apx.simulate("foam.msh")
for verdict in sag.verdicts():
    print(verdict.sentence)
assert 0 < sag.solved.max_displacement < 0.02
Image.open(
    apx.render_png(
        "ball.png",
        apx.story(solid.asset, body.mesh, sag.solved.displacement),
        pixels=240,
        samples=2,
    )
)

# %% [markdown]
# ## Back onto the splats
# The mesh remembers which file it was made of and the metres per unit, so the values land in the
# right place. Every property of the scene is kept; `E nu rho part` are appended. Command line:
# `autophyx-tet transfer foam.msh ball.ply -o ball_physics.ply`

# %%
carried = apx.transfer("foam.msh", "ball.ply", output=Path("ball_physics.ply"))
splats = read_points("ball_physics.ply").columns
print(", ".join(splats))
assert carried.done.points == count
assert abs(carried.scale - 0.1) < 0.002
for name in columns:
    assert np.array_equal(splats[name], columns[name])
for name in ("E", "nu", "rho"):
    assert np.allclose(splats[name], getattr(foam, name), rtol=1e-6)

# %% [markdown]
# ## On to another program
# `autophyx-tet export foam.msh --for newton -o ball.vtk` is the same for Newton; so are
# `gmsh`, `calculix`, `mujoco`, `usd`, `sofa` and `fenics`.

# %%
written = apx.export("foam.msh", "newton", output=Path("ball.vtk"))
print(*written.files)
assert all(file.stat().st_size for file in written.files)
