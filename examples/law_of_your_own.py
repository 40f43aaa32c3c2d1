"""How do I add a law of my own?

St Venant and Kirchhoff's, as two functions of warp; `law="st venant"` then works in every solver.
"""

import warp as wp
from autophyx_tet.fem import LAWS, ElasticLaw, ElementMaterial, Supports, box_mesh, solve_nonlinear


@wp.func
def stress_of(E: wp.mat33d, lam: wp.float64, mu: wp.float64) -> wp.mat33d:
    """Second Piola stress [Pa] of Green's strain."""
    return lam * wp.trace(E) * wp.identity(n=3, dtype=wp.float64) + wp.float64(2.0) * mu * E


@wp.func
def energy_and_stress(H: wp.mat33d, lam: wp.float64, mu: wp.float64):
    """W [J/m^3] = S : E / 2 and P = F S [Pa], of the displacement gradient H = F - I."""
    E = wp.float64(0.5) * (H + wp.transpose(H) + wp.transpose(H) * H)
    S = stress_of(E, lam, mu)
    return wp.float64(0.5) * wp.ddot(S, E), (H + wp.identity(n=3, dtype=wp.float64)) * S


@wp.func
def stress_change(H: wp.mat33d, dH: wp.mat33d, lam: wp.float64, mu: wp.float64) -> wp.mat33d:
    """DP = dH S(E) + F S(dE): what Newton's method needs."""
    half = wp.float64(0.5)
    F = H + wp.identity(n=3, dtype=wp.float64)
    E = half * (H + wp.transpose(H) + wp.transpose(H) * H)
    dE = half * (wp.transpose(dH) * F + wp.transpose(F) * dH)
    return dH * stress_of(E, lam, mu) + F * stress_of(dE, lam, mu)


LAWS.register(
    "st venant",
    ElasticLaw(
        title="St Venant-Kirchhoff",
        energy_and_stress=energy_and_stress,
        stress_change=stress_change,
    ),
)

E, nu, stretch = 1e5, 0.3, 1.3  # Pa, 1, 1
cube = box_mesh((1.0, 1.0, 1.0), (1, 1, 1))
cube = cube.with_material(ElementMaterial.uniform(len(cube.tets), E=E, nu=nu, rho=1000.0))
held = Supports.none(len(cube.points)).with_fixed(cube.points[:, 0] == 1, 0, stretch - 1)
for axis in range(3):
    held = held.with_fixed(cube.points[:, axis] == 0, axis)
result = solve_nonlinear(cube, held, law="st venant")
force = result.reaction[result.space.nodes[:, 0] == 1, 0].sum()
green = (stretch**2 - 1) / 2
print(f"pulled to {stretch:g} times its length by {force:.6g} N")
assert abs(force / (stretch * E * green) - 1) < 1e-7  # exact: P = l E e, e = (l^2 - 1) / 2
