"""How the trees of `benchmarks/house.py` are counted, on one of two files."""

import importlib.util
import sys

import pytest

FACE = '''"""A toy."""

from .beam import Beam, sag

_HOME = {"width": "beam"}
__all__ = ["Beam", "sag", *_HOME]
'''
BEAM = '''"""Beams."""


class Beam:
    """A beam of length [m] and shape (n, 3).

    >>> Beam().length
    1.0
    """

    def __init__(self):
        self.length = self._measured() + self._measured()

    def _measured(self):
        return 1.0


def sag(beam, x):
    """Deflection of the list ``x[1]``, see [1]_."""
    def _inner(): return beam
    return _once(x) + _twice(x) + _twice(x) + _inner()


def _once(x):
    # _once
    return x


def _twice(x):
    return x


def _never(x):
    return x


def width(E: 'Float[np.ndarray, "tets"]'):
    """Width by modulus [kg/m^3]."""
'''


@pytest.fixture
def house(root):
    spec = importlib.util.spec_from_file_location("house", root / "benchmarks" / "house.py")
    module = sys.modules["house"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_tree_of_two_files(house, tmp_path):
    """Each number is known; what is left out is not counted."""
    toy = tmp_path / "toy"
    (toy / "tests").mkdir(parents=True)
    (toy / "tests" / "test_beam.py").write_text("x = 1\n")
    (toy / "__init__.py").write_text(FACE)
    (toy / "beam.py").write_text(BEAM)
    (tmp_path / "examples").mkdir()
    (tmp_path / "examples" / "cantilever.py").write_text("print(1)\n")
    row = house.count("toy", [toy], left_out=house.LEFT_OUT, examples=1)
    lengths = [len(FACE.splitlines()), len(BEAM.splitlines())]
    assert (row.files, row.lines, row.file_lines.max) == (2, sum(lengths), max(lengths))
    assert (row.functions, row.function_lines.median, row.function_lines.max) == (8, 2, 4)
    assert (row.private, row.called_once) == (4, 1)  # of the four only ``_once``, a comment is none
    assert (row.own_words, row.words_twice) == (5, 1)  # with ``_inner``, which stands twice
    assert (row.exported, row.units, row.shapes, row.doctests) == (3, 2, 2, 1)
    assert house.example_files(tmp_path) == house.example_files(tmp_path / "examples") == 1
    assert "25 %" in house.table([row])


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("E [Pa]", True), ("rho [kg/m^3],", True), ("g [m/s^2]", True), ("nu [1]", True),
        ("step [m or rad, by joint]", True), ("torque [N m]", True), ("k [N/(m s)]", True),
        ("x[1]", False), ("see [1]_", False), (".. [1] Hertz", False), ("list[m]", False),
        ("[optional]", False), ("[i]", False), ("[0]", False), ("[1, 0, 0]", False),
    ],
)  # fmt: skip
def test_units_are_no_indices(house, text, unit):
    """Units in brackets, of numbers without one [1]; not what is indexed or referred to."""
    assert bool(house.UNIT.search(text)) == unit


@pytest.mark.parametrize(
    ("text", "shape"),
    [
        ("(n, 3)", True), ("(tets,)", True), ("shape (rows, columns)", True), ("(3, n)", True),
        ("(points, 3, 3)", True), ("Lame parameters (lam, mu)", False), ("0.5 (of 1)", False),
        ("from (0, 1)", False),
    ],
)  # fmt: skip
def test_shapes_are_no_pairs(house, text, shape):
    """Tuples of sizes, not of names."""
    assert bool(house.SHAPE.search(text)) == shape
