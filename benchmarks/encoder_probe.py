"""How well a linear classifier reads materials off the features of an image encoder.

    python benchmarks/encoder_probe.py --json

The protocol: sweethome3d objects, two views each, 300 x 300; a region is the pixels of one material
slot in one view, at least 200 of them; its feature is the mean; standardised, 48 principal
components, balanced logistic regression over metal, plastic, glass, wood and fabric (by the slot's
name); fitted on Scopia and BlendSwap-CC-0, scored on KatorLegaz; balanced accuracy with a 95 %
bootstrap over objects. Rows: the mean and standard deviation of RGB, and of RGB and opacity, which
the encoders see too; every encoder asked for; the same with the colours of an object's slots
swapped among them (fitted on normal ones); classes guessed by the nearest of the five words,
without a classifier; and retrieval: the share of regions whose own slot name is nearer than one
drawn at random from another kind (chance .5).
"""

import argparse
import hashlib
import json
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from autophyx_tet.fem.errors import AutophyxError
from autophyx_tet.predictors.appearance.views import Views, hemisphere, render_views
from autophyx_tet.predictors.encoders import load_encoder
from autophyx_tet.predictors.text.parts import bare_words, kind_of
from autophyx_tet.research.datasets.sweethome3d import (
    SOURCES,
    TRAINING,
    VALIDATION,
    catalog,
    extract,
)
from autophyx_tet.toolkit.asset.load import load_asset
from probe import Regions, fit_probe, score

KINDS = ("metal", "plastic", "glass", "wood", "fabric")
PIXELS, VIEWS, SMALLEST = 300, 2, 200
SPREAD = 5  # cameras of the hemisphere of which the views are two: 17 and 30 degrees high
CHOSEN = (1, 2)
THINGS = 10_000  # more than a source has: numbers of its objects start at a multiple


class Picture(NamedTuple):
    """One view: RGBA pixels, the same recoloured, the slot of every pixel, the object's number."""

    image: np.ndarray
    swapped: np.ndarray
    slot: np.ndarray
    names: tuple[str, ...]
    thing: int


def pictures(source, limit):
    """Render every object of a source."""
    for thing, item in enumerate(catalog(source)[:limit], start=THINGS * SOURCES.index(source)):
        with tempfile.TemporaryDirectory() as folder:
            try:
                asset = load_asset(extract(item, Path(folder)), units="cm")
            except AutophyxError:
                continue
        cameras = hemisphere(asset.bounds, count=SPREAD, up=asset.up, pixels=PIXELS)
        views = render_views(asset, [cameras[i] for i in CHOSEN])
        if not any(kind_of(name) in KINDS for name in views.slot_names):
            continue
        images, swapped = views.images(), recoloured(views, thing).images()
        for view in range(VIEWS):
            yield Picture(
                _bytes(images[view]),
                _bytes(swapped[view]),
                views.slot[view].astype(np.int16),
                views.slot_names,
                thing,
            )


def _bytes(image):
    return (image * 255).round().astype(np.uint8)


def recoloured(views, seed):
    """The same views with the mean colours of the slots drawn from one another."""
    rng = np.random.default_rng(seed)
    count = len(views.slot_names)
    means = np.array(
        [
            views.colour[views.slot == slot].mean(axis=0)
            if (views.slot == slot).any()
            else [0.5] * 3
            for slot in range(count)
        ]
    )
    # An object with one slot gets a colour drawn at random.
    wanted = means[np.roll(rng.permutation(count), 1)] if count > 1 else rng.random((1, 3))
    gain = np.concatenate([wanted / np.maximum(means, 0.05), np.ones((1, 3))])
    colour = np.clip(views.colour * gain[views.slot], 0, 1).astype(np.float32)
    fields = {name: getattr(views, name) for name in Views.__dataclass_fields__}
    return Views(**(fields | {"colour": colour}))


def regions(shown, features_of, *, swapped=False):
    """Mean feature of every region, and the regions' slot names."""
    rows, names = [], []
    for picture in shown:
        image = (picture.swapped if swapped else picture.image).astype(np.float32) / 255
        slots = [
            slot
            for slot in np.unique(picture.slot[picture.slot >= 0])
            if kind_of(picture.names[slot]) in KINDS and (picture.slot == slot).sum() >= SMALLEST
        ]
        if not slots:
            continue
        means = features_of(image, picture.slot, slots)
        for slot, mean in zip(slots, means, strict=True):
            rows.append((mean, KINDS.index(kind_of(picture.names[slot])), picture.thing))
            names.append(" ".join(bare_words(picture.names[slot])))
    return Regions(*map(np.array, zip(*rows, strict=True))), names


def pixel_features(channels):
    """A function that gives the mean and standard deviation of a slot's first channels."""

    def features(image, slot_of, slots):
        shown = [image[slot_of == slot][:, :channels] for slot in slots]
        return [np.concatenate([pixels.mean(axis=0), pixels.std(axis=0)]) for pixels in shown]

    return features


