"""Commands about learning: build and show the data, train, evaluate."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import tyro

from ..toolkit.cli import terminal
from ..toolkit.options import Common, FeatureOptions, Flat, Output

if TYPE_CHECKING:
    from rich.table import Table


# What a terminal shows of their documents.


def _scores(rows: Sequence[Mapping[str, Any]]) -> Table:
    """A table of the columns of one word or number a row; those without any are left out."""
    plain = (str, int, float, type(None))
    columns = {name: [row[name] for row in rows] for name in rows[0]}
    return terminal.table(
        rows,
        {
            name: name.replace("_", " ")
            for name, cells in columns.items()
            if all(isinstance(cell, plain) for cell in cells) and any(c is not None for c in cells)
        },
    )


def _dataset(document: terminal.Document) -> terminal.Shown:
    """What was built."""
    yield f"{document['clauses']:,} clauses, {document['real_objects']:,} real objects"


def _samples(document: terminal.Document) -> terminal.Shown:
    """What was drawn of a data set."""
    for sample in document["samples"]:
        yield f"{sample['object']}: {'; '.join(sample['clauses'])}"


def _audit(document: terminal.Document) -> terminal.Shown:
    """Outcomes, reasons and biases of an audit of ranges."""
    for key in ("shares", "reasons", "biases"):
        if document[key]:
            yield _scores(document[key])


def _training(document: terminal.Document) -> terminal.Shown:
    """How long it took."""
    yield f"trained for {document['steps']:,} steps"


def _evaluation(document: terminal.Document) -> terminal.Shown:
    """A row a predictor; of natural sentences also how often what was said to be sure was right."""
    if "calibration" not in document:
        yield _scores(document["rows"])
        return
    yield terminal.table(
        document["rows"], {name: name.replace("_", " ") for name in document["rows"][0]}
    )
    said = {"said": "said to be right", "right": "was right", "objects": "objects"}
    yield terminal.table(document["calibration"], said)
    from ..toolkit.verdict.checks import percent

    yield (
        f"{percent(document['clauses_read'])} of the materials were read, "
        f"{percent(document['foreign'])} of the volume got one of no clause, "
        f"{document['left_whole']} things were left whole"
    )


@dataclass(frozen=True)
class DatasetCommand:
    """Build the training data, draw samples of it, or audit its ranges by simulation.

    Examples: autophyx-tet dataset build -o data; autophyx-tet dataset ranges -o data;
    autophyx-tet dataset regions -o data;
    autophyx-tet dataset show -o samples.png; autophyx-tet dataset audit -o audit
    """

    action: tyro.conf.Positional[Literal["build", "ranges", "regions", "show", "audit"]]
    """Clauses and objects, names with their ranges (for unipixie), a picture, or ranges simulated
    at both ends."""
    output: Output
    """Folder of the data or of the audit's logs, or .png of six samples (show)."""
    objects: int = 100
    """audit: how many objects."""
    actor: str | None = None
    """audit: http://HOST/v1#MODEL of a language model that proposes ranges; else the table does."""
    linear: tyro.conf.FlagCreatePairsOff[bool] = False
    """audit: linear elements instead of particles, a forecast in a hundredth of the time."""
    resume: tyro.conf.FlagCreatePairsOff[bool] = False
    """audit: go on with the proposals that were edited in the logs of the folder."""
    per_part: int = 300
    """Clauses for every kind of part; the shipped network heard 3,600."""
    device: str = "cpu"
    """Where clauses are embedded: cpu or cuda."""
    encoder: str | None = None
    """build: image encoder that looks at the furniture of training, its features go along (hours);
    audit: by which a critic checks that pictures show the parts."""
    no_real: tyro.conf.FlagCreatePairsOff[bool] = False
    """Leave real furniture out: nothing is downloaded."""
    seed: int = 0
    """Seed of everything random."""
    common: Flat[Common] = field(default_factory=Common)

    @property
    def shown(self) -> Callable[[terminal.Document], terminal.Shown]:
        """What a terminal shows of the document."""
        shown = {"build": _dataset, "show": _samples, "audit": _audit}
        return shown.get(self.action, terminal.nothing)

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from .prepare import build_dataset, build_ranges, build_regions, show_dataset

        if self.action == "regions":
            with terminal.progress(quiet=self.common.quiet) as tell:
                return build_regions(self.output, seed=self.seed, progress=tell)
        if self.action == "ranges":
            return build_ranges(self.output, seed=self.seed, device=self.device)
        if self.action == "show":
            return show_dataset(self.output, seed=self.seed)
        if self.action == "audit":
            return self._audit()
        folder = FeatureOptions().memory
        return build_dataset(
            self.output,
            per_part=self.per_part,
            seed=self.seed,
            device=self.device,
            real=not self.no_real,
            encoder=self.encoder,
            memory=folder and folder / "evaluation",
        )

    def _audit(self) -> dict[str, Any]:
        from .prepare import audit_ranges

        with terminal.progress(quiet=self.common.quiet) as tell:
            return audit_ranges(
                self.output,
                objects=self.objects,
                seed=self.seed,
                actor=self.actor,
                encoder=self.encoder,
                linear=self.linear,
                resume=self.resume,
                progress=tell,
            )


