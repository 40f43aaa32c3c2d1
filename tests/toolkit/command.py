"""The command line in a process of its own."""

import subprocess
import sys


def run_cli(*arguments, cwd=None):
    """Run in a process of its own, as a user would."""
    return subprocess.run(
        [sys.executable, "-m", "autophyx_tet.toolkit.cli", *map(str, arguments)],
        capture_output=True,
        text=True,
        cwd=cwd,
        timeout=600,
    )
