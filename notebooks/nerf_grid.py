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
# # A NeRF density grid: to a simulation and back
#
# A radiance field knows how much light a place absorbs, its `density` [1/m]. That is no mass:
# kilograms are in `rho` [kg/m³], which comes from the material. Here a field that shows a column
# becomes tets of rubber, the column sinks under its own weight as much as the textbook says, and
# the grid gets `E`, `nu`, `rho` beside its density.
#
# ## The field
# A column of 8 cm across and 20 cm high in a box of 60 x 60 x 80 cells.

# %%
from pathlib import Path

import autophyx_tet as apx
import numpy as np
from autophyx_tet.converters import DensityGrid, read_density, write_density
from PIL import Image

radius, height = 0.04, 0.2  # m
lo, hi, shape = np.array([-0.06, -0.06, -0.02]), np.array([0.06, 0.06, 0.22]), (60, 60, 80)
x, y, z = DensityGrid(lo, hi, np.zeros(shape)).centers().T
outside = np.maximum(np.hypot(x, y) - radius, np.abs(z - height / 2) - height / 2)  # m
density = np.clip(50 - 2e4 * outside, 0, 100).reshape(shape)  # 1/m, falls over 5 mm
write_density("column.npz", DensityGrid(lo, hi, density, threshold=50.0))

# %% [markdown]
# ## Density to tets
# Our archive is in metres. Command line:
# ```
# autophyx-tet convert column.npz --up z --edge-length-rel 0.1 \
#     --epsilon-rel 3e-3 -o column.msh
# ```

# %%
options = apx.ConvertOptions(up="z", edge_length_rel=0.1, epsilon_rel=3e-3)
solid = apx.convert("column.npz", output=Path("column.msh"), options=options)
volume = np.pi * radius**2 * height
print(
    f"{len(solid.mesh.tets):,} tets, {solid.mesh.volume * 1e3:.3f} l; wanted {volume * 1e3:.3f} l"
)
assert abs(solid.mesh.volume / volume - 1) < 0.03

# %% [markdown]
# ## Rubber under its own weight
# A column that stands free sinks by `rho g H² / (2 E)` at its top. Its glued base cannot widen,
# which makes a real one a little stiffer.

# %%
body = apx.assign("column.msh", "a soft rubber column", output=Path("rubber.msh"))
rubber = apx.load_table().exact("soft rubber").value()
sag = apx.simulate("rubber.msh")
top = body.mesh.points[:, 2] > height - 0.004
sunk = -sag.solved.displacement[top, 2].mean()
textbook = rubber.rho * 9.81 * height**2 / (2 * rubber.E)
print(f"{body.mesh.mass:.2f} kg sink by {sunk * 1e6:.0f} µm; the textbook: {textbook * 1e6:.0f} µm")
assert np.allclose(body.mesh.material.E, rubber.E, rtol=1e-6)
assert abs(body.mesh.mass / (rubber.rho * volume) - 1) < 0.03
assert 0.85 < sunk / textbook < 1.05
Image.open(
    apx.render_png(
        "column.png",
        apx.story(solid.asset, body.mesh, sag.solved.displacement),
        pixels=240,
        samples=2,
    )
)

# %% [markdown]
# ## Back onto the grid
# Cells above the threshold get the values, empty ones 0. Command line:
# `autophyx-tet transfer rubber.msh column.npz -o column_physics.npz`

# %%
carried = apx.transfer("rubber.msh", "column.npz", output=Path("column_physics.npz"))
grid = read_density("column_physics.npz")
full = density > 50
cell = np.prod(grid.spacing)  # m³
mass = grid.fields["rho"].sum() * cell
print(f"{carried.done.points:,} cells of {cell * 1e9:.0f} mm³, {mass:.2f} kg")
assert np.array_equal(grid.density, density)
assert np.allclose(grid.fields["E"], np.where(full, rubber.E, 0), rtol=1e-6)
assert abs(mass / (rubber.rho * volume) - 1) < 0.05
