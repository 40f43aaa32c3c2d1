"""Frames of clauses: ways to say that a part, two parts, an object or a kind of matter is so.

Placeholders: ``{p}`` and ``{q}`` words of parts, ``{o}`` of the object, ``{k}`` a kind of matter,
``{m}`` a material or a level, ``{is}`` the verb that agrees. One frame in five is held out.
"""

from __future__ import annotations

from collections.abc import Sequence

HELD_OUT_EVERY = 5  # the third of every five is kept for tests

PART = (
    "the {p} {is} {m}|the {p} {is} made of {m}|{m} {p}|{p}: {m}|{p} made of {m}|a {m} {p}|"
    "the {p} {is} made out of {m}|its {p} {is} {m}|{p} of {m}|with a {m} {p}|{m} for the {p}|"
    "the {p} {is} made from {m}|{p} in {m}|the {m} {p}|the {p} {is} built of {m}|"
    "the {p} should be {m}|{p} = {m}|whose {p} {is} {m}|the {p} {is} crafted from {m}|"
    "make the {p} {m}|use {m} for the {p}|the {p} out of {m}|it has a {m} {p}|"
    "the {p} {is} pure {m}|{p} {m}|and the {p} {is} {m}|has a {p} made of {m}|"
    "the {p}, which {is} {m}|{p} are {m}|a {p} of {m}"
).split("|")
# Combined freely: more ways to say the same than anyone would list.
PART += [
    f"{subject} {link} {{m}}"
    for subject in ("the {p}", "its {p}", "{p}", "whose {p}", "the {p} of it", "this {p}")
    for link in (
        "{is}", "{is} made of", "{is} made from", "consists of", "{is} built from", "must be",
        "{is} carved from", "{is} formed of", "should be made of", "{is} of", "{is} entirely",
    )
]  # fmt: skip
PART += [
    f"{opening}{{m}} {{p}}{end}"
    for opening in ("it has a ", "having a ", "on ", "and a ", "plus a ", "with its ", "with ")
    for end in ("", " on it", " below", " around it")
]
PAIR = (
    "the {p} and the {q} are {m}|{m} {p} and {q}|the {p} and {q} are made of {m}|"
    "both the {p} and the {q} are {m}|{p} and {q} of {m}|{m} for the {p} and the {q}|"
    "{p} and {q}: {m}|the {m} {p} and {q}|the {p} and {q} {m}|{p}, {q}: {m}"
).split("|")
WHOLE = (
    "everything is {m}|a {m} {o}|the whole {o} is {m}|made entirely of {m}|this is a {m} {o}|{m}|"
    "a {o} made of {m}|the rest is {m}|all of it is {m}|the {o} is {m}|it is made of {m}|"
    "a solid {m} {o}|{o}, {m}|the {o} is made of {m}|everything else is {m}|{m} {o}|"
    "the {o} consists of {m}|it is all {m}|a {o} of {m}|everything is made of {m}"
).split("|")
KIND = (
    "the {k} is {m}|the {k} parts are {m}|{k}: {m}|all {k} is {m}|the {k} parts are made of {m}|"
    "where it is {k}, it is {m}|make the {k} {m}|use {m} for the {k}|the {k} should be {m}|"
    "every {k} part is {m}"
).split("|")
OBJECT = "This is a {o}.|a {o}|{o}|this is a {o}|it is a {o}|an image of a {o}".split("|")
GENERIC = "object thing item toy model piece".split()


def split_frames(frames: Sequence[str], *, held_out: bool) -> list[str]:
    """Return the frames of training, or those kept for tests."""
    return [f for i, f in enumerate(frames) if (i % HELD_OUT_EVERY == 2) == held_out]
