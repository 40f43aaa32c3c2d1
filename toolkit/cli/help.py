"""What --help shows: the options that most calls want; --help-all shows every one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from typing import Annotated, Any, get_args, get_type_hints

import tyro

BRIEF, WHOLE = ("-h", "--help"), "--help-all"
# By name, in whatever command they stand.
RARE = frozenset(
    "accept_broken address anchors basis bins body cache cells config damping device drop_height "
    "edge_length encoder epsilon_rel eta fall_height features grain gravity_dir grid handles "
    "interpreter law layers lower matter max_tets memory_limit modes move neighbours no_cache "
    "obstacle order parameters parameters_alpha part part_wall picture poke_force preset pressure "
    "print_config scene seed self_contact solid squeeze_share stiff supports table tear_share "
    "threads time_limit to_stiff torque touch traceback views wind_speed with_nu".split()
)


def asked(words: Sequence[str]) -> str:
    """Return which help ``words`` of the command line ask for, BRIEF or WHOLE, or nothing."""
    if WHOLE in words:
        return WHOLE
    return next((word for word in words if word in BRIEF), "")


def brief(command: type) -> type:
    """Return ``command`` without its rare options, for its help alone."""
    hints = get_type_hints(command, include_extras=True)
    own: dict[str, Any] = {"__annotations__": {}, "__doc__": command.__doc__}
    for item in fields(command):
        hint, group = hints[item.name], item.default_factory
        if item.name in RARE and item.default is not MISSING:
            hint, own[item.name] = tyro.conf.Suppress[hint], item.default
        elif isinstance(group, type) and is_dataclass(group):
            inner = brief(group)
            hint = Annotated[(inner, *get_args(hint)[1:])]
            own[item.name] = field(default_factory=inner)
        else:
            continue
        own["__annotations__"][item.name] = hint
    return dataclass(frozen=True)(type(command.__name__, (command,), own))
