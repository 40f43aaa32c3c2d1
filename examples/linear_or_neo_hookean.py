"""When is the linear law not enough?

A bar of rubber is pressed and pulled, its sides free: at 0.1 % both laws agree, at 30 % not.
"""

import numpy as np
from autophyx_tet.fem import ElementMaterial, Supports, box_mesh, solve_nonlinear, solve_static

E, nu = 1e6, 0.4  # Pa, 1
lam, mu = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
bar = box_mesh((1.0, 1.0, 1.0), (2, 1, 1))  # m
bar = bar.with_material(ElementMaterial.uniform(len(bar.tets), E=E, nu=nu, rho=1000.0))
end = bar.points[:, 0] == 1


def held(strain):
    """It slides in three planes, and its end is moved by ``strain`` [1] times its length."""
    rollers = Supports.none(len(bar.points)).with_fixed(end, 0, strain)
    for axis in range(3):
        rollers = rollers.with_fixed(bar.points[:, axis] == 0, axis)
    return rollers


def force(result):
    """Force [N] on the end that is moved."""
    return result.reaction[result.space.nodes[:, 0] == 1, 0].sum()


for strain in (-0.3, 0.001, 0.3):
    linear = force(solve_static(bar, held(strain)))
    large = force(solve_nonlinear(bar, held(strain), law="neohookean"))
    print(f"{strain:+.1%}: linear {linear / 1e3:.2f} kN, neo-Hookean {large / 1e3:.2f} kN")
    # Exact, on 1 m^2: E e; and of W = mu/2 (|F|^2 - 3) - mu (J - 1) + (lam + mu)/2 (J - 1)^2 with
    # F = diag(l, a, a), J = l a^2, where dW/da = 0 gives a:
    stretch = 1 + strain
    a2 = (1 + mu * strain / ((lam + mu) * stretch)) / stretch
    exact = mu * stretch - mu * a2 + (lam + mu) * (stretch * a2 - 1) * a2
    assert np.isclose(linear, E * strain, rtol=1e-7)
    assert np.isclose(large, exact, rtol=1e-6)  # Newton's tolerance is 1e-8 of the forces
