"""Training of the span tagger: its network, batches made while it trains, and its weights' file."""

from __future__ import annotations

import multiprocessing
import os
import random
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from ....predictors.packed import packed
from ....predictors.text.tagger import ROLES, asked, question
from ..options import TrainerOptions
from ..trainer import Losses, Trained, train_network
from .generator import LANGUAGES, Generator, pairs
from .templates import TemplateTexts, load_templates

RANK, WORD_RANK = 56, 16  # of the changes of the dense layers, and of the embeddings of tokens
LONGEST = 256  # tokens of a question and a text; longer made ones are left out
LONGEST_NAME = 40  # characters of a material's name
POOL = 6000  # pairs that a worker sorts by length into batches
PER_TEXT = 4  # parts that are asked about of one text, at most
OF_SENTENCES = 0.7  # share of the texts that are made of marked sentences
HEARD = ("attention.self.query", "attention.self.key", "attention.self.value")
DROP = 0.1  # share of what a layer gives on that is left out in training, as BERT was trained
PAD, QUESTION = -2, -1  # in place of roles


class Batch(NamedTuple):
    """Tokens (n, length), and their roles: of the question and of the padding negative."""

    tokens: Tensor
    roles: Tensor


class TaggerNetwork(nn.Module):
    """MiniLM with low-rank changes, or all of it, and one layer that gives a token its role.

    ``rank`` and ``word_rank`` are those of the changes of dense layers, and of the embeddings of
    tokens, 0 for none.
    """

    def __init__(
        self,
        weights: Mapping[str, Tensor],
        *,
        heads: int = 12,
        full: bool = False,
        roles: int = len(ROLES),
        rank: int = RANK,
        word_rank: int = WORD_RANK,
    ) -> None:
        super().__init__()
        self.heads, self.full, self.drop = heads, full, DROP
        self.layers = sum(key.endswith("attention.self.query.weight") for key in weights)
        self.frozen, self.learned = nn.ParameterDict(), nn.ParameterDict()
        self.down, self.up = nn.ParameterDict(), nn.ParameterDict()
        for key, weight in weights.items():
            wide = weight.ndim == 2 and "type" not in key
            if not weight.is_floating_point() or "pooler" in key:
                continue
            name = key.replace(".", "/")
            if not wide or full:
                self.learned[name] = nn.Parameter(weight.clone())
                continue
            self.frozen[name] = nn.Parameter(weight.clone(), requires_grad=False)
            own = 0 if "position" in key else word_rank if "word" in key else rank
            if own:
                self.up[name] = nn.Parameter(torch.zeros(weight.shape[0], own))
                down = torch.randn(own, weight.shape[1]) / weight.shape[1] ** 0.5
                self.down[name] = nn.Parameter(down)
        width = weights["embeddings.LayerNorm.weight"].shape[0]
        self.role = nn.Linear(width, roles)

    def _weight(self, key: str) -> Tensor:
        name = key.replace(".", "/")
        if name in self.learned:
            return self.learned[name]
        return self.frozen[name] + self.up[name] @ self.down[name]

    def _dense(self, key: str, x: Tensor) -> Tensor:
        return functional.linear(x, self._weight(f"{key}.weight"), self._weight(f"{key}.bias"))

    def _norm(self, key: str, x: Tensor) -> Tensor:
        scale, shift = self._weight(f"{key}.weight"), self._weight(f"{key}.bias")
        return functional.layer_norm(x, x.shape[-1:], scale, shift, 1e-12)

    def _dropped(self, x: Tensor) -> Tensor:
        return functional.dropout(x, self.drop, self.training)

    def forward(self, batch: Batch) -> Tensor:
        """Logits of the roles of each token, (n, length, roles)."""
        return self.logits(batch.tokens, (batch.roles >= 0).long(), batch.roles != PAD)

    def logits(self, tokens: Tensor, types: Tensor, seen: Tensor) -> Tensor:
        """Logits of tokens (n, length) of two ``types``; those not ``seen`` are padding."""
        seen = seen[:, None, None]
        words, places, kinds = (
            f"embeddings/{kind}_embeddings/weight" for kind in ("word", "position", "token_type")
        )
        if self.full:
            x = functional.embedding(tokens, self.learned[words])
            place = self.learned[places]
        else:
            x = functional.embedding(tokens, self.frozen[words])
            if words in self.up:
                x = x + functional.embedding(tokens, self.up[words]) @ self.down[words]
            place = self.frozen[places]
        x = x + place[: tokens.shape[1]]
        x = x + functional.embedding(types, self.learned[kinds])
        x = self._dropped(self._norm("embeddings.LayerNorm", x))
        split = (*tokens.shape, self.heads, x.shape[-1] // self.heads)
        for layer in range(self.layers):
            at = f"encoder.layer.{layer}"
            q, k, v = (self._dense(f"{at}.{d}", x).view(split).transpose(1, 2) for d in HEARD)
            mixed = functional.scaled_dot_product_attention(q, k, v, attn_mask=seen)
            mixed = mixed.transpose(1, 2).reshape(x.shape)
            x = self._norm(
                f"{at}.attention.output.LayerNorm",
                x + self._dropped(self._dense(f"{at}.attention.output.dense", mixed)),
            )
            inner = functional.gelu(self._dense(f"{at}.intermediate.dense", x))
            inner = self._dropped(self._dense(f"{at}.output.dense", inner))
            x = self._norm(f"{at}.output.LayerNorm", x + inner)
        return self.role(x)


def role_loss(logits: Tensor, batch: Batch) -> Losses:
    """Cross entropy of the roles of a text's tokens; how many pairs have a token decided wrong."""
    text = batch.roles >= 0
    loss = functional.cross_entropy(
        logits.float().flatten(0, 1), batch.roles.flatten().clamp(min=-1), ignore_index=-1
    )
    matter = logits.float().softmax(-1)[..., 1:3].sum(-1) > 0.5
    wrong = (matter != ((batch.roles == 1) | (batch.roles == 2))) & text
    return Losses(loss, {"loss": loss, "pairs_wrong": wrong.any(1).float().mean()})


@dataclass(frozen=True)
class Source:
    """What made texts are made from, and the tokenizer's file."""

    materials: Sequence[str]
    lexicon: Mapping[str, Mapping[str, Any]]
    tokenizer: Path
    tokens: int  # in one batch
    without: Sequence[str] = ()  # sets of the benchmark whose sentences are kept for a judgement


def make_batches(source: Source, seed: int, queue: Any) -> None:
    """Put batches of made pairs into a queue, without end."""
    os.environ["TOKENIZERS_PARALLELISM"] = "false"
    from tokenizers import Tokenizer

    tokenizer = Tokenizer.from_file(str(source.tokenizer))
    tokenizer.no_padding()
    tokenizer.no_truncation()
    maker, dice = Generator(source.materials, source.lexicon, seed), random.Random(seed)
    templates = load_templates(source.without)
    sentences = TemplateTexts(templates, maker, seed)
    while True:
        rows: list[tuple[list[int], list[int]]] = []
        while len(rows) < POOL:
            told = templates and dice.random() < OF_SENTENCES
            example = sentences.example() if told else maker.example()
            said = tokenizer.encode(example.text, add_special_tokens=False)
            for i, spans in [*pairs(example, dice)][:PER_TEXT]:
                asks = tokenizer.encode(question(example.names, i), add_special_tokens=False)
                tokens, head = asked(asks.ids, said.ids)
                roles = [
                    next((s.role for s in spans if s.start < end and start < s.end), 0)
                    for start, end in said.offsets
                ]
                if len(tokens) <= LONGEST:
                    rows.append((tokens, [QUESTION] * head + roles + [QUESTION]))
        rows.sort(key=lambda row: len(row[0]))
        batches = []
        while rows:
            # The longest first: as many as fit, padded to the longest
            count = max(1, source.tokens // len(rows[-1][0]))
            chosen, rows = rows[-count:], rows[:-count]
            tokens = np.zeros((len(chosen), len(chosen[-1][0])), np.int16)
            roles = np.full(tokens.shape, PAD, np.int8)
            for i, (own, said_roles) in enumerate(chosen):
                tokens[i, : len(own)], roles[i, : len(own)] = own, said_roles
            batches.append((tokens, roles))
        dice.shuffle(batches)
        for batch in batches:
            queue.put(batch)


class MadePairs:
    """Batches that other processes make; after a resumed run's start they are new ones."""

    def __init__(self, source: Source, *, workers: int, device: str, seed: int) -> None:
        self.generator = torch.Generator().manual_seed(seed)
        self.source, self.workers, self.device = source, workers, device
        self.queue: Any = None

    def draw(self, n: int) -> Batch:
        """The next batch; its size is given in tokens, not by ``n``."""
        if self.queue is None:
            context = multiprocessing.get_context("spawn")
            self.queue = context.Queue(8 * self.workers)
            for _ in range(self.workers):
                seed = int(torch.randint(2**31, (1,), generator=self.generator))
                context.Process(
                    target=make_batches, args=(self.source, seed, self.queue), daemon=True
                ).start()
        tokens, roles = (torch.from_numpy(x.astype(np.int64)) for x in self.queue.get())
        return Batch(tokens.to(self.device), roles.to(self.device))


def made_from() -> tuple[list[str], dict[str, dict[str, Any]]]:
    """Names of materials of the table, and of each language its nouns of matter and of parts."""
    from ....fem.table import load_table
    from ....predictors.text.english import DATA

    def entries(text: str) -> Iterator[tuple[list[str], str]]:
        for entry in re.split(r"[;\n]", text):
            own, equals, english = entry.partition("=")
            if equals:
                yield [word.strip() for word in own.split(",") if word.strip()], english.strip()

    lexicon: dict[str, dict[str, Any]] = {}
    lists = tomllib.loads((DATA / "languages.toml").read_text(encoding="utf-8"))
    for language in LANGUAGES:
        parts: dict[str, list[str]] = {}
        for own, english in entries(lists[language]["parts"]):
            parts.setdefault(english, []).extend(own)
        matter = [word for own, _ in entries(lists[language]["matter"]) for word in own]
        lexicon[language] = {"matter": matter, "parts": parts}
    phrases = load_table().phrases
    return [p for p in phrases if len(p) < LONGEST_NAME and "(" not in p], lexicon


def preset() -> TrainerOptions:
    """How the shipped tagger was trained: nine minutes of a GPU; without one, a trial."""
    on_gpu = torch.cuda.is_available()
    return TrainerOptions(
        batch=48_000 if on_gpu else 3_000,
        steps=10**9,
        minutes=8.8,
        rate=1e-3,
        warm_up=300,
        weight_decay=0.01,
        decay=0.9995,
        every=500 if on_gpu else 20,
        device="cuda" if on_gpu else "cpu",
        bfloat16=on_gpu,
    )


def train_tagger(
    options: TrainerOptions,
    *,
    materials: Sequence[str],
    lexicon: Mapping[str, Mapping[str, Any]],
    encoder: Path,
    output: Path,
    resume: Path | None = None,
    workers: int,
    full: bool = False,
    without: Sequence[str] = (),
    seed: int = 0,
) -> Trained[TaggerNetwork]:
    """Train the tagger, and write what it learned.

    Parameters
    ----------
    options
        How the run goes; ``batch`` is in tokens.
    materials, lexicon
        Names of materials, and for each language its nouns of matter and of parts.
    encoder
        Folder of MiniLM.
    output
        File of the learned weights, half precision.
    resume
        Folder of the whole state.
    workers
        Processes that make texts.
    full
        Whether all of MiniLM is trained.
    without
        Sets of the benchmark whose sentences are not trained on: to judge on.
    seed
        Seed of the made texts.
    """
    from safetensors.torch import load_file

    torch.manual_seed(seed)
    network = TaggerNetwork(load_file(encoder / "model.safetensors"), full=full)
    source = Source(materials, lexicon, encoder / "tokenizer.json", options.batch, without)
    return train_network(
        network,
        MadePairs(source, workers=workers, device=options.device, seed=seed),
        role_loss,
        options,
        resume=resume,
        config={"full": full, "rank": RANK, "word_rank": WORD_RANK},
        save=lambda trained, _: save_learned(trained, output),
    )


def save_learned(network: TaggerNetwork, path: Path) -> None:
    """Write what was learned: of low ranks bytes, which lose little there, else halves."""
    from safetensors.numpy import save_file

    found = {
        key.replace("/", "."): value.detach().float().cpu().numpy()
        for key, value in network.state_dict().items()
        if not key.startswith("frozen")
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    low = {name: x for name, x in found.items() if name.startswith(("up.", "down."))}
    save_file(packed(low) | packed({n: x for n, x in found.items() if n not in low}, axes=9), path)
