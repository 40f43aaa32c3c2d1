"""The command line: parses, calls the pipeline, prints; loads nothing heavy before that."""

from __future__ import annotations

import io
import logging
import os
import sys
import traceback
from difflib import get_close_matches
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tyro

from ... import __version__
from ...fem.errors import AutophyxError, UsageError
from ..config import config_text, option_names, with_config
from ..native.interrupts import was_interrupted
from .batch import COMMANDS as BATCH
from .help import BRIEF, WHOLE, asked, brief
from .learning import COMMANDS as LEARNING
from .look import COMMANDS as LOOK
from .mesh import COMMANDS as MESH
from .pipes import piped, writes_to_stdout
from .transfer import COMMANDS as TRANSFER
from .view import COMMANDS as VIEW

if TYPE_CHECKING:
    from ..options import Common

EXIT_BUG = 1
EXIT_INTERRUPTED = 130
EXIT_PIPE = 141  # what shells return when nobody reads any more: `--help | head`
COMMANDS = {**MESH, **TRANSFER, **LOOK, **VIEW, **BATCH, **LEARNING}


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
        return _main(given)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # for the flush at exit
        return EXIT_PIPE


def _main(given: list[str]) -> int:
    if given == ["--version"]:
        sys.stdout.write(f"autophyx-tet {__version__}\n")
        return 0
    try:
        command = _parse(given)
    except AutophyxError as error:
        _say(f"autophyx-tet: {_one_line(error)}")
        return error.exit_code
    common: Common = command.common
    if common.print_config:
        sys.stdout.write(config_text(command))
        return 0
    _configure_logging(common)
    return _call(command, common)


def _parse(given: list[str]) -> Any:
    """The command with its options; exits with 2 where tyro cannot read them."""
    verb = next(iter(given), "")
    if verb and not verb.startswith("-") and verb not in COMMANDS:
        close = get_close_matches(verb, COMMANDS, n=1)
        hint = f"did you mean {close[0]}?" if close else f"there are {', '.join(COMMANDS)}"
        raise UsageError(f"there is no command {verb!r}: {hint}")
    given = _joined_signs(given)
    commands: dict[str, Any] = dict(COMMANDS)
    help_wanted = asked(given) if verb in COMMANDS else ""
    if help_wanted == WHOLE:
        given = [verb, "--help"]
    elif help_wanted:
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
        if stop.code and (lone := lone_sentence(verb, given)):
            _say(f"autophyx-tet: {lone!r} stands alone: a sentence goes behind --text {lone!r}")
        raise
    finally:
        if help_wanted in BRIEF:
            sys.stdout.write(f"Every option: autophyx-tet {verb} {WHOLE}\n")


def _joined_signs(given: list[str]) -> list[str]:
    """Write ``--up -y`` as ``--up=-y``: the parser takes a word with a dash for an option."""
    joined: list[str] = []
    for word in given:
        if word in ("-x", "-y", "-z") and joined and joined[-1] == "--up":
            word = f"{joined.pop()}={word}"
        joined.append(word)
    return joined


def lone_sentence(verb: str, given: list[str]) -> str:
    """Return the sentence that stands in the place of a file, of a verb that takes one, or none."""
    if verb not in ("run", "assign"):
        return ""
    pairs = pairwise(given)
    lone = (w for before, w in pairs if " " in w and not w.startswith("-") and before[:1] != "-")
    return next((word for word in lone if not Path(word).exists()), "")


def _call(command: Any, common: Common) -> int:
    """Run the command, show its document, and turn errors into one line and an exit code."""
    try:
        with piped(command) as real:
            document = real()
    except AutophyxError as error:
        _trace(common)
        _say(f"autophyx-tet: {_one_line(error)}")
        return error.exit_code
    except KeyboardInterrupt:
        _say("autophyx-tet: interrupted; nothing half-written was left")
        return EXIT_INTERRUPTED
    except MemoryError as error:
        _trace(common)
        _say(f"autophyx-tet: out of memory: {_one_line(error) or 'no more could be had'}")
        return EXIT_BUG
    except Exception as error:
        if was_interrupted():
            _say("autophyx-tet: interrupted; nothing half-written was left")
            return EXIT_INTERRUPTED
        _trace(common)
        _say(
            f"autophyx-tet: a bug: {type(error).__name__}: {_one_line(error)} "
            "(run again with --traceback and report it)"
        )
        return EXIT_BUG
    _show(document, common, silent=writes_to_stdout(command))
    return 0


def _trace(common: Common) -> None:
    if common.traceback:
        traceback.print_exc()


def _configure_logging(common: Common) -> None:
    level = logging.INFO if common.verbose else logging.ERROR
    logging.basicConfig(level=level, format="%(name)s: %(message)s", stream=sys.stderr)


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split())


def _say(line: str) -> None:
    sys.stderr.write(line + "\n")


def _show(document: dict[str, Any], common: Common, *, silent: bool) -> None:
    """Print what was found; with a ``silent`` stdout its warnings alone."""
    from ..io.document import SCHEMA, dumps

    if silent:
        from .terminal import warn

        return None if common.quiet else warn(document)

    if common.json:
        from .terminal import warn

        sys.stdout.write(dumps({"schema": SCHEMA, **document}) + "\n")
        if not common.quiet:
            warn(document)
    elif not common.quiet:
        from .terminal import show

        show(document)


if __name__ == "__main__":
    sys.exit(main())
