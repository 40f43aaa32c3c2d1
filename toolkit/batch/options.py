"""Options of a batch: who does its rows, and what each may use."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ...fem.errors import UsageError


@dataclass(frozen=True)
class BatchOptions:
    """Who does the rows of a batch, and what each row may use."""

    engine: Literal["local", "ray"] = "local"
    """Processes of this machine, or a Ray cluster (the extra `batch`)."""
    address: str | None = None
    """Address of a running Ray cluster; by default one is started here."""
    workers: int | None = None
    """Assets at a time; by default as many as there are cores."""
    time_limit: float = 1800.0
    """Seconds that one asset may take."""
    memory_limit: float = 8.0
    """Address space [GB] of each process of an asset; 2 is enough for small ones."""

    def checked(self) -> BatchOptions:
        """Return itself, or say what is out of range."""
        if self.workers is not None and self.workers < 1:
            raise UsageError(f"--workers must be at least 1, got {self.workers}")
        for name in ("time_limit", "memory_limit"):
            if not getattr(self, name) > 0:
                flag = name.replace("_", "-")
                raise UsageError(f"--{flag} must be > 0, got {getattr(self, name):g}")
        if self.address and self.engine != "ray":
            raise UsageError("--address names a Ray cluster: say --engine ray too")
        return self
