"""Laws of the loop: what the agent answers, what the log keeps, how a person goes on."""

import json
from typing import ClassVar

import pytest
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.table import Band, Span
from autophyx_tet.predictors.text.interpreter import ChatEndpoint
from autophyx_tet.research.datasets.audit import auditing, refinement
from autophyx_tet.research.datasets.audit.actor import draw_object, propose_by_table
from autophyx_tet.research.datasets.audit.agent import TOLD, respond
from autophyx_tet.research.datasets.audit.auditing import audit, audit_document, resume
from autophyx_tet.research.datasets.audit.bias import count_biases
from autophyx_tet.research.datasets.audit.endpoint import EndpointActor
from autophyx_tet.research.datasets.audit.findings import Examination, Flaw
from autophyx_tet.research.datasets.audit.log import RangeOutcome, load_log
from autophyx_tet.research.datasets.audit.proposal import End, PartRange, Proposal

WHOLE = Band(Span(1e6, 1e9), Span(0.1, 0.4), Span(100, 900))
OPEN = PartRange(WHOLE)
STATED = PartRange(WHOLE, told=True)
ALIKE = Flaw("indistinguishable", "alike")


def answer(part: PartRange, finding: Flaw, span: Band = WHOLE):
    return respond(Proposal({"leg": part, "seat": OPEN}), [finding], {"leg": span, "seat": WHOLE})


def test_what_is_too_fast_becomes_rigid_and_keeps_its_range():
    found = answer(OPEN, Flaw("cfl", "", End.STIFF, "leg"))
    assert found.proposal.parts["leg"].rigid == (End.STIFF,)
    assert found.proposal.parts["leg"].band == WHOLE
    assert [action.deed for action in found.actions] == ["decouple"]


def test_nothing_soft_to_follow_is_given_up():
    found = respond(Proposal({"leg": OPEN}), [Flaw("cfl", "", End.SOFT, "leg")], {})
    assert not found.actions
    assert "no part of the soft end" in found.reason


def test_an_end_that_fails_moves_towards_the_other_and_not_beyond():
    part, low = OPEN, []
    for _ in range(8):
        found = answer(part, Flaw("inverted", "", End.SOFT, "leg"))
        part = found.proposal.parts["leg"]
        low.append(part.band.E.min)
    assert low == pytest.approx([min(1e6 * 10 ** (k / 2), 1e9) for k in range(1, 9)])
    assert not found.actions  # no room is left: given up


def test_what_is_crushed_at_its_stiff_end_is_relieved_of_its_weight():
    """Less E would crush it more."""
    found = answer(OPEN, Flaw("inverted", "", End.STIFF, "leg"))
    leg = found.proposal.parts["leg"]
    assert [action.deed for action in found.actions] == ["even density"]
    assert leg.value(End.SOFT).rho == leg.value(End.STIFF).rho == pytest.approx(300)
    assert not answer(leg, Flaw("inverted", "", End.STIFF, "leg")).actions


def test_alike_ends_are_widened_then_evened_then_given_up():
    narrow = PartRange(WHOLE._replace(E=Span(1e7, 1.1e7)))
    found = answer(narrow, ALIKE)
    assert [(a.deed, a.part) for a in found.actions] == [("widen", "leg")]
    assert found.proposal.parts["leg"].band == WHOLE
    found = answer(OPEN, ALIKE)
    assert {(a.deed, a.part) for a in found.actions} == {
        ("even density", "leg"),
        ("even density", "seat"),
    }
    last = respond(found.proposal, [ALIKE], {"leg": WHOLE, "seat": WHOLE})
    assert not last.actions
    assert last.reason == "alike"


def test_what_is_told_has_no_range_to_see():
    found = respond(Proposal({"leg": STATED}), [ALIKE], {"leg": WHOLE})
    assert (found.accepted, found.actions, found.reason) == (True, (), TOLD)
    assert found.proposal.parts["leg"] == STATED


class _Fails:
    """An examiner that finds what it is told to, round by round."""

    script: ClassVar[list] = []
    probe = load = None

    def __init__(self, probe, first):
        self.left = list(self.script)

    def examine(self, proposal):
        return Examination(tuple(self.left.pop(0) if self.left else ()), 0.2, (9, 9), (0.2, 0.1))


@pytest.fixture
def fails(monkeypatch):
    """Rounds without a simulation."""
    monkeypatch.setattr(refinement, "Examiner", _Fails)
    monkeypatch.setattr(refinement, "Probe", lambda *_, **__: None)
    monkeypatch.setattr(
        refinement, "_load", lambda *_: {"linear_sag": {"soft": 0.1, "stiff": 0.05}}
    )
    return lambda *script: monkeypatch.setattr(_Fails, "script", list(script))


THING = draw_object(0, 9)  # a hammer: handle and head


def refined():
    return refinement.refine(THING, propose_by_table(THING), actor="table")


