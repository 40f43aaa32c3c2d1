"""Options outside the command line: a TOML file and the cells of a manifest, as arguments.

Both become ordinary arguments, so that there is one parser and one set of messages. What stands in
the file comes first: the command line has the last word.
"""

from __future__ import annotations

import shlex
import tomllib
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar

from ..fem.errors import InputError, UsageError

Options = TypeVar("Options")  # a dataclass of options
# What belongs to one call, not to a configuration.
_OF_THE_CALL = ("common", "output", "dry_run")
_OF_THE_MACHINE = ("cache", "no_cache")
_SHORT = {"field_output": "field", "target": "for"}  # names that the command line changes


def arguments(options: Mapping[str, Any]) -> list[str]:
    """Options by name as arguments: true is a flag, a list repeats its option."""
    found = []
    for name, value in options.items():
        flag = f"--{name.replace('_', '-')}"
        for item in value if isinstance(value, list | tuple) else [value]:
            if isinstance(item, dict):
                raise UsageError(f"{name}: wanted a value or a list, got a table")
            if item is True:
                found.append(flag)
            elif item is not False and item is not None:
                found.append(f"{flag}={item}")
    return found


def command_line(verb: str, *inputs: Any, options: Iterable[Any] = (), **given: Any) -> str:
    """The call of a verb as a shell reads it; of ``options`` what is not its default.

    Where results are remembered is left out: it changes no result.
    """
    said, words = [str(word) for word in inputs], []
    for group in options:
        for item in fields(group) if group is not None else ():
            value, name = getattr(group, item.name), _SHORT.get(item.name, item.name)
            if value == item.default or item.name in _OF_THE_MACHINE:
                continue
            turned_off = value is False
            words += arguments({f"no_{name}" if turned_off else name: turned_off or value})
    for word in [*words, *arguments(given)]:
        flag, equals, value = word.partition("=")
        # what starts with a dash would be taken for an option
        said += [flag, value] if equals and not value.startswith("-") else [word]
    return shlex.join(["autophyx-tet", verb, *said])


def read_config(path: Path) -> list[str]:
    """Arguments of a TOML file; tables only group.

    Raises
    ------
    InputError
        Where the file cannot be read or is no TOML.
    """
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"cannot read the configuration {path}: {error}") from error
    flat: dict[str, Any] = {}
    for name, value in document.items():
        flat |= value if isinstance(value, dict) else {name: value}
    return arguments(flat)


def with_given(options: Options, given: Mapping[str, Any], *, verb: str) -> Options:
    """Return the options with those ``given`` by name, as a Python user writes them.

    Raises
    ------
    UsageError
        Where there is no such option.
    """
    known = [item.name for item in fields(options)]  # type: ignore
    for name in given:
        if name not in known:
            near = get_close_matches(name, known, n=1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise UsageError(f"{verb} has no option {name!r}{hint}")
    return replace(options, **given)  # type: ignore


def option_names(command: Any) -> set[str]:
    """Names that a configuration of a command may have, those of its groups too."""
    names = set()
    for item in fields(command):
        group = item.default_factory
        if is_dataclass(group):
            names |= option_names(group)
        elif "Positional" not in str(item.type) and item.name not in _OF_THE_CALL:
            names.add(_SHORT.get(item.name, item.name))
    return names


def with_config(command: list[str], known: Collection[str]) -> list[str]:
    """Put what the file of ``--config`` says behind the verb, before all other arguments.

    Raises
    ------
    UsageError
        Where the file names an option that is not ``known``.
    """
    path = None
    for i, word in enumerate(command):
        if word == "--config" and i + 1 < len(command):
            path = command[i + 1]
        elif word.startswith("--config="):
            path = word.partition("=")[2]
    if path is None:
        return command
    given = read_config(Path(path))
    for word in given:
        _check_known(path, word.removeprefix("--").partition("=")[0].replace("-", "_"), known)
    return [command[0], *given, *command[1:]]


def _check_known(path: str, name: str, known: Collection[str]) -> None:
    if name not in known:
        near = get_close_matches(name, known, n=1)
        hint = f"did you mean {near[0]!r}?" if near else "--help-all lists them"
        raise UsageError(f"{path}: there is no option {name!r}: {hint}")


def config_text(command: Any) -> str:
    """The options of a command as TOML; one that has no value yet is a comment."""
    return "\n".join(_lines(command)) + "\n"


def _lines(options: Any) -> Iterator[str]:
    for item in fields(options):
        value = getattr(options, item.name)
        if item.name in _OF_THE_CALL:
            continue
        if is_dataclass(value):
            yield from ("", f"# {type(value).__name__}", *_lines(value))
        elif "Positional" not in str(item.type):
            name = _SHORT.get(item.name, item.name)
            yield f"# {name} =" if value is None else f"{name} = {_toml(value)}"


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_toml, value))}]"
    escaped = "".join(_escape(letter) for letter in str(value))
    return f'"{escaped}"'


def _escape(letter: str) -> str:
    if letter in '"\\':
        return "\\" + letter
    return letter if ord(letter) >= 32 and ord(letter) != 127 else f"\\u{ord(letter):04x}"