@dataclass(frozen=True)
class TrainCommand:
    """Train the voxel network; the same command goes on where it was interrupted.

    Examples: autophyx-tet train cpu --data data -o run;
    autophyx-tet train unipixie-cpu --data data -o run
    """

    config: tyro.conf.Positional[str]
    """TOML file of a training run of FiLM, or a preset: regions (things in one piece); cpu,
    unipixie-cpu and regions-cpu take a minute; kinds, of matter by looks, seconds; tagger, of
    words by parts, nine minutes of a GPU; one-piece, of parts by words, two."""
    output: Output
    """Folder of the state and of the weights."""
    data: Path = Path("data")
    """Folder that `dataset build` wrote."""
    start: Path | None = None
    """Weights to begin with."""
    common: Flat[Common] = field(default_factory=Common)

    shown = staticmethod(_training)

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from .learning import train

        return train(self.config, data=self.data, output=self.output, start=self.start)


@dataclass(frozen=True)
class EvaluateCommand:
    """Score predictors on objects, wordings and pairs that training never saw.

    Examples: autophyx-tet evaluate --split procedural --objects 16 --json;
    autophyx-tet evaluate --split validation --encoder embedded --renders 16
    """

    split: str = "procedural"
    """natural (sentences on things in one piece), validation, merged, procedural, or a folder."""
    predictors: tuple[str, ...] = ()
    """Rows of the table: film, film-names, film-nofeatures, unipixie, constant, table-mean ..."""
    data: Path | None = None
    """Folder that `dataset build` wrote; without it the validation objects are fetched."""
    weights: Path | None = None
    """Weights of the network; the shipped ones by default."""
    objects: int = 64
    """How many objects."""
    cells: int = 64
    """Cells along the longest side."""
    seed: int = 0
    """Seed of the objects and of what is said of them."""
    texts: int = 1
    """How often something is said of each object; its score is the mean."""
    encoder: str | None = None
    """Encoder of images that looks at the furniture first: embedded, or openclip."""
    table: Literal["S3", "S5", "S6", "S7", "theta", "springs"] | None = None
    """Instead: a table of UniPixie, or of its heads for skinning and springs, from --data."""
    minutes: float | None = None
    """Time of training of each row of --table that is trained; by default the preset's steps."""
    device: str = "cpu"
    """Where they are trained: cpu (tiny networks, coarse bodies) or cuda."""
    renders: int = 0
    """Objects that are put under load too: how alike they look to the true ones, PSNR and SSIM."""
    swing: tyro.conf.FlagCreatePairsOff[bool] = False
    """Of these, compare 8 frames of the motion that the load starts, not the rest under it."""
    cache: Path | None = None
    """Folder that remembers what the encoder saw; by default the user's cache folder."""
    no_cache: tyro.conf.FlagCreatePairsOff[bool] = False
    """Look again and remember nothing."""
    common: Flat[Common] = field(default_factory=Common)

    shown = staticmethod(_evaluation)

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from .learning import evaluate, evaluate_table

        if self.table:
            with terminal.progress(quiet=self.common.quiet) as tell:
                return evaluate_table(
                    self.table,
                    data=self.data or Path("data"),
                    weights=self.weights,
                    minutes=self.minutes,
                    device=self.device,
                    objects=self.objects,
                    progress=tell,
                )
        folder = FeatureOptions(cache=self.cache, no_cache=self.no_cache).memory
        with terminal.progress(quiet=self.common.quiet) as tell:
            return evaluate(
                self.split,
                predictors=self.predictors,
                data=self.data,
                weights=self.weights,
                objects=self.objects,
                cells=self.cells,
                seed=self.seed,
                texts=self.texts,
                encoder=self.encoder,
                renders=self.renders,
                swing=self.swing,
                memory=folder and folder / "evaluation",
                progress=tell,
            )
