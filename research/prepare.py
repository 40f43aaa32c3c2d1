"""What predictors learn from: `dataset build`, `dataset ranges`, `show` and `audit`."""

from __future__ import annotations

import json
import logging
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..fem.errors import AutophyxError
from ..predictors.encoders import speaking_encoder
from ..toolkit.asset.child import Progress
from ..toolkit.asset.document import check_file, check_folder
from .datasets import sweethome3d
from .datasets.real import CELLS, RealObject, save_real, voxelise

if TYPE_CHECKING:
    from ..predictors.asset import Asset
    from ..predictors.encoders import Encoder

log = logging.getLogger(__name__)

TEXT, TRAINING, VALIDATION = "text.safetensors", "real.safetensors", "validation.safetensors"
RANGES = "ranges.safetensors"
REGIONS = "regions.npz"
ANEW = 7  # sentences that are put together anew of each real thing
_SHOWN_CELLS = 48


def build_dataset(
    output: Path,
    *,
    per_part: int = 300,
    seed: int = 0,
    device: str = "cpu",
    real: bool = True,
    encoder: str | None = None,
    memory: Path | None = None,
) -> dict[str, Any]:
    """Write the clauses of training, and real objects for training and for validation.

    Parameters
    ----------
    output
        Folder to write into.
    per_part
        Clauses written for every kind of part; the shipped network heard 3,600.
    device
        Where sentences are embedded: "cpu", or "cuda" for a corpus of many thousands.
    real
        Whether to voxelise the furniture of Debian's sweethome3d-furniture too.
    encoder, memory
        Image encoder that looks at the furniture of training, and the folder of what it saw before.
    """
    from .datasets.text_table import save_text_table
    from .training.film.presets import device_text_table

    check_folder(output)
    output.mkdir(parents=True, exist_ok=True)
    pieces = furniture(sweethome3d.TRAINING) if real else ()
    sees = speaking_encoder(encoder) if encoder else None
    training = [_looked_at(voxels, asset, sees, memory) for voxels, asset in pieces]
    files = []
    if real:
        validation = [voxels for voxels, _ in furniture(sweethome3d.VALIDATION)]
        for name, objects in ((TRAINING, training), (VALIDATION, validation)):
            save_real(output / name, objects)
            files.append(output / name)
    table = device_text_table(per_part=per_part, seed=seed, device=device, real=training)
    save_text_table(output / TEXT, table)
    return {
        "files": [*files, output / TEXT],
        "clauses": len(table.texts),
        "real_objects": len(training),
    }


def build_ranges(output: Path, *, seed: int = 0, device: str = "cpu") -> dict[str, Any]:
    """Write the names of things and the ranges of what they may be made of: for ``unipixie``."""
    from .datasets.ranges import build_range_table
    from .on_device import minilm

    check_folder(output)
    output.mkdir(parents=True, exist_ok=True)
    table = build_range_table(minilm(device).text, seed=seed)
    table.save(output / RANGES)
    return {"files": [output / RANGES], "names": len(table.kind), "rows": len(table.low)}


