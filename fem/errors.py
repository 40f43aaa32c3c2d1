"""The error family: every failure that is not a bug, each with the exit code of the CLI.

A message says what was got, what was wanted and what to do next, with value, index and count. What
is raised carries a kind and these values; its sentence is made elsewhere, as that of every note.
"""

from __future__ import annotations

from typing import Any

from .note import Note


class AutophyxError(ValueError):
    """An error the user can act on; ``exit_code`` is what the CLI returns for it.

    ``note`` has its kind and values; text that is no kind stands for itself.
    """

    exit_code = 1

    def __init__(self, kind: str = "", /, **values: Any) -> None:
        self.note = Note(kind, **values)
        super().__init__(str(self.note))


class UsageError(AutophyxError):
    """A wrong option, an unknown part name, a text that is too long."""

    exit_code = 2


class InputError(AutophyxError):
    """Unreadable or invalid input, unknown suffix, missing path or extra, output not writable."""

    exit_code = 3


class NoVolumeError(AutophyxError):
    """The input encloses no volume, or no tet mesh of it could be made."""

    exit_code = 4


class BandError(AutophyxError):
    """E, nu or rho outside the band of the material's category, under ``--strict``."""

    exit_code = 5


class ConvergenceError(AutophyxError):
    """A solver did not reach its tolerance."""

    exit_code = 6
