"""Make the corpus of the image encoder, and train the network on it.

    python benchmarks/train_image_encoder.py corpus training.safetensors --sources training
    python benchmarks/train_image_encoder.py train training.safetensors --out weights.safetensors
        [--state state.safetensors] [--seconds 540] [--device cuda]

Training stops after ``--seconds`` with its state saved, and goes on from there when called again:
exactly, on the same machine. The backbone starts from the packaged EfficientNet-Lite0; the one in
use is half way between start and end (``--share``), and only that change of it is written.
"""

import argparse
import logging
import tempfile
from pathlib import Path

from autophyx_tet.fem.errors import AutophyxError
from autophyx_tet.predictors.encoders.corpus import Specimen, read_corpus, write_corpus
from autophyx_tet.predictors.encoders.embedded import public_start
from autophyx_tet.predictors.encoders.minilm import MiniLM
from autophyx_tet.predictors.encoders.training import (
    TrainingOptions,
    load_state,
    new_state,
    save_state,
    shipped_weights,
    train,
)
from autophyx_tet.toolkit.load import load_asset
from autophyx_tet.toolkit.sweethome3d import TRAINING, VALIDATION, catalog, extract

log = logging.getLogger("train_image_encoder")


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


def run_training(options):
    from safetensors.torch import save_file

    corpus = read_corpus(options.path, device=options.device)
    settings = TrainingOptions(steps=options.steps, batch=options.batch, side=options.side)
    start = public_start(options.device)
    if options.state and options.state.exists():
        state = load_state(options.state, options.device)
    else:
        state = new_state(settings, options.device, start)
    state = train(corpus, settings, state, seconds=options.seconds)
    if options.state:
        save_state(state, options.state)
    weights = shipped_weights(state, start, share=options.share)
    save_file({key: value.cpu() for key, value in weights.items()}, options.out)
    log.info("step %d of %d", state.step, settings.steps)


def main():
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(message)s")
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(required=True)
    corpus = commands.add_parser("corpus")
    corpus.add_argument("path", type=Path)
    corpus.add_argument("--sources", choices=["training", "validation"], default="training")
    corpus.add_argument("--limit", type=int, help="objects of each source")
    corpus.set_defaults(run=make_corpus)
    training = commands.add_parser("train")
    training.add_argument("path", type=Path)
    training.add_argument("--out", type=Path, required=True)
    training.add_argument("--state", type=Path)
    training.add_argument("--steps", type=int, default=1500)
    training.add_argument("--batch", type=int, default=TrainingOptions.batch)
    training.add_argument("--side", type=int, default=TrainingOptions.side)
    training.add_argument("--share", type=float, default=0.5)
    training.add_argument("--seconds", type=float, default=float("inf"))
    training.add_argument("--device", default="cpu")
    training.set_defaults(run=run_training)
    options = parser.parse_args()
    options.run(options)


if __name__ == "__main__":
    main()
