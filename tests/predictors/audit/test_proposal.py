"""Laws of proposals: a constraint that holds for ranges holds for every sample; data is not run."""

from itertools import pairwise

import numpy as np
import pytest
from autophyx_tet.fem.errors import InputError, UsageError
from autophyx_tet.fem.table import FIELDS, Band, MaterialValue, Span
from autophyx_tet.research.datasets.audit.actor import draw_object, order_of, propose_by_table
from autophyx_tet.research.datasets.audit.agent import respond
from autophyx_tet.research.datasets.audit.findings import Flaw
from autophyx_tet.research.datasets.audit.proposal import End, Proposal, proposal_from
from autophyx_tet.research.datasets.constraints import always_holds, holds
from hypothesis import given, settings
from hypothesis import strategies as st

PARTS = ("a", "b")
THINGS = [draw_object(5, number) for number in range(12)]
FAILURES = ("cfl", "inverted", "velocity", "not finite", "left grid", "indistinguishable")


def spans(low: float, high: float) -> st.SearchStrategy[Span]:
    pairs = st.tuples(*[st.floats(low, high, allow_subnormal=False)] * 2)
    return pairs.map(lambda pair: Span(min(pair), max(pair)))


bands = st.builds(Band, spans(1e1, 1e12), spans(0.0, 0.495), spans(0.5, 3e4))


@st.composite
def numbers(draw, depth: int = 2) -> str:
    """A term of fields and numbers."""
    if not depth or draw(st.booleans()):
        field = f"{draw(st.sampled_from(PARTS))}.{draw(st.sampled_from(FIELDS))}"
        return draw(st.one_of(st.just(field), st.floats(0.5, 9).map(lambda x: f"{x:g}")))
    left, right = draw(numbers(depth - 1)), draw(numbers(depth - 1))
    return f"({left} {draw(st.sampled_from('+-*/'))} {right})"


@st.composite
def lines(draw, depth: int = 2) -> str:
    """A constraint."""
    kind = draw(st.sampled_from(("compare", "compare", "and", "or", "not"))) if depth else "compare"
    if kind == "compare":
        sign = draw(st.sampled_from(("<", "<=", ">", ">=")))
        return f"{draw(numbers())} {sign} {draw(numbers())}"
    if kind == "not":
        return f"not ({draw(lines(depth - 1))})"
    return f"({draw(lines(depth - 1))}) {kind} ({draw(lines(depth - 1))})"


def sampled(draw, ranges: dict[str, Band]) -> dict[str, MaterialValue]:
    """Draw every field of every part on its own from its range, the ends too."""
    return {
        name: MaterialValue(*(draw(st.floats(*span, allow_subnormal=False)) for span in band))
        for name, band in ranges.items()
    }


@pytest.mark.slow
@settings(max_examples=200)
@given(lines(), bands, bands, st.data())
def test_what_holds_for_ranges_holds_for_every_sample(line, a, b, data):
    """Interval arithmetic never says yes or no wrongly, in floating-point numbers."""
    ranges = dict(zip(PARTS, (a, b), strict=True))
    values = sampled(data.draw, ranges)
    if always_holds(line, ranges):
        assert holds(line, values)
    if always_holds(f"not ({line})", ranges):
        assert not holds(line, values)


@settings(max_examples=30)
@given(bands, bands)
def test_the_order_of_two_ranges_is_all_that_is_said(a, b):
    """A constraint follows exactly where ranges do not overlap, and then it holds."""
    ranges = dict(zip(PARTS, (a, b), strict=True))
    found = order_of(ranges)
    assert all(always_holds(line, ranges) for line in found)
    for field in ("E", "rho"):
        x, y = getattr(a, field), getattr(b, field)
        apart = x.min >= y.max or y.min >= x.max
        assert any(f".{field}" in line for line in found) == apart


