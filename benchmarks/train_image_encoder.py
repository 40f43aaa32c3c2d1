"""Make the corpus of the image encoder, choose how its head is fitted, and fit it.

    python benchmarks/train_image_encoder.py corpus CORPUS.safetensors --sources training
    python benchmarks/train_image_encoder.py describe CORPUS.safetensors --out REGIONS.npz
    python benchmarks/train_image_encoder.py choose CORPUS.safetensors REGIONS.npz
    python benchmarks/train_image_encoder.py fit CORPUS.safetensors REGIONS.npz --out HEAD

``describe`` runs the frozen network over every picture (minutes on a CPU, seconds with ``--device
cuda``); ``choose`` compares penalties, gains, ranks and numbers of directions by cross-validation
inside the corpus: the head and a probe of five kinds are fitted on some objects and scored on
others, those of one source ("source NAME") or a quarter of all ("objects"); each with the probe's
balanced accuracy and the retrieval: the share of pairs of a region and one of another kind in which
the region's own material name is nearer. ``fit`` writes the head of the defaults.
"""

import argparse
import json
import logging
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from autophyx_tet.converters.npz import load_npz, save_npz
from autophyx_tet.fem.errors import AutophyxError
from autophyx_tet.predictors.encoders.minilm import MiniLM
from autophyx_tet.predictors.encoders.plain import COLOURS, Widths, public_backbone
from autophyx_tet.predictors.text.parts import KINDS
from autophyx_tet.research.datasets.sweethome3d import TRAINING, VALIDATION, catalog, extract
from autophyx_tet.research.training.encoder.corpus import Specimen, read_corpus, write_corpus
from autophyx_tet.research.training.encoder.head import (
    HeadOptions,
    RegionFeatures,
    fit_head,
    region_features,
    shipped_weights,
)
from autophyx_tet.toolkit.asset.load import load_asset
from probe import Regions, balanced, fit_probe

log = logging.getLogger("train_image_encoder")
PROBED = ("metal", "plastic", "glass", "wood", "fabric")
FOLDS = 4
TRIED = {
    "penalty": (3.0, 30.0),
    "gain": (8.0, 30.0),
    "rank": (6, 8, 12, 16),
    "directions": (0, 4, 12),
    "plain": (0.25, 1.0),
}


class Words(MiniLM):
    """MiniLM with its vocabulary: a name's word counts if it is whole there."""

    def knows(self, word):
        """Whether a word is whole in the vocabulary."""
        return len(word) > 2 and self._tokenizer.token_to_id(word) is not None


def specimens(sources, limit):
    for source in sources:
        for item in catalog(source)[:limit]:
            with tempfile.TemporaryDirectory() as folder:
                try:
                    asset = load_asset(extract(item, Path(folder)), units="cm")
                except AutophyxError as error:
                    log.warning("left out: %s", error)
                    continue
                yield Specimen(asset, item.name, source)


def make_corpus(options):
    sources = TRAINING if options.sources == "training" else VALIDATION
    count = write_corpus(options.path, specimens(sources, options.limit), text_encoder=Words())
    log.info("%d objects, %.1f MB", count, options.path.stat().st_size / 1e6)


def describe_regions(options):
    corpus = read_corpus(options.path, device=options.device)
    settings = HeadOptions(side=options.side, rounds=options.rounds)
    found = region_features(corpus, public_backbone(options.device), settings)
    save_npz(options.out, features=found.features.astype(np.float16), part=found.part)


def regions_of(path):
    arrays = load_npz(path)
    return RegionFeatures(arrays["features"].astype(np.float32), arrays["part"])


def choose(options):
    corpus, regions = read_corpus(options.path), regions_of(options.regions)
    rows = [cross_validated("colour and opacity alone", corpus, regions, None)]
    rows.append(cross_validated("as shipped", corpus, regions, HeadOptions()))
    for field, values in TRIED.items():
        for value in values:
            settings = replace(HeadOptions(), **{field: value})
            rows.append(cross_validated(f"{field} {value:g}", corpus, regions, settings))
            log.info("%s", rows[-1])
    print(json.dumps(rows, indent=1))


def cross_validated(name, corpus, regions, settings):
    """Accuracy, and retrieval, on sources and objects that neither head nor probe has seen."""
    words = corpus.words[regions.part, 0].cpu().numpy()
    label = np.array([PROBED.index(k) if k in PROBED else -1 for k in (*KINDS, "")])[words]
    thing = corpus.object_of[regions.part].cpu().numpy()
    source = np.array(corpus.sources)[thing]
    fold = np.random.default_rng(0).permutation(len(corpus.sources))[thing] % FOLDS
    rows = {f"source {name}": source == name for name in dict.fromkeys(corpus.sources)}
    scores = {key: [held_out(corpus, regions, settings, label, held)] for key, held in rows.items()}
    held = [held_out(corpus, regions, settings, label, fold == k) for k in range(FOLDS)]
    scores["objects"] = held
    means = {key: np.mean(v, axis=0).round(3).tolist() for key, v in scores.items()}
    return {"features": name} | means


def held_out(corpus, regions, settings, label, held):
    if settings is None:
        features = regions.features[:, :COLOURS]
    else:
        features = fit_head(regions, corpus, Widths().groups, settings, use=~held)(regions.features)
    known, held_known = (label >= 0) & ~held, (label >= 0) & held
    probe = fit_probe(Regions(features[known], label[known], regions.part[known]))
    accuracy = balanced(probe.predict(features[held_known]), label[held_known])
    if settings is None:
        return (accuracy,)
    text = corpus.words[regions.part[held_known], 1].cpu().numpy()
    return accuracy, retrieval(features[held_known], label[held_known], text, corpus)


def retrieval(features, label, text, corpus):
    """Share of pairs of different kinds in which a region is nearer to its own material's name."""
    features, label, text = (column[text >= 0] for column in (features, label, text))
    similarity = features @ corpus.embeddings.cpu().numpy()[text].T
    other = label[:, None] != label[None]
    return (np.diag(similarity)[:, None] > similarity)[other].mean()


def write_head(options):
    from safetensors.torch import save_file

    corpus, regions = read_corpus(options.path), regions_of(options.regions)
    head = fit_head(regions, corpus, Widths().groups, HeadOptions())
    save_file(shipped_weights(head, Widths()), options.out)


def main():
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(message)s")
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(required=True)
    corpus = commands.add_parser("corpus")
    corpus.add_argument("path", type=Path)
    corpus.add_argument("--sources", choices=["training", "validation"], default="training")
    corpus.add_argument("--limit", type=int, help="objects of each source")
    corpus.set_defaults(run=make_corpus)
    describing = commands.add_parser("describe")
    describing.add_argument("path", type=Path)
    describing.add_argument("--out", type=Path, required=True)
    describing.add_argument("--side", type=int, default=HeadOptions.side)
    describing.add_argument("--rounds", type=int, default=HeadOptions.rounds)
    describing.add_argument("--device", default="cpu")
    describing.set_defaults(run=describe_regions)
    for name, run in (("choose", choose), ("fit", write_head)):
        command = commands.add_parser(name)
        command.add_argument("path", type=Path)
        command.add_argument("regions", type=Path)
        command.set_defaults(run=run)
    commands.choices["fit"].add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    options.run(options)


if __name__ == "__main__":
    main()
