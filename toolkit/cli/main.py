"""The command line: parses, calls the pipeline, prints; loads nothing heavy before that."""

from __future__ import annotations

import io
import logging
import os
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import MISSING, dataclass, field, fields, is_dataclass, replace
from difflib import get_close_matches
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any, get_args, get_type_hints

import tyro

from ... import __version__
from ...fem.errors import AutophyxError, UsageError
from ...fem.registry import Registry
from ..asset.guard import was_interrupted
from ..options import Common, config_text, option_names, with_config

EXIT_BUG = 1
INTERRUPTED = "interrupted; nothing half-written was left"
EXIT_INTERRUPTED = 130
EXIT_PIPE = 141  # what shells return when nobody reads any more: `--help | head`
# Verb -> its options, loaded when it is called: the last three are of `research`.
COMMANDS: Registry[Any] = Registry(
    "command",
    (__package__ or "").partition(".")[0],
    {
        "convert": "toolkit.cli.commands:ConvertCommand",
        "assign": "toolkit.cli.commands:AssignCommand",
        "simulate": "toolkit.cli.commands:SimulateCommand",
        "reduce": "toolkit.cli.commands:ReduceCommand",
        "match": "toolkit.cli.commands:MatchCommand",
        "run": "toolkit.cli.commands:RunCommand",
        "film": "toolkit.cli.commands:FilmCommand",
        "transfer": "toolkit.cli.commands:TransferCommand",
        "export": "toolkit.cli.commands:ExportCommand",
        "features": "toolkit.cli.commands:FeaturesCommand",
        "segment": "toolkit.cli.commands:SegmentCommand",
        "materials": "toolkit.cli.commands:MaterialsCommand",
        "info": "toolkit.cli.commands:InfoCommand",
        "doctor": "toolkit.cli.commands:DoctorCommand",
        "view": "toolkit.cli.commands:ViewCommand",
        "batch": "toolkit.cli.commands:BatchCommand",
        "dataset": "research.commands:DatasetCommand",
        "train": "research.commands:TrainCommand",
        "evaluate": "research.commands:EvaluateCommand",
    },
)


DESCRIPTION = """From a 3D asset and a sentence to a simulation-ready tetrahedral mesh.

Exit codes: 0 done (a missing texture or a failed verdict is a warning); 1 a bug; 2 a wrong option,
part name or text; 3 input that cannot be read, an output that cannot be written, a missing extra;
4 no volume or no tet mesh possible; 5 E, nu or rho outside their band, under --strict; 6 a solver
did not converge; 130 interrupted.

Every command has --help with an example, and --help-all; --version says which version this is.
Completion: autophyx-tet --tyro-print-completion bash|zsh|tcsh prints the shell's script."""


def main(arguments: list[str] | None = None) -> int:
    """Run one command; the exit code is 0, or the one of the error (see ``DESCRIPTION``)."""
    given = sys.argv[1:] if arguments is None else arguments
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that knows no cube sign shows a ?
    try:
        if given == ["--version"]:
            sys.stdout.write(f"autophyx-tet {__version__}\n")
            return 0
        try:
            command = _parse(given)
        except AutophyxError as error:
            _say(" ".join(str(error).split()))
            return error.exit_code
        common: Common = command.common
        if common.print_config:
            sys.stdout.write(config_text(command))
            return 0
        level = logging.INFO if common.verbose else logging.ERROR
        logging.basicConfig(level=level, format="%(name)s: %(message)s", stream=sys.stderr)
        return _call(command, common)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # for the flush at exit
        return EXIT_PIPE


def _parse(given: list[str]) -> Any:
    """The command with its options; exits with 2 where tyro cannot read them."""
    verb = next(iter(given), "")
    if verb and not verb.startswith("-") and verb not in COMMANDS:
        close = get_close_matches(verb, COMMANDS, n=1)
        hint = f"did you mean {close[0]}?" if close else f"there are {', '.join(COMMANDS)}"
        raise UsageError(f"there is no command {verb!r}: {hint}")
    # Write `--up -y` as `--up=-y`: the parser takes a word with a dash for an option
    joined: list[str] = []
    for word in given:
        if word in ("-x", "-y", "-z") and joined and joined[-1] == "--up":
            word = f"{joined.pop()}={word}"
        joined.append(word)
    given = joined
    commands: dict[str, Any] = dict(COMMANDS)
    whole = verb in COMMANDS and WHOLE in given
    short = verb in COMMANDS and not whole and any(word in BRIEF for word in given)
    if whole:
        given = [verb, "--help"]
    elif short:
        commands[verb] = brief(commands[verb])
    try:
        return tyro.extras.subcommand_cli_from_dict(
            commands,
            prog="autophyx-tet",
            description=DESCRIPTION,
            args=with_config(given, option_names(COMMANDS[verb]) if verb in COMMANDS else ()),
            config=(tyro.conf.DisallowNone,),
        )
    except SystemExit as stop:
        if stop.code and verb in ("run", "assign"):
            # a sentence that stands in the place of a file
            for before, word in pairwise(given):
                alone = " " in word and not word.startswith("-") and before[:1] != "-"
                if alone and not Path(word).exists():
                    _say(f"{word!r} stands alone: a sentence goes behind --text {word!r}")
                    break
        raise
    finally:
        if short:
            sys.stdout.write(f"Every option: autophyx-tet {verb} {WHOLE}\n")


