"""A thing in one piece divided by the clauses of a sentence, or left whole where that is unsure.

Cut by looks alone, once into coarser and once into finer regions, and by the shells of its mesh
too; what the network says of them, and of the thing after a quarter turn (nobody knows its front),
is averaged where they overlap. How
sure it is of the whole object is on record; below ``WHOLE`` one material everywhere, that of the
first clause, is right more often.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ...fem.note import Note
from ...fem.table import MaterialTable
from ..appearance.features import PLAIN_FINISH, Appearance
from ..asset import UpAxis, upright
from ..encoders import TextEncoder
from ..grid import PartVoxels
from ..matter import LOOK, by_look
from ..partition import piece_name
from ..prediction import Binding
from ..text.clauses import Bound, BoundPart, Clause, Sentence
from ..text.english import words
from ..text.parts import known_parts, stem
from .network import Measured, RegionNetwork, Said, Words, copies, measured, quarter_turned

WHOLE = 0.5  # of the certainty: below it a thing stays in one piece
LARGER = 1.2  # times a region: what may not be its copy
FORCED = 2.0  # nats that giving each clause a region may cost, all in all
NULL = 0.6  # of a region's share: from here the null clause wins, and nobody spoke of it
_GREY = 0.6  # colour of what has none
_LEAST = 1e-4  # of a share, for its logarithm


class Regions(NamedTuple):
    """A thing cut in several ways.

    cells: Indices (n, 3) of its cells, upright.
    looks: Colour and finish (n, 7) of each.
    plain: Region of each by its colour alone, coarser and finer (cuts, n).
    region: Region by colour, finish and shells too; the first of ``plain`` where none are known.
    shells: Whether they are known.
    """

    cells: np.ndarray
    looks: np.ndarray
    plain: np.ndarray
    region: np.ndarray
    shells: bool


class Divided(NamedTuple):
    """Which clause speaks of each cell.

    owner: Clause (n,) of each cell; their number stands for none.
    share: How surely the clause of each cell speaks of it (n,).
    certainty: Fraction of the volume that is expected to have its right clause.
    """

    owner: np.ndarray
    share: np.ndarray
    certainty: float


def region_name(number: int) -> str:
    """What the region of a number, from 1, is called as a part."""
    return f"region {number}"


def region_numbers(names: Sequence[str]) -> list[int] | None:
    """Numbers of parts that are the regions of one thing, None where any is called otherwise."""
    found = [re.fullmatch(r"region ([1-9]\d*)", name) for name in names]
    numbers = [int(one[1]) for one in found if one]
    return numbers if len({*numbers}) == len(names) else None


def cut(
    cells: Int[np.ndarray, "n 3"],
    appearance: Appearance | None,
    up: UpAxis,
    *,
    region: Int[np.ndarray, "n"] | None = None,
) -> Regions:
    """Cut the cells of a thing, given by their indices on the grid, into regions.

    appearance: What is seen of them: without it only what is thick is told from what is thin.
    region: That of each, where it was cut before.
    """
    at = tuple(cells.T)
    turned = np.rint(upright(cells.astype(float), up)).astype(int)
    turned -= turned.min(axis=0)
    looks = np.tile((_GREY, _GREY, _GREY, *PLAIN_FINISH), (len(cells), 1))
    if appearance is not None and appearance.colours is not None:
        looks[:, :3] = appearance.colours[at]
    if region is not None:
        return Regions(turned, looks, region[None], region, shells=False)
    plain = np.stack([segment(turned, looks, near=near) for near in PLAIN_NEAR])
    if appearance is not None and appearance.shell is not None:
        if appearance.finish is not None:
            looks[:, 3:LOOK] = appearance.finish[at]
        shell = np.unique(appearance.shell[at], return_inverse=True)[1].ravel()
        region = segment(turned, looks, shell)
        return Regions(turned, looks, plain, region, shells=True)
    return Regions(turned, looks, plain, plain[0], shells=False)


def apart(regions: Regions, part: Int[np.ndarray, "n"]) -> Regions:
    """Return the regions cut where parts meet, the largest first again."""
    if not np.ptp(part):
        return regions
    *plain, region = (
        largest_first(np.unique(part * (int(of.max()) + 1) + of, return_inverse=True)[1].ravel())
        for of in (*regions.plain, regions.region)
    )
    return regions._replace(plain=np.stack(plain), region=region)


def said_by(clause: Clause, sentence: Sentence) -> Said:
    """Return what the network is told of a clause: its noun phrases, and its material."""
    nouns = [" ".join(name) for name in clause.subject.names]
    if not nouns and clause.subject.scope == "whole":
        nouns = [" ".join(sentence.thing)] if sentence.thing else []
    if not nouns and clause.subject.scope == "rest":
        nouns = ["everything else"]
    if not nouns and stem(clause.phrase) in known_parts():  # "soil", "green leaves"
        nouns = [clause.phrase]
    material = clause.phrase or clause.material or clause.kind or clause.unknown
    return Said(", ".join(nouns), material, clause.material or "")


def divide(
    regions: Regions,
    said: Sequence[Said],
    *,
    encoder: TextEncoder,
    table: MaterialTable,
    told: Int[np.ndarray, "n"] | None = None,
    network: RegionNetwork | None = None,
) -> Divided:
    """Find the clause that speaks of each cell.

    Each clause has a region, if that costs little: what is spoken of is there.

    told: The clause that a user gave each cell, their number for none of them, else -1; a region
        is told where most of its cells are. What is larger than all of these, and no copy of
        them, stays as it was.
    """
    network = network or RegionNetwork.load()
    cuts = [(False, plain) for plain in regions.plain]
    if regions.shells:
        cuts.append((True, regions.region))
    _, first, of, size = np.unique(
        np.stack([region for _, region in cuts]), axis=1, return_index=True, return_inverse=True,
        return_counts=True,
    )  # fmt: skip
    words, seen = Words.of(said, encoder), []
    for shells, region in cuts:
        looks = regions.looks.copy()
        if not shells:
            looks[:, 3:] = PLAIN_FINISH
        seen.append((measured(regions.cells, looks, region), region, shells))

    def asked(told: Int[np.ndarray, "n"] | None) -> Float[np.ndarray, "pieces clauses"]:
        """Shares of what no cut divides."""
        shares: dict[bool, list[np.ndarray]] = {shells: [] for _, _, shells in seen}
        for found, region, shells in seen:
            of_region = None if told is None else told_regions(found, region, told, len(said))
            for one in (found, quarter_turned(found)):
                given = network.inputs(
                    one, said, words=words, shells=shells, table=table, told=of_region
                )
                shares[shells].append(network(given)[region[first]])
        return np.mean([np.mean(each, axis=0) for each in shares.values()], axis=0)

    mean = asked(None)
    owner = assigned(mean)
    if told is not None and (told >= 0).any():
        each = np.bincount(regions.region)[regions.region]
        larger = (each > LARGER * each[told >= 0].max())[first]
        mean = np.where(larger[:, None], mean, asked(told))
        owner = np.where(larger, owner, assigned(mean))
    share = mean[np.arange(len(mean)), owner]
    slope, offset = network.facts["certainty"]
    expected = float((size * share).sum() / size.sum())
    certainty = 1 / (1 + np.exp(-(slope * np.log(expected / (1 - expected + _LEAST)) + offset)))
    return Divided(owner[of.ravel()], share[of.ravel()], float(certainty))


def told_regions(
    found: Measured, region: Int[np.ndarray, "n"], told: Int[np.ndarray, "n"], clauses: int
) -> Int[np.ndarray, "regions"]:
    """The clause that a user gave most cells of a region, or of its copies: of one leg, all.

    Copies that a user told different clauses tell nothing of others, nor does one of no clause.
    """
    votes = np.zeros((len(found.values), clauses + 2), dtype=int)
    np.add.at(votes, (region, told), 1)  # -1 is the last
    own = np.array([*range(clauses + 1), -1])[votes.argmax(axis=1)]
    heard = copies(found) & (own >= 0) & (own < clauses)
    least = np.where(heard, own, clauses).min(axis=1)
    most = np.where(heard, own, -1).max(axis=1)
    return np.where((own < 0) & (least == most), most, own)


def assigned(shares: Float[np.ndarray, "regions clauses"]) -> Int[np.ndarray, "regions"]:
    """Clause of every region, the last for none: the likeliest, and each clause one at least."""
    from scipy.optimize import linear_sum_assignment

    null = shares.shape[1] - 1
    spoken = shares[:, :null]
    owner = np.where(shares[:, null] >= NULL, null, spoken.argmax(axis=1))
    if len(spoken) >= null and null:
        cost = (np.log(shares.max(axis=1, keepdims=True)) - np.log(spoken + _LEAST)).T
        cost = cost.clip(min=0)
        rows, columns = linear_sum_assignment(cost)
        if cost[rows, columns].sum() < FORCED:
            owner[columns] = rows
    return owner


MOST = 48  # regions
PLAIN_NEAR, SHELL_NEAR = (7.0, 5.0), 10.0  # how near looks are one, alone and beside shells
LOOKS, LOOK_SPECK = 16, 0.004  # looks at most, and the fraction of the cells that one needs
SPECK = 0.003  # of the cells: a smaller region goes to its surroundings
# Of a thick region the core is what lies near cells of half its greatest depth: sqrt(3) times that
# depth, as the corner of a box does. It is a region of its own where the region is large, some
# cells deep, and neither all core nor hardly any.
LARGE, DEEP, OPENING, NEAR, CORE = 0.06, 3.0, 0.5, 3**0.5, (0.1, 0.99)
# Half of the 26 neighbours of a cell: each pair is met once.
_AHEAD = [step for step in product((-1, 0, 1), repeat=3) if step > (0, 0, 0)]


def segment(
    cells: Int[np.ndarray, "n 3"],
    looks: Float[np.ndarray, "n look"],
    shell: Int[np.ndarray, "n"] | None = None,
    *,
    near: float = SHELL_NEAR,
) -> Int[np.ndarray, "n"]:
    """Return the region of every cell, from 0, the largest first.

    cells: Indices of a thing's cells on a grid.
    looks: Colour and finish of each, as ``matter.by_look`` takes them.
    shell: The connected surface that each belongs to, where a mesh tells.
    near: How near looks are one.
    """
    label = by_look(looks, most=LOOKS, speck=LOOK_SPECK, near=near)
    if shell is not None:
        label = label * (int(shell.max()) + 1) + shell
    label = _thick_apart(cells, _connected(cells, label))
    return largest_first(_connected(cells, label))


def largest_first(label: Int[np.ndarray, "n"]) -> Int[np.ndarray, "n"]:
    """Labels numbered anew, from 0, that of most cells first."""
    order = np.argsort(-np.bincount(label), kind="stable")
    return np.argsort(order)[label]


def _connected(cells: Int[np.ndarray, "n 3"], label: Int[np.ndarray, "n"]) -> Int[np.ndarray, "n"]:
    """Connected components of equal labels; small ones go to the nearest that is kept."""
    from scipy.ndimage import distance_transform_edt
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    row, at = _padded(cells, np.arange(len(cells)))
    pairs = []
    for step in _AHEAD:
        there = row[tuple((cells - cells.min(axis=0) + 1 + step).T)]
        here = np.flatnonzero(there >= 0)
        here = here[label[here] == label[there[here]]]
        pairs.append((here, there[here]))
    i, j = np.concatenate(pairs, axis=1)
    graph = coo_matrix((np.ones(len(i), dtype=bool), (i, j)), shape=(len(cells),) * 2)
    _, found = connected_components(graph, directed=False)
    size = np.bincount(found)
    kept = np.argsort(-size, kind="stable")[:MOST]
    kept = kept[(size[kept] >= SPECK * len(cells)) | (np.arange(len(kept)) == 0)]
    good = np.isin(found, kept)
    if not good.all():
        far = np.ones(row.shape, dtype=bool)
        far[tuple(i[good] for i in at)] = False
        nearest = distance_transform_edt(far, return_distances=False, return_indices=True)
        found = found[row[tuple(axis[at] for axis in np.asarray(nearest))]]
    return np.unique(found, return_inverse=True)[1].ravel()


def _thick_apart(
    cells: Int[np.ndarray, "n 3"], label: Int[np.ndarray, "n"]
) -> Int[np.ndarray, "n"]:
    """Regions with the thick core of each cut off from what is thin."""
    from scipy.ndimage import distance_transform_edt

    out, count = label.copy(), int(label.max()) + 1
    for k in range(count):
        mine = np.flatnonzero(label == k)
        if len(mine) < LARGE * len(cells):
            continue
        row, at = _padded(cells[mine], np.arange(len(mine)))
        depth = np.asarray(distance_transform_edt(row >= 0))
        radius = OPENING * depth.max()
        if depth.max() < DEEP:
            continue
        core = np.asarray(distance_transform_edt(depth < radius))[at] <= NEAR * radius
        if CORE[0] < core.mean() < CORE[1]:
            out[mine[core]] = count
            count += 1
    return out


def _padded(
    cells: Int[np.ndarray, "n 3"], values: Int[np.ndarray, "n"]
) -> tuple[Int[np.ndarray, "x y z"], tuple[np.ndarray, ...]]:
    """Values on the cells' box with one empty cell (-1) on every side, and where each cell is."""
    at = tuple((cells - cells.min(axis=0) + 1).T)
    box = np.full(np.ptp(cells, axis=0) + 3, -1)
    box[at] = values
    return box, at


