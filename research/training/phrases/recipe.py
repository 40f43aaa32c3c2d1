"""Training of the phrase network: its data, its loss and its weights' file.

Phrases are the names and aliases of the table's rows, nouns of three languages, designations made
from the patterns of ``predictors/text/data/designations.toml``, and words of matter of the texts
that the tagger learns from (``data/phrases.tsv``): where the reader read them without a doubt its
row, else one given by hand. Other words of these texts mean no row. Twelve hands wrote phrases
with the bands of E and density that experts would accept (``data/bands.txt``): of these every row
in the band is right.
"""

from __future__ import annotations

import importlib
import json
import math
import random
import re
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from ....fem.table import MaterialTable, load_table
from ....predictors.packed import packed
from ....predictors.text.english import DATA as TEXT
from ....predictors.text.phrases import BUCKETS, SENSE, features, values_of
from ...on_device import minilm
from ..tagger.generator import LANGUAGES
from ..tagger.templates import load_templates

DATA = Path(__file__).parent / "data"
WIDTH, HIDDEN = 96, 256
SIZE = 384  # of an embedding
# How often a source is drawn from, for each of its phrases.
WEIGHT = {
    "table": 1.0, "language": 1.0, "standard": 0.6, "reader": 1.8, "hand": 3.0, "other": 0.25,
    "band": 6.0,
}  # fmt: skip
NO_ROW = ""
OWN = 0.8  # of the target: the row itself; the rest is for rows that weigh and bend alike
WIDTHS = np.array([0.15, 0.04])  # of that, in ln E and ln rho
FAMILY = 12, 60, 8  # designations of a pattern: fewest, most, and one more for so many signs
BESIDE = np.array([0.1, 0.03])  # in ln E and ln rho, how far beside a band a row is nearly right
HARDLY, SHADE = 0.3, 0.15  # of a fit; of a cosine, what one row is the likelier by than another
RATE, BATCH, STEPS = 4e-3, 512, 8000
VERSIONS = 3  # of a phrase: as it stands, and worn
LEFT_OUT = 0.1  # of what the hidden layer is given, in training


class Phrase(NamedTuple):
    """Words of matter, the row that they mean, and where that is known from.

    In place of a row there may be a ``band``: ln of the least and the most E, then of rho.
    """

    text: str
    row: str
    source: str
    band: tuple[float, ...] = ()