def encoder_features(encoder):
    """A function like that of ``pixel_features`` for the dense features of an encoder."""

    def features(image, slot_of, slots):
        dense = encoder.dense(image[None])[0]
        rows, columns = dense.shape[:2]
        at = ((np.arange(PIXELS) + 0.5) * rows / PIXELS).astype(int)
        across = ((np.arange(PIXELS) + 0.5) * columns / PIXELS).astype(int)
        cell = (at[:, None] * columns + across[None]).ravel()
        flat = dense.reshape(rows * columns, -1)
        means = []
        for slot in slots:
            count = np.bincount(cell[(slot_of == slot).ravel()], minlength=rows * columns)
            means.append(count.astype(np.float32) @ flat / count.sum())
        return means

    return features


def retrieval(encoder, found, names, rng):
    """Share of regions nearer to their own slot's name than to one of another kind, per region."""
    embedding = encoder.text(names)
    similarity = found.features @ embedding.T
    other = found.label[:, None] != found.label[None]
    wins = []
    for row in range(len(names)):
        rivals = rng.choice(np.flatnonzero(other[row]), size=50)
        wins.append((similarity[row, row] > similarity[row, rivals]).mean())
    things = np.unique(found.thing)
    wins = np.array(wins)
    groups = [wins[found.thing == thing] for thing in things]
    samples = [
        np.concatenate([groups[i] for i in rng.integers(len(groups), size=len(groups))]).mean()
        for _ in range(1000)
    ]
    return wins.mean(), *np.percentile(samples, [2.5, 97.5]), len(wins)


def row(name, figures):
    accuracy, low, high, count = figures
    return {
        "features": name,
        "accuracy": round(float(accuracy), 3),
        "low": round(float(low), 3),
        "high": round(float(high), 3),
        "regions": int(count),
    }


def rows_of(name, fit, shown, features_of, encoder=None):
    """All rows of one encoder."""
    probe = fit_probe(regions(fit, features_of)[0])
    found, names = regions(shown, features_of)
    swapped, _ = regions(shown, features_of, swapped=True)

    def scored(guess, of):
        return score(guess, of, rng=np.random.default_rng(0))

    yield row(name, scored(probe.predict(found.features), found))
    yield row(f"{name}, colours swapped", scored(probe.predict(swapped.features), swapped))
    if encoder is not None and hasattr(encoder, "text"):
        words = encoder.text(KINDS)
        guess = (found.features @ words.T).argmax(axis=1)
        yield row(f"{name}, nearest word", scored(guess, found))
        yield row(f"{name}, retrieval", retrieval(encoder, found, names, np.random.default_rng(0)))


def rendered(sources, limit, cache):
    """Pictures of some sources."""
    return [picture for source in sources for picture in rendered_source(source, limit, cache)]


def rendered_source(source, limit, cache):
    """Pictures of a source, kept in a file if a folder is named."""
    key = hashlib.sha256(f"{source} {limit} {CHOSEN} rgba".encode()).hexdigest()[:12]
    path = cache and Path(cache) / f"probe-{key}.npz"
    if path and path.exists():
        with np.load(path, allow_pickle=False) as data:  # noqa: TID251
            names = [tuple(line.split("\n")) for line in data["names"]]
            columns = (data["image"], data["swapped"], data["slot"], names, data["thing"])
            return [Picture(*fields) for fields in zip(*columns, strict=True)]
    shown = list(pictures(source, limit))
    if path:
        path.parent.mkdir(parents=True, exist_ok=True)
        columns = {
            f: np.stack([getattr(p, f) for p in shown]) for f in ("image", "swapped", "slot")
        }
        names = np.array(["\n".join(p.names) for p in shown])
        np.savez_compressed(path, names=names, thing=np.array([p.thing for p in shown]), **columns)
    return shown


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--encoders", default="embedded", help="comma-separated names")
    parser.add_argument("--limit", type=int, help="objects of each source")
    parser.add_argument("--cache", help="folder that keeps the rendered pictures")
    parser.add_argument("--render-only", action="store_true")
    options = parser.parse_args()
    fit = rendered(TRAINING, options.limit, options.cache)
    shown = rendered(VALIDATION, options.limit, options.cache)
    if options.render_only:
        return
    rows = list(rows_of("rgb mean and deviation", fit, shown, pixel_features(3)))
    rows += rows_of("rgb and opacity, mean and deviation", fit, shown, pixel_features(4))
    for name in options.encoders.split(","):
        encoder = load_encoder(name)
        rows += rows_of(name, fit, shown, encoder_features(encoder), encoder)
    if options.json:
        print(json.dumps(rows, indent=1))
    else:
        for line in rows:
            print("  ".join(f"{key} {value}" for key, value in line.items()))


if __name__ == "__main__":
    main()