class Pieces(NamedTuple):
    """Parts divided by the clauses that speak of them.

    parts: The given parts, and their pieces.
    parents: For each the given part that it is, or is a piece of.
    bound: The sentence, and which of its clauses speak of each.
    bindings: What was understood of those that were divided, by number.
    unsaid: Numbers of pieces of which no clause says a matter.
    notes: Why a thing was left whole.
    """

    parts: PartVoxels
    parents: tuple[int, ...]
    bound: Bound
    bindings: dict[int, Binding]
    unsaid: tuple[int, ...]
    notes: tuple[str, ...]


def carve(parts: PartVoxels, cells: dict[str, np.ndarray]) -> tuple[PartVoxels, tuple[int, ...]]:
    """Return the parts with these cells (nx, ny, nz) as parts of their own, by name; and parents.

    A name that is taken is an error of ``PartVoxels``; cells of several parts belong to the first.
    """
    label, names, labels = parts.part.copy(), list(parts.part_names), list(parts.labels)
    parents = list(range(len(names)))
    for name, mine in cells.items():
        parents.append(int(parts.part[mine].min()))
        label[mine] = len(names)
        names.append(name)
        labels.append(())
    return PartVoxels(parts.grid, label, tuple(names), tuple(labels)), tuple(parents)


def of_matters(sentence: Sentence) -> list[int]:
    """Numbers of the clauses that say a matter, where they name two or more; else none."""
    clauses, is_said_to_be = sentence.clauses, {*words()["roles"]["is"]}
    stated = [
        k for k, one in enumerate(clauses)
        if one.says_matter and not one.excluded
        # "the glass is soda-lime glass": the next clause says which glass
        and not (
            k + 1 < len(clauses) and not (one.subject.names or clauses[k + 1].subject.names)
            and sentence.text[one.span[1] : clauses[k + 1].span[0]].strip() in is_said_to_be
        )
    ]  # fmt: skip
    named = {(one.material, one.phrase) for one in sentence.clauses if one.material}
    return stated if len(named) > 1 else []


