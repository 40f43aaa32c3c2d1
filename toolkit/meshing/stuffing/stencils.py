"""How a tet is divided by the signs of its four corners: one table for all 81 patterns.

A corner is inside (+), outside (-) or on the surface (0); where two corners have opposite signs
their edge is cut. Labelle and Shewchuk, "Isosurface stuffing" (SIGGRAPH 2007), section 3: where a
face has two cuts, the diagonal of what they leave goes through the cut of a long edge, and where
both are on short ones to the end of the long edge that the parity of the coordinates names, so that
both tets at a face choose the same.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from itertools import combinations, product

import numpy as np
from jaxtyping import Int

from .lattice import EDGES

Pattern = tuple[int, ...]  # signs of A, B, C, D
Tet = tuple[int, ...]  # four points: 0 to 3 are the corners, 4 to 9 the cuts of the edges

CUT = {pair: 4 + k for k, edge in enumerate(EDGES) for pair in (edge, edge[::-1])}
LONG = (CUT[0, 1], CUT[2, 3])
# Of the faces at a long edge: its end that exceeds the tip in an even number of coordinates for
# odd edges, in an odd number for even ones. (Even on all faces, or odd, is one-sided: the tets
# inside and outside of a surface would choose other diagonals.)
END = {(0, 1, 2): 0, (0, 1, 3): 1, (2, 3, 0): 2, (2, 3, 1): 3}
# One tet of the lattice, A exceeding C in an even number of coordinates, positively oriented.
CORNERS = np.array([[0.5, 0.5, -0.5], [0.5, 0.5, 0.5], [0, 0, 0], [1, 0, 0]])
CORNERS = np.concatenate([CORNERS, [(CORNERS[i] + CORNERS[j]) / 2 for i, j in EDGES]])


def patterns() -> Iterator[Pattern]:
    """All 81 patterns of signs of A, B, C, D, in the order of their codes."""
    yield from product((-1, 0, 1), repeat=4)


def pattern_code(signs: Int[np.ndarray, "tets 4"]) -> Int[np.ndarray, "tets"]:
    """Number of each pattern of -1, 0 and 1."""
    return (signs + 1) @ np.array([27, 9, 3, 1])


@cache
def stencil(signs: Pattern) -> tuple[Tet, ...]:
    """Positively oriented tets that fill the inside of a tet with these signs of A, B, C, D."""
    inside, outside, surface = ([i for i in range(4) if signs[i] == s] for s in (1, -1, 0))
    if not inside:
        tets: list[Tet] = []
    elif not outside:
        tets = [(0, 1, 2, 3)]
    elif len(inside) == 1:
        tets = [(inside[0], *(CUT[inside[0], n] for n in outside), *surface)]
    elif len(inside) == 2 and surface:
        quad = cut_face(outside[0], inside[0], inside[1])
        tets = [(*triangle, *surface) for triangle in quad]
    elif len(inside) == 3:
        tets = _prism(inside, [CUT[p, outside[0]] for p in inside], outside, inside)
    else:
        one, two = ([p, *(CUT[p, n] for n in outside)] for p in inside)
        tets = _prism(one, two, outside, inside)
    return tuple(positive(tet, CORNERS) for tet in tets)


def face_diagonal(tip: int, first: int, second: int) -> set[int]:
    """Diagonal of the quadrilateral that cuts of both edges at ``tip`` leave of a face."""
    for end, other in ((first, second), (second, first)):
        if CUT[tip, end] in LONG:
            return {CUT[tip, end], other}
    end = END[min(first, second), max(first, second), tip]
    return {end, CUT[tip, second if end == first else first]}


def cut_face(tip: int, first: int, second: int) -> list[Tet]:
    """Return the two triangles of that quadrilateral."""
    near, far = CUT[tip, first], CUT[tip, second]
    if face_diagonal(tip, first, second) == {second, near}:
        return [(first, second, near), (second, near, far)]
    return [(first, second, far), (first, near, far)]


def positive(tet: Tet, points: np.ndarray) -> Tet:
    """Return the tet with positive volume."""
    a, *others = points[list(tet)]
    return tet if np.linalg.det(np.array(others) - a) > 0 else (*tet[:2], tet[3], tet[2])


def _prism(
    top: Sequence[int], bottom: Sequence[int], outside: Sequence[int], inside: Sequence[int]
) -> list[Tet]:
    """Three tets of a prism that keep the diagonals of its cut faces; the fattest way."""
    fixed = [face_diagonal(tip, *ends) for tip in outside for ends in combinations(inside, 2)]
    sides = [(k, (k + 1) % 3) for k in range(3)]
    rims = [{s[i], s[j]} for s in (top, bottom) for i, j in sides]
    rims += [{top[k], bottom[k]} for k in range(3)]
    ways = []
    for leaning in product((False, True), repeat=3):
        diagonals = [
            {top[j], bottom[i]} if lean else {top[i], bottom[j]}
            for lean, (i, j) in zip(leaning, sides, strict=True)
        ]
        edges = [*rims, *diagonals]
        tets = [
            tet
            for tet in combinations([*top, *bottom], 4)
            if all(set(pair) in edges for pair in combinations(tet, 2))
        ]
        if len(tets) == 3 and all(diagonal in diagonals for diagonal in fixed):
            ways.append((min(_fatness(tet) for tet in tets), tets))
    return max(ways)[1]


def _fatness(tet: Tet) -> float:
    """Volume by the cube of the longest edge."""
    a, *others = points = CORNERS[list(tet)]
    longest = max(np.linalg.norm(p - q) for p, q in combinations(points, 2))
    return abs(np.linalg.det(np.array(others) - a)) / longest**3
