"""CPU seconds of one command by stage, in the process that runs it: they add up to its total.

    python benchmarks/stage_clock.py simulate mesh.msh -o out.vtu

A stage has the CPU seconds of all threads while it is open; of the stages that may be inside each
other the outermost. What loads modules of Python or of kernels, and every ordering and factor, is a
stage of its own wherever it happens; what no stage claims is "rest".
"""

from __future__ import annotations

import contextlib
import functools
import importlib
import io
import json
import resource
import sys
import time
from collections import defaultdict
from collections.abc import Callable

# Stage: the functions whose CPU seconds it is, by module and name.
STAGES = {
    "kernels loaded": [("warp._src.context", "Module.load")],
    "ordering": [("autophyx_tet.fem.linalg.cholesky", "planned_elimination")],
    "factors": [
        ("autophyx_tet.fem.linalg.cholesky", "CholeskyFactor.__init__"),
        ("autophyx_tet.fem.linalg.cholesky", "cached_factor"),
    ],
    "read the mesh": [("autophyx_tet.converters.mesh.meshdata", "read_mesh")],
    "supports": [("autophyx_tet.fem.scene.supports", "find_supports")],
    "static, P2 and P1": [("autophyx_tet.fem.solve.statics", "solve_static")],
    "modes": [("autophyx_tet.fem.solve.modal", "natural_modes")],
    "buckling": [("autophyx_tet.fem.solve.modal", "find_load_factor")],
    "ends of the ranges": [
        ("autophyx_tet.fem.uncertainty", "displacement_interval"),
        ("autophyx_tet.fem.uncertainty", "frequency_intervals"),
    ],
    "what is likely": [("autophyx_tet.fem.uncertainty", "likely_answers")],
    "write": [("autophyx_tet.toolkit.verdict.simulation", "Simulation.write")],
}
IMPORTS, REST, START = "imports", "rest", "start of Python"
ANYWHERE = (IMPORTS, "kernels loaded", "ordering", "factors")


class StageClock:
    """CPU seconds of the stages; the last that was opened has what passes."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = defaultdict(float)
        self._open, self._last = [REST], time.process_time()
        self.seconds[START] = self._last
        self._watched: set[tuple[object, str]] = set()

    def _tick(self) -> None:
        now = time.process_time()
        self.seconds[self._open[-1]] += now - self._last
        self._last = now

    @contextlib.contextmanager
    def stage(self, name: str):
        """Charge what passes inside to the stage ``name``."""
        self._tick()
        self._open.append(name if name in ANYWHERE or self._open[-1] == REST else self._open[-1])
        try:
            yield
        finally:
            self._tick()
            self._open.pop()

    def timed(self, name: str, function: Callable) -> Callable:
        """``function``, its CPU seconds charged to the stage ``name``."""

        @functools.wraps(function)
        def wrapped(*args, **kwargs):
            with self.stage(name):
                return function(*args, **kwargs)

        return wrapped

    def watch(self) -> None:
        """Charge imports from now on; functions of ``STAGES`` once their modules are there."""
        bootstrap = sys.modules["_frozen_importlib"]
        load = bootstrap._find_and_load  # type: ignore  (where every first import of a name passes)

        def loaded(name, import_):
            with self.stage(IMPORTS):
                module = load(name, import_)
                for stage, functions in STAGES.items():
                    for home, path in functions:
                        if home == name:
                            self._wrap(sys.modules[home], path, stage)
            return module

        bootstrap._find_and_load = loaded  # type: ignore

    def _wrap(self, module: object, path: str, stage: str) -> None:
        *owners, name = path.split(".")
        for owner in owners:
            module = getattr(module, owner)
        if (module, name) not in self._watched:
            self._watched.add((module, name))
            setattr(module, name, self.timed(stage, getattr(module, name)))


def main() -> None:
    clock = StageClock()
    clock.watch()
    with contextlib.redirect_stdout(io.StringIO()):
        code = importlib.import_module("autophyx_tet.toolkit.cli.main").main(sys.argv[1:])
    clock._tick()
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    if children.ru_utime:
        clock.seconds["processes of its own"] = children.ru_utime + children.ru_stime
    json.dump(clock.seconds, sys.stdout)
    sys.exit(code)


if __name__ == "__main__":
    main()
