"""Which method solves a scenario: its own, or the one of ``--solver`` with its options."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from math import isnan
from typing import TYPE_CHECKING

from ...fem.errors import UsageError
from ...fem.scenarios.scenario import SCENARIOS, Scenario
from ...fem.solve.method import METHODS, Method
from ..options import SimulateOptions
from .fitted import Moduli, checked_alpha, moduli_between

if TYPE_CHECKING:
    from ...fem.reduced.method import ReducedMethod
    from ...fem.springs.method import SpringMethod

# What solvers beside finite elements cannot do, by name of the scenario's own method or scenario.
REFUSED = {
    ("mpm", "modal"): "particles do not ring",
    ("spring", "modal"): "springs are followed in time",
    ("spring", "tear"): "springs do not tear",
    ("lbs", "modal"): "a reduced body is followed in time",
    ("lbs", "tear"): "a reduced body does not tear",
}
# Options that only some solvers have: with another they would be left out in silence.
OWNED = {
    **dict.fromkeys(("grid", "stiff", "matter", "damping", "preset", "threads"), ("mpm",)),
    **dict.fromkeys(("anchors", "neighbours", "eta"), ("spring",)),
    **dict.fromkeys(("basis", "handles"), ("lbs",)),
    **dict.fromkeys(("parameters", "parameters_alpha"), ("lbs", "spring")),
    "order": ("fem", "lbs"),
}
# Options that are a scenario's numbers, those of N named N_...: as they would be beside another.
STAGED = {"supports": "sag", "modes": "modal"} | {
    field.name: scenario
    for field in fields(SimulateOptions)
    for scenario in SCENARIOS.names
    if field.name.startswith(f"{scenario}_")
}


def method_name(options: SimulateOptions, scenario: Scenario) -> str:
    """Name of the method of ``--solver`` for ``scenario``; ``UsageError`` where it cannot."""
    _check_owners(options, scenario)
    if options.solver == "fem":
        return scenario.method
    why = REFUSED.get((options.solver, options.scenario))
    if why is not None:
        other = "mpm" if scenario.method == "mpm" else "fem"
        raise UsageError(f"--scenario {options.scenario}: {why}; --solver {other}")
    return options.solver


def _check_owners(options: SimulateOptions, scenario: Scenario) -> None:
    """Refuse what neither the solver nor the scenario would read, rather than leave it out."""
    solver = "mpm" if scenario.method == "mpm" else options.solver
    known = [field.name for field in fields(scenario)]  # type: ignore  (a scenario is a dataclass)
    read = {*known, *(f"{options.scenario}_{name}" for name in known)}
    for name in (*OWNED, *STAGED):
        if getattr(options, name) == getattr(SimulateOptions, name):
            continue
        option = name.replace("_", "-")
        owners = OWNED.get(name, ())
        if owners and solver not in owners:
            raise UsageError(f"--{option}: wanted --solver {' or '.join(owners)}, not {solver}")
        if name in STAGED and name not in read:
            wanted = f"wanted --scenario {STAGED[name]}, not {options.scenario}"
            raise UsageError(f"--{option}: {wanted}")


def chosen_method(
    name: str,
    options: SimulateOptions,
    materials: Mapping[str, str],
    announce: Callable[[str], None] | None = None,
    *,
    classes: Mapping[str, str] | None = None,
) -> Method:
    """Return the method ``name`` with the options that are its own, loaded when asked for.

    ``materials`` are rows of the table by part, ``classes`` of matter those that were found of
    them; ``announce`` hears what the run will cost.
    """
    if name == "mpm":
        from .matter import particle_method

        return particle_method(options, materials, announce, classes=classes)
    if name == "spring":
        return spring_method(options, announce)
    if name == "lbs":
        return reduced_method(options, announce)
    return METHODS[name]


def reduced_method(
    options: SimulateOptions, announce: Callable[[str], None] | None = None
) -> ReducedMethod:
    """Reduced bodies of the kind and size, and with the fitted moduli, that the options name."""
    from ...converters.reduced_archive import load_fits
    from ...fem.reduced.method import ReducedMethod
    from ...fem.reduced.model import Subspace

    _check_parameters(options)
    moduli = Moduli(1.0, None)
    if options.parameters is not None:
        moduli = moduli_between(load_fits(options.parameters), options.parameters_alpha)
    return ReducedMethod(
        kind=Subspace(options.basis),
        handles=options.handles,
        scale=moduli.scale,
        nu=moduli.nu,
        announce=announce,
    )


def spring_method(
    options: SimulateOptions, announce: Callable[[str], None] | None = None
) -> SpringMethod:
    """Springs of the network that the options name, or of the one that was fitted."""
    from ...converters.spring_archive import load_springs
    from ...fem.springs.method import SpringMethod

    _check_parameters(options)
    if options.parameters is None:
        network = {"anchors": options.anchors, "neighbours": options.neighbours, "eta": options.eta}
        return SpringMethod(**network, announce=announce)
    fit = load_springs(options.parameters)
    for name in ("anchors", "neighbours", "eta"):
        asked, fitted = getattr(options, name), getattr(fit, name)
        if asked not in (fitted, getattr(SimulateOptions, name)):
            raise UsageError(
                f"--{name} {asked:g}: --parameters were fitted with {fitted:g}, and hold for it "
                "alone; leave it out"
            )
    network = {"anchors": fit.anchors, "neighbours": fit.neighbours, "eta": fit.eta}
    ends = 1 if isnan(fit.stiffer) else 2
    alpha = checked_alpha(options.parameters_alpha, ends)
    stiffer = None if ends == 1 else fit.stiffer**alpha
    found = {"scale": fit.scale, "surface": fit.surface, "stiffer": stiffer}
    return SpringMethod(**network, **found, announce=announce)


def _check_parameters(options: SimulateOptions) -> None:
    if options.parameters is None and options.parameters_alpha is not None:
        raise UsageError("--parameters-alpha: wanted --parameters of `match --to-stiff` with it")
