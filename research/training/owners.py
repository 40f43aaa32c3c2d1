"""Training of the network of things in one piece: which words name the part that has a matter.

It begins with the tagger and learns from three sources, as often from each: what hands said of real
things (``datasets/data/naturals_*.toml``), where the words for part and matter are on record; what
others wrote of one thing, with every matter beside it ("runs in a bronze bush";
``datasets/data/things.jsonl``); and the tagger's marked texts, where a part's name stands in the
text once. Matters that nothing is made of ("a fruit bowl") are those of which no clause speaks; of
a marked text those of the other parts, where the thing is called after one.
"""

from __future__ import annotations

import json
import random
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from ...fem.table import load_table
from ...predictors.text.clauses import Place, over
from ...predictors.text.lexing import lex
from ...predictors.text.materials import lexicon_of
from ...predictors.text.parts import stem
from ...predictors.text.tagger import CLS, SEP, load_tagger, shown_name
from ..datasets import sweethome3d
from ..datasets.natural import Natural, naturals
from .options import TrainerOptions
from .tagger.generator import COATING, MATTER, NUMBER, RELATION
from .tagger.recipe import TaggerNetwork, save_learned
from .tagger.templates import Template, load_templates
from .trainer import Losses, Trained, train_network

RANK = 16  # of the changes of the dense layers
LONGEST = 150  # tokens of a text; longer ones are left out
EXCHANGED = 0.5  # share of matters whose words another's stand for
PADDING = -1  # in place of a label
THINGS = Path(__file__).parents[1] / "datasets" / "data" / "things.jsonl"
# What a file calls a thing that it has no name for.
NAMELESS = ("object", "mesh", "mesh 0", "body 1", "part", "model", "group 2", "node 0", "solid")
UNNAMED = 0.2  # share of named things that are called so all the same
_WORD = re.compile(r"[^\W\d_]+")


class Asked(NamedTuple):
    """A text and one of its matters.

    parts: Where the words stand that name what has it; None where that is not known.
    meant: Whether the thing has it.
    name: What the file calls the thing, "" where it has no name.
    """

    text: str
    matter: Place
    parts: tuple[Place, ...] | None
    meant: bool
    name: str = ""


def matters_of(text: str) -> list[Place]:
    """Where the table's matters stand in a text."""
    lexemes = lex(text, lexicon_of(load_table()), ()).lexemes
    places = [(x.start, x.end, x.text) for x in lexemes if x.role == "material"]
    return [(start, end) for start, end, words in places if text[start:end] == words]


def of_natural(natural: Natural) -> Iterator[Asked]:
    """What a sentence of a hand asks: clauses take their words where they stand nearest."""
    text, clauses = natural.text, list[tuple[Place | None, Place | None]]()

    def all_of(words: str) -> list[Place]:
        found = re.finditer(r"\b" + re.escape(words), text, re.IGNORECASE) if words else ()
        return [(m.start(), m.end()) for m in found]

    for one in natural.clauses:
        parts = all_of(one.part)
        taken = [matter for _, matter in clauses]
        there = all_of(one.material)
        free = [place for place in there if place not in taken] or there
        near = parts[0][0] if parts else 0
        matter = min(free, key=lambda place: abs(place[0] - near), default=None)
        at = matter[0] if matter else 0
        part = min(parts, key=lambda place: abs(place[0] - at), default=None)
        clauses.append((part, matter))
    for place in matters_of(text):
        mine = [
            part for part, matter in clauses
            if (over(matter, place) if matter else part and over(part, place))
        ]  # fmt: skip
        yield Asked(text, place, tuple(filter(None, mine)), bool(mine))


def of_thing(line: str) -> Iterator[Asked]:
    """What a text about one thing asks, a line of ``THINGS``: in its order, each matter is told."""
    told, at = json.loads(line), 0
    text = told["text"]
    for words, meant, part in told["matters"]:
        start = text.index(words, at)
        at = start + len(words)
        found = re.finditer(r"\b" + re.escape(part), text, re.IGNORECASE) if part else ()
        near = min(found, key=lambda m: abs(m.start() - start), default=None)
        parts = ((near.start(), near.end()),) if near else ()
        yield Asked(text, (start, at), parts, bool(meant), told["name"])