def test_outcomes(fails):
    """At once; after a round; never: five rounds at most."""
    stiff = Flaw("cfl", "", End.STIFF, "handle")
    fails()
    assert refined().outcome == RangeOutcome.ACCEPTED
    fails([stiff])
    log = refined()
    assert (log.outcome, log.reason, len(log.rounds)) == (RangeOutcome.REFINED, "decouple", 2)
    assert log.proposal is not None
    assert log.first is not None
    assert log.proposal.parts["handle"].band == log.first.parts["handle"].band
    fails(*[[Flaw("inverted", "", End.SOFT, "handle")]] * 9)
    log = refined()
    assert (log.outcome, len(log.rounds)) == (RangeOutcome.REJECTED, 5)


def test_a_broken_constraint_is_rejected_without_a_simulation():
    """A violation of logic, as the paper calls it."""
    broken = Proposal(propose_by_table(THING).parts, ("handle.E > 1e15",))
    log = refinement.refine(THING, broken, actor="table")
    assert (log.outcome, len(log.rounds), log.load) == (RangeOutcome.REJECTED, 1, {})
    assert "handle.E > 1e15" in log.reason


def test_a_person_goes_on_from_the_log(tmp_path, fails):
    """What was edited is simulated again after the old rounds; what was not stays as it is."""
    fails(*[[Flaw("inverted", "", End.SOFT, "handle")]] * 9)
    path = refined().save(tmp_path)
    log, edited = load_log(path)
    assert not edited
    assert (log.outcome, len(log.rounds)) == (RangeOutcome.REJECTED, 5)
    assert [len(log.rounds) for log in resume(tmp_path)] == [5]
    document = json.loads(path.read_text())
    document["proposal"]["parts"]["handle"]["E"] = [2e9, 3e9]
    path.write_text(json.dumps(document))
    fails()
    again = resume(tmp_path)[0]
    assert (again.outcome, len(again.rounds)) == (RangeOutcome.REFINED, 6)
    assert again.first == log.first
    assert load_log(path)[0].rounds == again.rounds
    document["proposal"]["parts"]["handle"]["E"] = [3e9, 2e9]
    path.write_text(json.dumps(document))
    with pytest.raises(InputError, match="min <= max"):
        resume(tmp_path)


def test_shares_and_queue(tmp_path, fails):
    """The shares sum to one; the rejected are queued; done is done; another seed is refused."""
    fails()
    logs = audit(tmp_path, objects=3)
    document = audit_document(logs)
    assert sum(row["share"] for row in document["shares"]) == pytest.approx(1)
    assert [row["paper"] for row in document["shares"]] == [0.528, 0.383, 0.089]
    assert (tmp_path / auditing.QUEUE).read_text() == ""
    assert audit_document(audit(tmp_path, objects=3)) == document
    with pytest.raises(InputError, match="seed 0"):
        audit(tmp_path, objects=1, seed=1)


def test_an_answer_that_is_no_proposal_is_rejected_with_its_reason(tmp_path, server, fails):
    """The endpoint's answer is data: prose, code, or numbers out of bounds end in the queue."""
    fails()
    actor = EndpointActor(ChatEndpoint(f"http://127.0.0.1:{server.server_port}/v1", "small"))
    parts = propose_by_table(THING).document()["parts"]
    server.answer = json.dumps({"parts": parts, "constraints": ["head.rho > 1"]})
    assert actor(THING).constraints == ("head.rho > 1",)
    assert "handle" in server.asked[2]["messages"][0]["content"]
    server.answer = "Sure! Here you go:"
    log = audit(tmp_path / "a", objects=1, actor=actor)[0]
    assert (log.outcome, log.proposal) == (RangeOutcome.REJECTED, None)
    assert "no JSON" in log.reason
    assert "no JSON" in (tmp_path / "a" / auditing.QUEUE).read_text()


def test_biases_are_counted():
    """One row, an order lost, a single number: each once; the table itself shows none of them."""
    table = propose_by_table(THING)
    assert [bias.found for bias in count_biases([(THING, table)])] == [0, 0, 0]
    handle = table.parts["handle"]
    collapsed = handle.with_end(End.STIFF, 0.0)  # one number: of one row, too
    found = count_biases([(THING, table.with_part("handle", collapsed))])
    assert [bias.found for bias in found] == [1, 0, 1]
    plant = next(t for t in (draw_object(0, n) for n in range(200)) if _orders(t))
    proposal = propose_by_table(plant)
    wide = {n: PartRange(p.band._replace(E=Span(1e2, 1e12))) for n, p in proposal.parts.items()}
    lost = count_biases([(plant, Proposal(wide))])[1]
    assert lost.found == lost.occasions > 0


def _orders(thing) -> bool:
    return any(".E" in line and ">=" not in line for line in propose_by_table(thing).constraints)
