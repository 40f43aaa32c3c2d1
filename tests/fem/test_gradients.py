"""Adjoint gradients against finite differences, and what they are for: finding E."""

import numpy as np
import pytest
import torch
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.fem.scene.obstacles import Plane
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.dynamics import Damping, Dynamics
from autophyx_tet.fem.solve.gradients import implicit_step, static_displacement
from autophyx_tet.fem.solve.schemes import Scheme

from .bodies import shaken_box

G = (0.3, 0.0, -9.81)


def _fields(mesh, seed=0):
    rng = np.random.default_rng(seed)
    n = len(mesh.tets)
    fields = 10 ** rng.uniform(4, 5, n), rng.uniform(0.1, 0.4, n), rng.uniform(900, 1100, n)
    return [torch.tensor(f, requires_grad=True) for f in fields]


def _compare(displacement, fields, rel):
    """Directional derivatives of a random loss, field by field."""
    rng = np.random.default_rng(1)
    weight = torch.tensor(rng.normal(size=displacement(*fields).shape))
    (displacement(*fields) * weight).sum().backward()
    for k, field in enumerate(fields):
        d = torch.tensor(rng.normal(size=len(field))) * field.detach()
        h = 1e-5
        sides = []
        for sign in (1, -1):
            moved = [f.detach() + (sign * h * d if i == k else 0) for i, f in enumerate(fields)]
            sides.append(float((displacement(*moved) * weight).sum()))
        assert float((field.grad * d).sum()) == pytest.approx(
            (sides[0] - sides[1]) / 2 / h, rel=rel
        )


@pytest.mark.parametrize("order", [1, 2])
def test_static_gradient(order):
    """d loss / d (E, nu, rho) of a static solve equals central differences."""
    mesh = shaken_box(cells=(2, 2, 2))
    held = Supports.clamp(len(mesh.points), mesh.points[:, 2] == 0)
    solve = lambda *f: static_displacement(  # noqa: E731
        mesh, held, *f, gravity_vector=G, order=order, tolerance=1e-12
    )
    _compare(solve, _fields(mesh), rel=1e-6)


def test_step_gradient():
    """The same for one implicit step of a neo-Hookean body."""
    mesh = shaken_box(cells=(2, 2, 2))
    held = Supports.clamp(len(mesh.points), mesh.points[:, 2] == 0)
    rng = np.random.default_rng(5)
    v = rng.normal(size=mesh.points.shape)
    make = lambda m: Dynamics(  # noqa: E731
        m, supports=held, gravity_vector=G, velocity=v, tolerance=1e-12
    )
    step = lambda *f: implicit_step(make, mesh, *f, gravity_vector=G, dt=0.02)  # noqa: E731
    _compare(step, _fields(mesh), rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("scheme", list(Scheme))
@pytest.mark.parametrize("damping", [None, Damping(mass=3.0), Damping(stiffness=0.01)])
def test_step_gradient_of_every_scheme(scheme, damping):
    """Also damped, and where the start's own acceleration depends on the material."""
    mesh = shaken_box(cells=(2, 1, 1))
    held = Supports.clamp(len(mesh.points), mesh.points[:, 2] == 0)
    v = np.random.default_rng(5).normal(size=mesh.points.shape)
    options = {"supports": held, "velocity": v, "scheme": scheme, "damping": damping}
    make = lambda m: Dynamics(m, gravity_vector=G, **options, tolerance=1e-12)  # noqa: E731
    step = lambda *f: implicit_step(make, mesh, *f, gravity_vector=G, dt=0.02)  # noqa: E731
    _compare(step, _fields(mesh), rel=1e-5)


def test_contact_has_no_gradient():
    """Its barrier depends on E: refused, not wrong."""
    mesh = shaken_box(cells=(1, 1, 1))
    make = lambda m: Dynamics(m, obstacles=[Plane((0, 0, -0.1))])  # noqa: E731
    with pytest.raises(InputError, match="obstacles"):
        implicit_step(make, mesh, *_fields(mesh), dt=0.01)


@pytest.mark.slow
def test_two_material_beam_is_recovered():
    """The displacements of the bench beam give back the E of its two halves within 1 %."""
    mesh = box_mesh((1, 0.2, 0.2), (10, 2, 4))
    upper = torch.tensor(mesh.centroids[:, 2] > 0.1)
    nu = torch.where(upper, 0.4, 0.3).double()
    rho = torch.where(upper, 1200.0, 1000.0).double()
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)

    def fall(log_E):
        E = 10 ** torch.where(upper, log_E[1], log_E[0])
        return static_displacement(mesh, held, E, nu, rho, gravity_vector=(0, 0, -9.81))

    seen = fall(torch.tensor([6.0, 7.0], dtype=torch.float64))
    guess = torch.tensor([6.5, 6.5], dtype=torch.float64, requires_grad=True)
    search = torch.optim.LBFGS([guess], max_iter=40, line_search_fn="strong_wolfe")

    def loss():
        search.zero_grad()
        value = ((fall(guess) - seen) ** 2).sum() / (seen**2).sum()
        value.backward()
        return value

    search.step(loss)
    assert guess.detach().numpy() == pytest.approx([6.0, 7.0], abs=np.log10(1.01))