def build_regions(
    output: Path,
    *,
    objects: int | None = None,
    variants: int = 8,
    procedural: int = 260,
    seed: int = 0,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Write what the region network learns from: things in one piece, and what is said of them.

    Parameters
    ----------
    output
        Folder to write into.
    objects
        How many real objects; all whose parts are known by default.
    variants, procedural
        How often each is recoloured, half of them shortened, and how many objects are made up.
    seed
        Seed of everything random.
    progress
        Called with the object and the seconds so far.
    """
    from ..fem.table import load_table
    from ..predictors.regions.network import kind_index
    from .datasets import region_sets as sets_of
    from .datasets.natural import PARTS, Natural, as_heard, naturals, one_pieces
    from .datasets.parts import part_kinds
    from .on_device import minilm

    check_folder(output)
    output.mkdir(parents=True, exist_ok=True)
    rng, table, began = np.random.default_rng(seed), load_table(), time.monotonic()
    hands, parts = naturals(sweethome3d.TRAINING), naturals(sweethome3d.TRAINING, PARTS)
    pieces = dict(one_pieces([*hands, *parts], objects))

    def meant(name: str, each: Sequence[Natural]) -> list[sets_of.Sentence]:
        return [
            sets_of.Sentence(one.clauses, one.unsaid, anew=True) for one in each if one.key == name
        ]

    # As the product hears the hands, and as they meant it
    said = {name: meant(name, hands) for name in pieces}
    for one in hands:
        clauses = as_heard(one, table) if one.key in said else ()
        if len(clauses) > 1:
            said[one.key].append(sets_of.Sentence(clauses, one.unsaid))
    for one in parts:
        if one.key in said:
            anew = sets_of.said_anew(meant(one.key, [*hands, *parts]), one.clauses, ANEW, rng)
            said[one.key] += anew
    looks, sets = sets_of.looks_of(pieces.values()), []
    for name, piece in pieces.items():
        if progress:
            progress(f"{name}, {piece.name}", time.monotonic() - began)
        sets += [(one, False) for one in sets_of.every_set(name, piece)]
        worn = sets_of.in_baked_light(piece, rng)
        for near in sets_of.NEARS[False]:
            sets.append((sets_of.region_set(name, worn, shells=False, near=near), True))
        for _ in range(variants):
            shown = sets_of.shorter(piece, rng) if rng.random() < 0.5 else piece
            shown, kinds = sets_of.recoloured(shown, looks, rng)
            sets += [(one, True) for one in sets_of.two_sets(name, shown, rng, kinds)]
    rows = {row.name for kind in part_kinds().values() for row in kind.materials}
    kind_of_row = {row: kind_index(row, row, table) for row in rows}
    for number, made in enumerate(sets_of.procedural(procedural, looks, kind_of_row, rng)):
        name = f"procedural {number}"
        sets += [(one, False) for one in sets_of.two_sets(name, made.piece, rng)]
        said[name] = [sets_of.spoken_of(made, rng) for _ in range(3)]
    corpus = sets_of.as_corpus(sets, said, pieces, minilm("cpu"), table)
    corpus.save(output / REGIONS)
    return {
        "files": [output / REGIONS], "sets": len(corpus.thing), "sentences": len(corpus.of),
        "real_objects": len(pieces),
    }  # fmt: skip


def furniture(sources: Sequence[sweethome3d.Source]) -> Iterator[tuple[RealObject, Asset]]:
    """Voxelise the objects that have a slot of known material; others are counted."""
    from ..toolkit.asset.load import load_asset

    for source in sources:
        items, kept = sweethome3d.catalog(source), 0
        for item in items:
            with tempfile.TemporaryDirectory() as folder:
                try:
                    asset = load_asset(sweethome3d.extract(item, Path(folder)))
                    found = voxelise(asset, item.name, source)
                except AutophyxError as error:
                    log.warning("%s left out: %s", item.key, error)
                    continue
            if any(found.materials()):
                kept += 1
                yield found, asset
        log.info("%s: %d of %d objects have a known material", source, kept, len(items))


def _looked_at(
    voxels: RealObject, asset: Asset, encoder: Encoder | None, memory: Path | None
) -> RealObject:
    """Return the object with what an encoder, if any, sees of its slots."""
    from .image_features import cached_image_features, slot_features

    if encoder is None:
        return voxels
    seen = cached_image_features(asset, voxels, encoder, cells=CELLS, memory=memory)
    return voxels if seen is None else replace(voxels, features=slot_features(seen, voxels))


def show_dataset(output: Path, *, count: int = 6, seed: int = 0) -> dict[str, Any]:
    """Draw procedural objects, each part in a colour of its own; return what was said of them."""
    from .datasets.grammar import Grammar
    from .datasets.objects import category_names, make_objects
    from .datasets.parts import spoken
    from .training.stores import procedural_store

    check_file(output, (".png",))
    rng = np.random.default_rng(seed)
    objects = make_objects(count, rng)
    store = procedural_store(objects, cells=_SHOWN_CELLS, device="cpu")
    grammar, names = Grammar(rng), category_names()
    samples = []
    for kinds, category in zip(objects.kinds, objects.category, strict=True):
        said = [grammar.part(int(kind)).text for kind in kinds if kind >= 0]
        sample: dict[str, Any] = {"object": spoken(names[category]), "clauses": said}
        samples.append(sample)
    _draw(output, store.label.numpy(), [sample["object"] for sample in samples])
    return {"files": [output], "samples": samples}


def _draw(output: Path, labels: np.ndarray, titles: Sequence[str]) -> None:
    from ..predictors.grid import Grid
    from ..toolkit.report.picture import ColouredSurface, Panel, render_png, voxel_shell
    from .datasets.shapes import EMPTY, MAX_PARTS

    hues = np.random.default_rng(3).uniform(0.25, 0.95, (MAX_PARTS, 3))
    panels = []
    for label, title in zip(labels, titles, strict=True):
        shell = voxel_shell(label != EMPTY, Grid(np.zeros(3), 1 / _SHOWN_CELLS, label.shape))
        colours = hues[label[tuple(shell.cell.T)]]
        corners = np.repeat(colours[:, None], 3, axis=1)
        panels.append(Panel((ColouredSurface(shell.points, shell.faces, corners),), title))
    render_png(output, panels)


def audit_ranges(
    output: Path,
    *,
    objects: int = 100,
    seed: int = 0,
    actor: str | None = None,
    encoder: str | None = None,
    linear: bool = False,
    resume: bool = False,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Audit the ranges of objects, or go on with what a person edited in ``output``.

    Parameters
    ----------
    output
        Folder of the logs, one an object, of the table and of the queue for review.
    objects, seed
        How many, drawn how.
    actor
        ``http://HOST/v1#MODEL`` of a language model that proposes; None: the table does.
    encoder
        Image encoder by which a critic looks at the objects; None: nobody does.
    linear
        Whether the ends are those of linear elements instead of particles: a forecast.
    resume
        Whether to go on with the logs that are there instead of drawing objects.
    progress
        Called with the stage and the seconds so far.
    """
    from ..predictors.text.interpreter import ChatEndpoint
    from .datasets.audit import auditing
    from .datasets.audit.actor import propose_by_table
    from .datasets.audit.critic import critic_of
    from .datasets.audit.endpoint import EndpointActor

    check_folder(output)
    output.mkdir(parents=True, exist_ok=True)
    began = time.monotonic()

    def tell(stage: str) -> None:
        if progress is not None:
            progress(stage, time.monotonic() - began)

    if resume:
        logs = auditing.resume(output, tell=tell)
    else:
        proposer = EndpointActor(ChatEndpoint.at(actor)) if actor else propose_by_table
        logs = auditing.audit(
            output, objects=objects, seed=seed, actor=proposer, actor_name=actor or "table",
            critic=critic_of(speaking_encoder(encoder)) if encoder else None, linear=linear,
            tell=tell,
        )  # fmt: skip
    document = auditing.audit_document(logs)
    table = output / "audit.json"
    table.write_text(json.dumps(document, indent=1) + "\n")
    return {"files": [table, output / auditing.QUEUE, output], **document}