def of_template(template: Template) -> Iterator[Asked]:
    """What a marked text asks; parts are known where each one's last word stands in it once.

    Once of all of it, and once of one of its parts, which then is all that the file has.
    """
    text, dice = template.text, random.Random(template.text)
    only = dice.randrange(len(template.names))
    words = [(m.start(), m.end(), stem(m[0])) for m in _WORD.finditer(text)]
    for place in matters_of(text):
        spans = [span for span in template.spans if over((span.start, span.end), place)]
        roles = {span.role for span in spans}
        if roles & {NUMBER, RELATION} or (not spans and template.skip):
            continue
        owners = {i for s in spans if s.role in (MATTER, COATING) for i in s.owners}
        parts: list[Place] = []
        for i in owners:
            name = [stem(word) for word in _WORD.findall(shown_name(template.names[i]))]
            ends = [
                k for k, word in enumerate(words)
                if name and word[2] == name[-1] and not over(word[:2], place)
            ]  # fmt: skip
            if len(ends) != 1:
                break
            first = ends[0]
            while (
                first and words[first - 1][2] in name and words[first][0] - words[first - 1][1] == 1
            ):
                first -= 1
            parts.append((words[first][0], words[ends[0]][1]))
        known = len(parts) == len(owners) > 0
        named = tuple(parts) if known else None
        yield Asked(text, place, named, bool(owners))
        yield Asked(text, place, named, only in owners, template.names[only])


class OwnerBatch(NamedTuple):
    """Tokens (n, length) and their types, 1 for the text but the matter; what of it is no padding.

    named: Whether a token names the part, ``PADDING`` where that is not asked.
    own: Tokens of the matter in the text.
    meant (n,): Whether the thing has it.
    """

    tokens: Tensor
    types: Tensor
    seen: Tensor
    named: Tensor
    own: Tensor
    meant: Tensor


class Encoded(NamedTuple):
    """Tokens of a matter's words, of the thing's name and of a text.

    Where the matter's own stand there, and each one's label.
    """

    words: list[int]
    name: list[int]
    text: list[int]
    own: slice
    named: list[int]
    meant: bool


def encoded(asked: Sequence[Asked], tokenizer: Any) -> list[Encoded]:
    """Tokens of what is asked, of texts that are not too long."""
    out = []
    for one in asked:
        text = tokenizer.encode(one.text, add_special_tokens=False)
        own = [i for i, place in enumerate(text.offsets) if over(place, one.matter)]
        if not own or len(text.ids) > LONGEST:
            continue
        words, name = (
            tokenizer.encode(said, add_special_tokens=False).ids
            for said in (one.text[slice(*one.matter)], shown_name(one.name) if one.name else "")
        )
        named = [PADDING] * len(text.ids)
        if one.meant and one.parts is not None:
            named = [int(any(over(place, part) for part in one.parts)) for place in text.offsets]
        out.append(Encoded(words, name, text.ids, slice(own[0], own[-1] + 1), named, one.meant))
    return out


class OwnerSampler:
    """Draws batches, as many from each of the sources; some matters have another one's words.

    ``nameless`` are tokens of names of what has none.
    """

    def __init__(
        self,
        sources: Sequence[Sequence[Encoded]],
        nameless: Sequence[list[int]],
        *,
        seed: int,
        device: str,
    ) -> None:
        self.sources, self.nameless, self.device = sources, nameless, device
        self.generator = torch.Generator().manual_seed(seed)
        self.words = [one.words for each in sources for one in each if one.meant]

    def draw(self, n: int) -> OwnerBatch:
        """Return n questions."""
        kinds = torch.randint(len(self.sources), (n,), generator=self.generator).tolist()
        last = len(self.sources) - 1  # the marked texts: called after a part, it is that part
        chosen = [self._varied(self._one_of(self.sources[k]), part=k == last) for k in kinds]
        return batch_of(chosen, self.device)

    def _varied(self, one: Encoded, part: bool = False) -> Encoded:
        if not one.name or (not part and torch.rand(1, generator=self.generator) < UNNAMED):
            one = one._replace(name=self._one_of(self.nameless))
        marked = 1 in one.named[one.own] or PADDING in one.named
        if marked or not one.meant or torch.rand(1, generator=self.generator) > EXCHANGED:
            return one
        words, (first, last) = self._one_of(self.words), (one.own.start, one.own.stop)
        text = [*one.text[:first], *words, *one.text[last:]]
        named = [*one.named[:first], *[0] * len(words), *one.named[last:]]
        return Encoded(words, one.name, text, slice(first, first + len(words)), named, one.meant)

    def _one_of(self, things: Sequence[Any]) -> Any:
        return things[int(torch.randint(len(things), (1,), generator=self.generator))]


