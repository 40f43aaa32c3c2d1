"""The command line, in a process of its own or in this one."""

import io
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout

from autophyx_tet.toolkit.cli.main import main


def run_cli(*arguments, cwd=None):
    """Run in a process of its own, as a user would."""
    return subprocess.run(
        [sys.executable, "-m", "autophyx_tet", *map(str, arguments)],
        capture_output=True,
        text=True,
        cwd=cwd,
        timeout=600,
    )


def run_here(*arguments):
    """Run in this process, without the seconds in which a new one loads its packages."""
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        try:
            code = main([*map(str, arguments)])
        except SystemExit as stop:  # what the option parser does with words that it cannot read
            code = int(stop.code or 0)
    return subprocess.CompletedProcess(arguments, code, out.getvalue(), err.getvalue())