def _call(command: Any, common: Common) -> int:
    """Run the command, show its document, and turn errors into one line and an exit code."""
    try:
        with piped(command) as real:
            document = real()
    except KeyboardInterrupt:
        _say(INTERRUPTED)
        return EXIT_INTERRUPTED
    except Exception as error:
        said, code = " ".join(str(error).split()), EXIT_BUG
        if isinstance(error, AutophyxError):
            code = error.exit_code
        elif isinstance(error, MemoryError):
            said = f"out of memory: {said or 'no more could be had'}"
        elif was_interrupted():
            _say(INTERRUPTED)
            return EXIT_INTERRUPTED
        else:
            kind = type(error).__name__
            said = f"a bug: {kind}: {said} (run again with --traceback and report it)"
        if common.traceback:
            traceback.print_exc()
        _say(said)
        return code
    from ..asset.document import SCHEMA, dumps

    to_stdout = _writes_to_stdout(command)
    if common.json and not to_stdout:
        sys.stdout.write(dumps({"schema": SCHEMA, **document}) + "\n")
    if not common.quiet:
        from .terminal import show, warn

        if common.json or to_stdout:
            warn(document)
        else:
            show(document, command.shown)
    return 0


def _say(line: str) -> None:
    sys.stderr.write(f"autophyx-tet: {line}\n")


# What --help shows: the options that most calls want; --help-all shows every one.

BRIEF, WHOLE = ("-h", "--help"), "--help-all"
# By name, in whatever command they stand.
RARE = frozenset(
    "accept_broken address anchors at basis bins body budget cache cells config crop damping "
    "device dial drop_height edge_length encoder epsilon_rel eta fall_height features grain "
    "gravity gravity_dir grid handles interpreter keep law layers lower matter max_tets "
    "memory_limit modes move neighbours no_cache obstacle opacity order parameters "
    "parameters_alpha part part_wall picture poke_force preset pressure print_config region "
    "samples scene seconds seed self_contact solid spin_rate squeeze_share stiff supports "
    "table tear_share threads time_limit to_stiff torque touch traceback views wind_speed "
    "with_nu".split()
)


def brief(command: type) -> type:
    """Return ``command`` without its rare options, for its help alone."""
    hints = get_type_hints(command, include_extras=True)
    own: dict[str, Any] = {"__annotations__": {}, "__doc__": command.__doc__}
    for item in fields(command):  # type: ignore
        hint, group = hints[item.name], item.default_factory
        if item.name in RARE and item.default is not MISSING:
            hint, own[item.name] = tyro.conf.Suppress[hint], item.default  # type: ignore
        elif isinstance(group, type) and is_dataclass(group):
            inner = brief(group)
            hint = Annotated[(inner, *get_args(hint)[1:])]  # type: ignore
            own[item.name] = field(default_factory=inner)
        else:
            continue
        own["__annotations__"][item.name] = hint
    return dataclass(frozen=True)(type(command.__name__, (command,), own))


# A dash in place of a mesh: read it from stdin, write it to stdout, as .msh.

DASH = Path("-")
_INPUTS = ("mesh", "file")  # what commands call a mesh that they read
_WRITERS = ("ConvertCommand", "AssignCommand")


def _writes_to_stdout(command: Any) -> bool:
    """Whether the result goes to stdout, where nothing else may be told then."""
    return getattr(command, "output", None) == DASH


@contextmanager
def piped(command: Any) -> Iterator[Any]:
    """Give the command with files in the places of dashes; what it wrote goes to stdout at its end.

    Raises UsageError: Where stdout has two things to hold, or what goes there is no mesh.
    """
    reads = [name for name in _INPUTS if getattr(command, name, None) == DASH]
    writes = _writes_to_stdout(command)
    if not reads and not writes:
        yield command
        return
    if writes and (command.common.json or type(command).__name__ not in _WRITERS):
        raise UsageError("-o -: stdout takes a mesh of `convert` or `assign`, without --json")
    with TemporaryDirectory() as folder:
        files = {"output": Path(folder) / "stdout.msh"} if writes else {}
        for name in reads:
            files[name] = Path(folder) / "stdin.msh"
            files[name].write_bytes(sys.stdin.buffer.read())
        yield replace(command, **files)
        if writes:
            sys.stdout.buffer.write(files["output"].read_bytes())
            sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