def divided(
    parts: PartVoxels,
    left_open: Sequence[int],
    bound: Bound,
    stated: Sequence[int],
    regions: Regions,
    *,
    of: Sequence[int],
    told: Mapping[int, str],
    encoder: TextEncoder,
    table: MaterialTable,
) -> Pieces:
    """Divide what words left open among the clauses that say a matter, their numbers ``stated``.

    regions: Of all occupied cells, in C order.
    of: The thing that each part was before a user took regions out of it: it is seen as it was.
    told: The row of the table of each part that a user so took, by number: what is like it is
        likely of its clause.
    """
    sentence = bound.sentence
    of_cell, thing = parts.part[parts.occupied], np.asarray(of)
    mine = np.isin(thing[of_cell], thing[list(left_open)])
    said = [said_by(sentence.clauses[k], sentence) for k in stated]
    # numbered anew: a region of another part has no cell here
    *plain, region = (
        np.unique(x[mine], return_inverse=True)[1].ravel() for x in (*regions.plain, regions.region)
    )
    ours = Regions(
        regions.cells[mine], regions.looks[mine], np.stack(plain), region, regions.shells
    )
    of_user = np.full(len(region), -1)
    for part, row in told.items():
        same = [k for k, one in enumerate(said) if one.row and table.exact(one.row).name == row]
        if len(same) < 2:  # of two clauses of one matter either may be meant
            of_user[of_cell[mine] == part] = same[0] if same else len(said)
    found = divide(ours, said, encoder=encoder, table=table, told=of_user)
    owner, share, notes = found.owner, found.share, ()
    if found.certainty < WHOLE:
        first = next(i for i, k in enumerate(stated) if sentence.clauses[k].material)
        owner = np.full_like(owner, first)
        texts = ", ".join(repr(sentence.clauses[k].text) for k in stated)
        whole = sentence.clauses[stated[first]].material
        known = {"texts": texts, "material": whole, "certainty": found.certainty}
        notes = (Note("regions.whole", **known),)
    label, names, labels = of_cell.copy(), list(parts.part_names), list(parts.labels)
    parents, clauses = list(range(len(names))), list(bound.parts)
    bindings, unsaid = {}, []
    for i in left_open:
        here = of_cell[mine] == i
        owners, counts = np.unique(owner[here], return_counts=True)
        for rank, k in enumerate(owners[np.argsort(-counts, kind="stable")]):
            cells = np.flatnonzero(mine)[here & (owner == k)]
            clause = None if k == len(stated) else sentence.clauses[stated[k]]
            number = i if rank == 0 else len(names)
            if rank:
                names.append("")
                labels.append(parts.labels[i])
                parents.append(i)
                clauses.append(BoundPart())
            label[cells] = number
            if len(owners) > 1 and clause is not None:
                names[number] = piece_name(parts.part_names[i], clause, names)
            elif rank:
                names[number] = f"{parts.part_names[i]} rest"
            text = None if clause is None else clause.text
            sure = float(share[here & (owner == k)].mean())
            bindings[number] = Binding(text, sure, len(cells), 0.0, found.certainty)
            if clause is None:
                clauses[number] = BoundPart()
                unsaid.append(number)
            else:
                clauses[number] = BoundPart((stated[k],), ("name",))
                if not (clause.material or clause.kind or clause.unknown or clause.numbers):
                    unsaid.append(number)
    part = parts.part.copy()
    part[parts.occupied] = label
    made = PartVoxels(parts.grid, part, tuple(names), tuple(labels))
    heard = replace(bound, parts=tuple(clauses), unbound=())
    return Pieces(made, tuple(parents), heard, bindings, tuple(unsaid), notes)
