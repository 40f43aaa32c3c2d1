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
# # How right is the solver?
#
# Three bodies whose answer is in the textbooks: a bar that is pulled, a beam that bends, a hollow
# sphere that is blown up. Each is solved on meshes that get finer, with linear and with quadratic
# tets, and the error is plotted. The rule to take home: linear tets bend too little; quadratic
# ones, which `simulate` uses while the body is small enough, do not.

# %%
import matplotlib.pyplot as plt
import numpy as np
from autophyx_tet.fem import (
    ElementMaterial,
    Supports,
    TetMesh,
    Traction,
    box_mesh,
    pressure,
    solve_static,
)
from matplotlib.ticker import NullFormatter

E, nu = 1e7, 0.3  # Pa, 1: a stiff rubber, but compressible


def with_material(mesh):
    return mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=E, nu=nu, rho=1000.0))


def rollers(points):
    """The planes x = 0, y = 0 and z = 0 let points slide in them and not leave them."""
    held = Supports.none(len(points))
    for axis in range(3):
        held = held.with_fixed(np.abs(points[:, axis]) < 1e-9, axis)
    return held


def end_faces(mesh, x):
    faces = mesh.boundary.faces
    return faces[np.isclose(mesh.points[faces][:, :, 0], x).all(axis=1)]


# %% [markdown]
# ## A bar that is pulled
# `u = (s/E) (x, -nu y, -nu z)` is linear in space, so even the coarsest linear tets hold it to
# rounding.

# %%
bar = with_material(box_mesh((1.0, 0.2, 0.2), (4, 1, 1)))
stress = 1e4  # Pa
pull = Traction(end_faces(bar, 1.0), np.array([stress, 0, 0]))
u = solve_static(bar, rollers(bar.points), traction=pull).displacement
exact = bar.points * stress / E * np.array([1, -nu, -nu])
bar_error = np.abs(u - exact).max() / np.abs(exact).max()
print(f"relative error {bar_error:.1e}")
assert bar_error < 1e-10

# %% [markdown]
# ## A beam that bends
# Clamped on the left, a force `P` down on the right end. Timoshenko's beam sinks by
# `P L³ / 3 E I + P L / k G A`, `k = 10 (1 + nu) / (12 + 11 nu)`. The theory itself is right to
# about 1 % here, because a real clamp also keeps the section from changing its width.

# %%
length, side, force = 1.0, 0.1, 1.0  # m, m, N
inertia, area, G = side**4 / 12, side**2, E / (2 * (1 + nu))
k = 10 * (1 + nu) / (12 + 11 * nu)
textbook = force * length**3 / (3 * E * inertia) + force * length / (k * G * area)


def tip(n, order):
    """Mean sink [m] of the end face, with ``n`` cells across."""
    mesh = with_material(box_mesh((length, side, side), (5 * n, n, n)))
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)
    load = Traction(end_faces(mesh, length), np.array([0, 0, -force / area]))
    u = solve_static(mesh, held, traction=load, order=order).displacement
    return -u[mesh.points[:, 0] == length, 2].mean()


across = {1: np.array([1, 2, 4, 8]), 2: np.array([1, 2, 4])}
sunk = {order: np.array([tip(n, order) for n in cells.tolist()]) for order, cells in across.items()}
for order, values in sunk.items():
    rows = zip(across[order], values / textbook, strict=True)
    print(f"order {order}:", ", ".join(f"{n} across: {share:.3f}" for n, share in rows))
assert sunk[1][0] / textbook < 0.5  # one linear tet across is far too stiff
assert abs(sunk[2][-1] / textbook - 1) < 0.015
assert (np.diff(sunk[1]) > 0).all()  # softer with every refinement, as the theory has it

# %% [markdown]
# ## A hollow sphere that is blown up
# Pressure `p` inside, radii `a` and `b`. Lamé (1852):
# `u_r = p a³ / (E (b³ - a³)) ((1 - 2 nu) r + (1 + nu) b³ / (2 r²))`. An eighth of it is enough:
# a cube's outer layers, rounded off. The facets of both kinds of tets are flat, so a round body
# converges with the square of their size under both; quadratic ones start from a smaller error.

# %%
a, b, p = 0.05, 0.1, 1e4  # m, m, Pa


def shell(n):
    box = box_mesh((1, 1, 1), (n, n, n))
    kept = box.tets[box.centroids.max(axis=1) > 0.5]
    used, tets = np.unique(kept, return_inverse=True)
    x = box.points[used]
    radius = b * x.max(axis=1, keepdims=True)
    points = radius * x / np.linalg.norm(x, axis=1, keepdims=True)
    return with_material(TetMesh.oriented(points, tets.reshape(-1, 4)))


def radial_error(n, order):
    """Root mean square of the error of u over all points, relative."""
    mesh = shell(n)
    r = np.linalg.norm(mesh.points, axis=1)
    faces = mesh.boundary.faces
    inner = faces[np.isclose(r[faces], a).all(axis=1)]
    load = pressure(mesh, inner, p)
    u = solve_static(mesh, rollers(mesh.points), traction=load, order=order).displacement
    size = p * a**3 / (E * (b**3 - a**3)) * ((1 - 2 * nu) * r + (1 + nu) * b**3 / (2 * r**2))
    exact = size[:, None] * mesh.points / r[:, None]
    return np.sqrt(((u - exact) ** 2).sum() / (exact**2).sum())


edges = {1: np.array([4, 8, 16]), 2: np.array([4, 8])}
sphere = {
    order: np.array([radial_error(n, order) for n in ns.tolist()]) for order, ns in edges.items()
}
rate = np.log2(sphere[1][-2] / sphere[1][-1])
print(f"linear tets: {sphere[1]}, rate {rate:.2f}; quadratic: {sphere[2]}")
assert rate > 1.7  # two is the theory's
assert sphere[2][-1] < 0.3 * sphere[1][1]

# %% [markdown]
# ## All in one picture

# %%
figure, axes = plt.subplots(1, 2, figsize=(8, 3.2), dpi=80)
for order, mark in ((1, "o-"), (2, "s-")):
    label = "linear tets" if order == 1 else "quadratic tets"
    axes[0].loglog(1 / across[order], np.abs(1 - sunk[order] / textbook), mark, label=label)
    axes[1].loglog(2 / edges[order], sphere[order], mark, label=label)
h = np.array([2 / 16, 2 / 4])
axes[1].loglog(h, sphere[1][0] * (h / h[1]) ** 2, "k:", label="second order")
for axis, title in zip(axes, ("Beam: sink of the tip", "Hollow sphere"), strict=True):
    axis.set(title=title, xlabel="size of a cell / thickness", ylabel="relative error")
    axis.grid(alpha=0.3)
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.legend()
figure.tight_layout()