def phrases_of(table: MaterialTable, seed: int = 0) -> list[Phrase]:
    """All phrases to learn from."""
    found = [Phrase(text, row.name, "table") for text, row in table.phrases.items()]
    lists = tomllib.loads((TEXT / "languages.toml").read_text(encoding="utf-8"))
    for language in LANGUAGES:
        for entry in re.split(r"[;\n]", lists[language]["matter"]):
            own, _, english = entry.partition("=")
            row = table.phrases.get(english.strip().lower())
            if row:
                nouns = (word.strip() for word in own.split(","))
                found += [Phrase(noun, row.name, "language") for noun in nouns if noun]
    dice = random.Random(seed)
    families = tomllib.loads((TEXT / "designations.toml").read_text(encoding="utf-8"))["family"]
    least, most, per = FAMILY
    for family in families:
        rows = [table.phrases[name] for name in family["rows"] if name in table.phrases]
        for row, pattern in product(rows[:1], family["patterns"]):
            for _ in range(min(most, least + len(pattern) // per)):
                found.append(Phrase(one_of(pattern, dice).strip(), row.name, "standard"))
    for line in (DATA / "phrases.tsv").read_text(encoding="utf-8").splitlines():
        text, name, source = line.split("\t")
        found.append(Phrase(text, name, source))
    for line in (DATA / "bands.txt").read_text(encoding="utf-8").splitlines():
        numbers, _, text = line.partition("|")
        e_least, e_most, light, heavy = map(float, numbers.split())
        band = (e_least * 1e9, e_most * 1e9, light, heavy)
        found.append(Phrase(text.strip(), NO_ROW, "band", tuple(map(math.log, band))))
    for text, _, _, spans, _ in load_templates():
        pieces, at = [], 0
        for span in sorted(spans):
            pieces.append(text[at : span.start])
            at = max(at, span.end)
        words = re.findall(r"[^\W\d_][\w-]*", " ".join([*pieces, text[at:]]))
        for start in dice.sample(range(len(words)), min(2, len(words))):
            end = start + dice.choice((1, 1, 2, 3))
            found.append(Phrase(" ".join(words[start:end]), NO_ROW, "other"))
    known = {NO_ROW, *(row.name for row in table)}
    return [phrase for phrase in found if phrase.text and phrase.row in known]


def one_of(pattern: str, dice: random.Random) -> str:
    """A text that a pattern matches, as far as it is made of signs, sets and repeats.

    >>> one_of(r"EN[ -]GJL-[123]50", random.Random(0))[-5:] in ("L-150", "L-250", "L-350")
    True
    """
    parser = importlib.import_module("re._parser")  # the standard library's own reader of patterns

    def made(nodes: Any) -> Iterator[str]:
        for kind, value in nodes:
            match str(kind):
                case "LITERAL":
                    yield chr(value)
                case "ANY":
                    yield dice.choice("abc12")
                case "IN":
                    yield dice.choice([*_signs(value, dice)] or [""])
                case "MAX_REPEAT" | "MIN_REPEAT":
                    least, most, inner = value
                    for _ in range(dice.randint(least, min(int(most), least + 3))):
                        yield from made(inner)
                case "SUBPATTERN":
                    yield from made(value[3])
                case "BRANCH":
                    yield from made(dice.choice(value[1]))

    return "".join(made(parser.parse(pattern)))


def _signs(members: Any, dice: random.Random) -> Iterator[str]:
    """Signs of a set of a pattern."""
    for kind, value in members:
        match str(kind):
            case "LITERAL":
                yield chr(value)
            case "RANGE":
                yield from (chr(dice.randint(*value)) for _ in range(3))
            case "CATEGORY":
                yield from {"DIGIT": "0123456789", "SPACE": " "}.get(str(value)[9:], "abdeXZ019")
            case "NEGATE":
                yield "-"
                return


# Words around a matter that change nothing of it.
IDLE = tuple((DATA / "idle.txt").read_text(encoding="utf-8").splitlines())


def worn(phrase: str, dice: random.Random) -> str:
    """A phrase as others write it: with words beside it, misspelt, in capitals, joined."""
    if dice.random() < 0.3:
        phrase = f"{dice.choice(IDLE)} {phrase}"
    if dice.random() < 0.3:
        phrase += dice.choice((" ", ", ")) + dice.choice(IDLE)
    if dice.random() < 0.12 and len(phrase) > 5:
        i = dice.randrange(1, len(phrase) - 1)
        a, b = phrase[i], phrase[i + 1]
        phrase = phrase[:i] + dice.choice((b, b + a, a + a + b)) + phrase[i + 2 :]
    if dice.random() < 0.15:
        phrase = phrase.upper()
    return phrase.replace(" ", "-") if dice.random() < 0.1 else phrase


class PhraseLearner(nn.Module):
    """The network of ``predictors/text/phrases.py``, to be trained."""

    def __init__(self, rows: int) -> None:
        super().__init__()
        self.vectors = nn.EmbeddingBag(BUCKETS, WIDTH, mode="mean")
        nn.init.normal_(self.vectors.weight, std=0.5)
        self.hidden, self.out = nn.Linear(WIDTH + SIZE, HIDDEN), nn.Linear(HIDDEN, rows)

    def forward(self, places: Sequence[Sequence[int]], senses: np.ndarray) -> Tensor:
        """Logits of the rows (n, rows) of phrases, by their features and embeddings (n, 384)."""
        starts = np.cumsum([0, *(len(own) for own in places[:-1])])
        flat = torch.from_numpy(np.concatenate(places))
        letters = self.vectors(flat, torch.from_numpy(starts))
        x = torch.cat([letters, SENSE * torch.from_numpy(senses)], dim=1)
        return self.out(torch.relu(self.hidden(functional.dropout(x, LEFT_OUT, self.training))))


def loss_of(logits: Tensor, batch: Sequence[Phrase], named: Tensor, in_band: Tensor) -> Tensor:
    """Mean cross entropy with what is wanted of a named row; of a band the chance of its rows.

    ``named`` (n, rows) and ``in_band`` (n, rows) are what is wanted of each, whichever it is.
    """
    chances = functional.log_softmax(logits, dim=-1)
    of_row = -(named * chances).sum(dim=-1)
    of_band = -torch.logsumexp(chances + torch.log(in_band + 1e-9), dim=-1)
    banded = torch.tensor([bool(phrase.band) for phrase in batch])
    return torch.where(banded, of_band, of_row).mean()


def in_bands(phrases: Sequence[Phrase], values: np.ndarray, near: np.ndarray) -> Tensor:
    """How nearly rows lie in the bands of phrases, (n, rows + 1); 0 for none and without a band.

    Of these the ones whose names are ``near`` (n, rows) in sense count most: "soaked sponge" may
    weigh and bend like a banana.
    """
    out = np.zeros((len(phrases), len(values) + 1), np.float32)
    for i, phrase in enumerate(phrases):
        if phrase.band:
            least, most = np.reshape(phrase.band, (2, 2)).T
            beside = np.maximum(least - values, 0) + np.maximum(values - most, 0)
            fits = np.exp(-((beside / BESIDE) ** 2).sum(axis=-1))
            best = near[i][fits > HARDLY].max(initial=-1)
            out[i, :-1] = fits * np.exp(np.minimum(near[i] - best, 0) / SHADE)
    return torch.from_numpy(out)


def targets(table: MaterialTable) -> Tensor:
    """For each row, and for none, what is wanted of all: most of it is the row's own."""
    values = values_of(table) / WIDTHS
    alike = np.exp(-((values[:, None] - values) ** 2).sum(axis=-1))
    alike /= alike.sum(axis=1, keepdims=True)
    wanted = np.eye(len(values) + 1)
    wanted[:-1, :-1] = OWN * wanted[:-1, :-1] + (1 - OWN) * alike
    return torch.tensor(wanted, dtype=torch.float32)


@dataclass(frozen=True)
class Learned:
    """The trained network, its rows, and the loss as it went."""

    network: PhraseLearner
    rows: list[str]
    history: list[dict[str, float]]


def train_phrases(
    *, steps: int = STEPS, batch: int = BATCH, seed: int = 0, output: Path | None = None
) -> Learned:
    """Train on a processor, and write the weights: a byte a number of the matrices.

    Parameters
    ----------
    steps
        Batches; all take most of an hour of two processors, some ten minutes for embeddings.
    batch
        Phrases in one.
    seed
        Of the batches, and of the made designations.
    output
        File of the weights.
    """
    table = load_table()
    rows = [*(row.name for row in table), NO_ROW]
    number = {name: i for i, name in enumerate(rows)}
    phrases, wanted = phrases_of(table, seed), targets(table)
    share = np.array([WEIGHT[phrase.source] for phrase in phrases])
    torch.manual_seed(seed)
    network, dice = PhraseLearner(len(rows)), random.Random(seed)
    draw, history = np.random.default_rng(seed), []
    drawn = draw.choice(len(phrases), (steps, batch), p=share / share.sum())
    version = draw.integers(VERSIONS, size=drawn.shape)
    texts = {
        (i, k): worn(phrases[i].text, dice) if k else phrases[i].text
        for i, k in sorted({*zip(drawn.ravel().tolist(), version.ravel().tolist(), strict=True)})
    }
    place = {key: n for n, key in enumerate(texts)}
    encoder, values = minilm("cpu"), values_of(table)
    senses, called = encoder.text([*texts.values()]), encoder.text(rows[:-1])
    places = [features(text) for text in texts.values()]
    adam = torch.optim.Adam(network.parameters(), lr=RATE)
    for step in range(steps):
        some = [phrases[i] for i in drawn[step]]
        keys = zip(drawn[step].tolist(), version[step].tolist(), strict=True)
        own = [place[key] for key in keys]
        logits = network([places[i] for i in own], senses[own])
        named = wanted[[number[phrase.row] for phrase in some]]
        loss = loss_of(logits, some, named, in_bands(some, values, senses[own] @ called.T))
        adam.param_groups[0]["lr"] = RATE * (1 - step / steps)
        adam.zero_grad()
        loss.backward()
        adam.step()
        if step % 100 == 99:
            history.append({"step": step + 1, "loss": loss.item()})
    if output is not None:
        save_phrases(network, rows, np.vstack([values, [[np.inf, np.inf]]]), output)
    return Learned(network.eval(), rows, history)


def save_phrases(
    network: PhraseLearner, rows: Sequence[str], values: np.ndarray, path: Path
) -> None:
    """Write the weights: of the matrices a byte a number and a step for each row."""
    from safetensors.numpy import save_file

    layers = {"hidden": network.hidden, "out": network.out}
    matrices = {f"{name}.w": layer.weight for name, layer in layers.items()}
    matrices |= {"vectors": network.vectors.weight}
    arrays = packed({name: w.detach().numpy() for name, w in matrices.items()})
    arrays |= {f"{name}.b": layer.bias.detach().numpy() for name, layer in layers.items()}
    arrays |= {"values": values}
    path.parent.mkdir(parents=True, exist_ok=True)
    save_file(arrays, path, {"rows": json.dumps([*rows])})