@pytest.mark.slow
@given(st.sampled_from(THINGS), st.data())
def test_constraints_of_the_table_hold_for_every_sample_also_after_refinement(thing, data):
    """Whatever an agent answers to failures, what it hands on keeps every constraint."""
    proposal = propose_by_table(thing)
    first = proposal
    whole = {name: part.band for name, part in first.parts.items()}
    for _ in range(data.draw(st.integers(0, 5))):
        kind = data.draw(st.sampled_from(FAILURES))
        end, part = data.draw(st.sampled_from(End)), data.draw(st.sampled_from(list(thing.parts)))
        answer = respond(proposal, [Flaw(kind, "", end, part)], whole)
        proposal = answer.proposal
    assert not proposal.broken()
    values = sampled(data.draw, proposal.bands)
    assert all(holds(line, values) for line in first.constraints)
    for name, part in proposal.parts.items():  # never beyond the other end, never out of the table
        assert whole[name].E.min <= part.band.E.min <= part.band.E.max <= whole[name].E.max


def test_the_paper_s_own_example_touches():
    """UniPixie, figure S1: pot 1e7-1e9, trunk 5e4-1e7, leaves 7e3-5e4 Pa hold as >= alone."""
    ends = (("pot", 1e7, 1e9), ("trunk", 5e4, 1e7), ("leaves", 7e3, 5e4))
    ranges = {n: Band(Span(low, high), Span(0.2, 0.3), Span(70, 90)) for n, low, high in ends}
    for (a, *_), (b, *_) in pairwise(ends):
        assert always_holds(f"{a}.E >= {b}.E", ranges)
        assert not always_holds(f"{a}.E > {b}.E", ranges)
    assert order_of(ranges) == ("pot.E >= trunk.E", "pot.E > leaves.E", "trunk.E >= leaves.E")


def test_what_is_no_comparison_is_refused():
    """Calls, attributes, numbers alone and division by nothing."""
    ranges = {"a": Band(Span(1, 2), Span(0, 0.4), Span(1, 2))}
    for line in (
        "__import__('os')",
        "a.E",
        "a.__class__ > 1",
        "True",
        "(a.E > 1) + 1 > 0",
        "a.E >",
    ):
        with pytest.raises(UsageError):
            always_holds(line, ranges)
    assert not always_holds("1 / a.nu > 0", ranges)  # nu may be nothing
    assert not holds("1 / a.nu > 0", {"a": MaterialValue(1.0, 0.0, 1.0)})


def test_a_proposal_is_read_back():
    """Plain data and back, for objects of all kinds of parts."""
    for thing in THINGS:
        proposal = propose_by_table(thing)
        assert proposal_from(proposal.document(), list(thing.parts)) == proposal


GOOD = {"E": [1e9, 2e9], "nu": [0.2, 0.3], "rho": [900, 1100]}


def test_a_bad_proposal_is_refused_with_its_reason():
    """Bounds, empty ranges, lacking parts, unknown classes."""
    bad = (
        ({"E": [2e9, 1e9]}, "min <= max"),
        ({"E": [1e9, float("nan")]}, "min <= max"),
        ({"rho": [900, 1e6]}, "inside"),
        ({"nu": [0.2, 0.5]}, "inside"),
        ({"E": 1e9}, r"wanted \[min, max\]"),
        ({"class": "ectoplasm"}, "not known"),
        ({"rigid": ["middle"]}, "soft or stiff"),
    )
    for change, why in bad:
        with pytest.raises(InputError, match=why):
            proposal_from({"parts": {"pot": {**GOOD, **change}}}, ["pot"])
    for other in (None, [], {"parts": {"lid": GOOD}}, {"parts": {"pot": 3}}):
        with pytest.raises(InputError):
            proposal_from(other, ["pot"])
    with pytest.raises(InputError, match="at most 60"):
        proposal_from({"parts": {"pot": GOOD}, "constraints": ["pot.E > 1"] * 61}, ["pot"])


def test_code_in_a_constraint_is_a_broken_constraint(tmp_path):
    """It is neither run nor believed."""
    trap = tmp_path / "ran"
    line = f"open({str(trap)!r}, 'w') and pot.E > 1"
    found = proposal_from({"parts": {"pot": GOOD}, "constraints": [line]}, ["pot"])
    assert isinstance(found, Proposal)
    assert found.broken() == [line]
    assert not trap.exists()


def test_an_object_is_drawn_again_the_same():
    """Seed and number are all that a log has to keep."""
    a, b = draw_object(3, 17), draw_object(3, 17)
    assert (a.name, a.parts) == (b.name, b.parts)
    assert np.array_equal(a.part, b.part)
    assert set(np.unique(a.part)) - {-1} <= set(range(len(a.parts)))