def batch_of(chosen: Sequence[Encoded], device: str) -> OwnerBatch:
    """Put questions side by side."""
    length = max(len(one.words) + len(one.name) + len(one.text) + 4 for one in chosen)
    tokens, types = np.zeros((2, len(chosen), length), np.int64)
    seen, own = np.zeros((2, len(chosen), length), bool)
    named = np.full(tokens.shape, PADDING)
    for row, one in enumerate(chosen):
        head = [CLS, *one.words, SEP, *one.name, SEP]
        text = slice(len(head), len(head) + len(one.text))
        tokens[row, : text.stop + 1] = [*head, *one.text, SEP]
        seen[row, : text.stop + 1] = True
        own[row, text][one.own] = True
        types[row, text] = ~own[row, text]
        named[row, text] = one.named
    arrays = (tokens, types, seen, named, own, np.array([one.meant for one in chosen]))
    return OwnerBatch(*(torch.from_numpy(x).to(device) for x in arrays))


def owner_loss(logits: Tensor, batch: OwnerBatch) -> Losses:
    """Cross entropy of the words that name parts, a text's summed, and of what is meant."""
    logits, asked = logits.float(), batch.named >= 0
    named = functional.binary_cross_entropy_with_logits(
        logits[..., 0][asked], batch.named[asked].float(), reduction="sum"
    ) / len(logits)
    mean = (logits[..., 1] * batch.own).sum(dim=1) / batch.own.sum(dim=1)
    meant = functional.binary_cross_entropy_with_logits(mean, batch.meant.float())
    return Losses(named + meant, {"named": named, "meant": meant})


def preset() -> TrainerOptions:
    """How the shipped network was trained: two minutes of a GPU; without one, a trial."""
    on_gpu = torch.cuda.is_available()
    return TrainerOptions(
        batch=64 if on_gpu else 8, steps=2400 if on_gpu else 20, rate=1e-3, warm_up=60,
        weight_decay=0.01,
        decay=0.99, device="cuda" if on_gpu else "cpu", bfloat16=on_gpu,
        every=200 if on_gpu else 10,
    )  # fmt: skip


def train_owners(
    options: TrainerOptions, *, output: Path, resume: Path | None = None, seed: int = 0
) -> Trained[TaggerNetwork]:
    """Train it on all sentences, and write what it learned beside the tagger.

    Parameters
    ----------
    options
        How the run goes.
    output
        File of the learned weights.
    resume
        Folder of the whole state.
    seed
        Seed of everything random.
    """
    torch.manual_seed(seed)
    tagger = load_tagger()
    hands = [one for natural in naturals(sweethome3d.TRAINING) for one in of_natural(natural)]
    texts = [template for template in load_templates() if template.language == "en"]
    marked = [one for template in texts for one in of_template(template)]
    things = [one for line in THINGS.read_text("utf-8").splitlines() for one in of_thing(line)]
    sources = [encoded(each, tagger._tokenizer) for each in (hands, things, marked)]
    nameless = [tagger._tokenizer.encode(n, add_special_tokens=False).ids for n in NAMELESS]
    weights = {name: torch.from_numpy(x.copy()) for name, x in tagger._weights.items()}
    network = TaggerNetwork(weights, roles=2, rank=RANK, word_rank=0)
    return train_network(
        network,
        OwnerSampler(sources, nameless, seed=seed, device=options.device),
        owner_loss,
        options,
        forward=lambda net, batch: net.logits(batch.tokens, batch.types, batch.seen),
        resume=resume,
        config={"rank": RANK, "steps": options.steps, "seed": seed},
        save=lambda trained, _: save_learned(trained, output),
    )
