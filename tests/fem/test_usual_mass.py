"""Plausibility of mass: things that were weighed are usual, solid cars are not."""

import tomllib
from pathlib import Path

import numpy as np
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.toolkit.verdict.checks import usual_mass

from .bodies import with_uniform

WEIGHED = Path(__file__).parents[2] / "benchmarks" / "data" / "known_masses.toml"


def sides(thing) -> np.ndarray:
    """Box [m] around a thing of the table."""
    if "boxes" in thing:
        boxes = np.array(thing["boxes"])
        return ((boxes[:, :3] + boxes[:, 3:]).max(axis=0) - boxes[:, 3:].min(axis=0)) / 1e3
    if "profile" in thing:
        profile = np.array(thing["profile"])
        return np.array([profile[:, 1].max()] * 2 + [np.ptp(profile[:, 0])]) / 1e3
    if "ball" in thing:
        return np.full(3, thing["ball"]) / 1e3
    shape = next(thing[name] for name in ("box", "ellipsoid", "cylinder", "tube") if name in thing)
    round_ = "cylinder" in thing or "tube" in thing
    return np.array([shape[0], shape[0], shape[-1]] if round_ else shape) / 1e3


def block(size, mass):
    mesh = box_mesh(tuple(size), (1, 1, 1))
    return with_uniform(mesh, E=1e9, nu=0.3, rho=mass / float(np.prod(size)))


def test_all_things_that_were_weighed_are_usual():
    things = tomllib.loads(WEIGHED.read_text())["thing"]
    assert len(things) > 60
    for thing in things:
        check = usual_mass(block(sides(thing), thing["mass"]))
        assert check.outcome == "passed", (thing["name"], check.sentence)


def test_solid_cars_and_clouds_are_asked_about():
    """A car full of steel, a fridge of air, and a millimetre taken for a metre."""
    heavy = usual_mass(block((4.3, 1.8, 1.5), 0.6 * 7850 * 4.3 * 1.8 * 1.5))
    assert heavy.outcome == "failed"
    assert "Is it solid throughout?" in heavy.sentence
    light = usual_mass(block((0.6, 0.6, 1.86), 1.5))
    assert light.outcome == "failed"
    assert "Is it so light?" in light.sentence
