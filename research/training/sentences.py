"""The clauses of a text table on the device."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from ...predictors.film.words import CHANNELS
from ..datasets.grammar import Role
from ..datasets.text_table import TextTable

UNHINTED = 0.2  # of the clauses that train alone


class Clauses(NamedTuple):
    """Clauses by themselves: embeddings (n, D), types of slot (n,), normalised values (n, 3)."""

    embedding: Tensor
    kind: Tensor
    value: Tensor


class Sentences:
    """The text table on the device, with random picks by role and key."""

    def __init__(self, table: TextTable, device: str) -> None:
        def tensor(array: np.ndarray) -> Tensor:
            return torch.tensor(array, device=device)

        self.normalisation = table.normalisation
        self.embedding = tensor(table.embedding)
        self.level, self.value = tensor(table.level).long(), tensor(table.value)
        self.levels = tensor(table.levels)
        self._first, self._count = {}, {}
        for role in Role:
            rows = np.flatnonzero(table.role == role)
            size = int(table.key[rows].max(initial=0)) + 1
            count = np.bincount(table.key[rows], minlength=size)
            start = (rows[0] if rows.size else 0) + np.cumsum(count) - count
            self._first[role], self._count[role] = tensor(start), tensor(count)
        kinds = len(table.levels)
        pairs = np.full((kinds + 1, kinds + 1), -1)
        pairs[table.pairs[:, 0], table.pairs[:, 1]] = np.arange(len(table.pairs))
        pairs[table.pairs[:, 1], table.pairs[:, 0]] = np.arange(len(table.pairs))
        self.pair_of = tensor(pairs)
        self.role = tensor(table.role)
        value, known = settled_values(table)
        self._value, self._settled = tensor(value), tensor(np.flatnonzero(known))

    def pick(self, role: Role, key: Tensor, generator: torch.Generator) -> Tensor:
        """Return a random row for each key, -1 where the key has none or is negative."""
        inside = (key >= 0) & (key < len(self._first[role]))
        key = torch.where(inside, key, 0)
        count = self._count[role][key]
        u = torch.rand(key.shape, generator=generator, device=key.device)
        row = self._first[role][key] + (u * count).long().clamp(max=(count - 1).clamp(min=0))
        return torch.where(inside & (count > 0), row, -1)

    def first(self, role: Role, key: Tensor) -> Tensor:
        """Return the first row of each key."""
        return self._first[role][key]

    def clauses(self, n: int, generator: torch.Generator) -> Clauses:
        """Random clauses whose value needs no object."""
        u = torch.rand(n, generator=generator, device=self.value.device)
        row = self._settled[(u * len(self._settled)).long()]
        kind = torch.where(self.role[row] == Role.NAME, 3, 0)
        hinted = torch.rand(n, generator=generator, device=self.value.device) > UNHINTED
        return Clauses(self.embed(row, hinted), kind, self._value[row])

    def sentence(self, row: Tensor) -> Tensor:
        """Embeddings of rows (n, ...) as sentences alone, 0 for -1."""
        return self.embed(row)[..., : sentence_dim(self.embedding.shape[-1])]

    def embed(self, row: Tensor, hinted: Tensor | None = None) -> Tensor:
        """Embeddings of rows (n, ...), 0 for -1; with hints and subject where ``hinted`` (n,)."""
        out = self.embedding[row.clamp(min=0)].float() * (row >= 0)[..., None]
        if hinted is not None:
            order = torch.arange(out.shape[-1], device=out.device)
            sentence = order < sentence_dim(out.shape[-1])
            out = out * (sentence | hinted.reshape(-1, *(1,) * (out.ndim - 1)))
        return out


def sentence_dim(dim: int) -> int:
    """Return how many of a clause's ``dim`` numbers are its sentence: hints and subject follow."""
    return (dim - len(CHANNELS)) // 2


def settled_values(table: TextTable) -> tuple[np.ndarray, np.ndarray]:
    """Normalised values (rows, 3) of clauses that say all by themselves, and which do (rows,)."""
    value, kinds = table.value.copy(), len(table.levels)
    by_level = (table.role == Role.PART) & (table.level >= 0)
    value[by_level] = table.levels[table.key[by_level], table.level[by_level]]
    plain = (table.role == Role.NAME) & np.isnan(value[:, 0]) & (table.key < kinds)
    value[plain] = table.levels[table.key[plain], -1]
    return value, np.asarray(np.isfinite(value).all(axis=1))
