"""Laws of the critic, with encoders that see all and nothing."""

import numpy as np
import pytest
from autophyx_tet.research.datasets.audit import critic as module
from autophyx_tet.research.datasets.audit.actor import AuditObject, draw_object, propose_by_table
from autophyx_tet.research.datasets.audit.critic import COHERENT, Review, critic_of, srgb_of_lab

PLANT = draw_object(0, 9)  # replaced in shape: two boxes, one on the other


def two_boxes() -> AuditObject:
    """An object of two parts, the lower and the upper half of a column."""
    part = np.full((16, 16, 16), -1)
    part[5:11, 5:11, :8], part[5:11, 5:11, 8:] = 0, 1
    return AuditObject(0, 9, PLANT.name, PLANT.parts, part)


class Sees:
    """An encoder whose features are the picture's colours, and whose words are those of parts."""

    name, dim = "sees", 3

    def __init__(self, words):
        self.words = words

    def dense(self, images):
        shown = images[:, 4::8, 4::8, :3] - 0.5
        return shown / np.maximum(np.linalg.norm(shown, axis=-1, keepdims=True), 1e-6)

    def text(self, sentences):
        found = np.array([self.words[s] for s in sentences], dtype=float) - 0.5
        return found / np.linalg.norm(found, axis=1, keepdims=True)


RED, BLUE = (0.9, 0.1, 0.1), (0.1, 0.1, 0.9)


@pytest.mark.slow
def test_a_critic_that_sees_the_parts_lets_them_pass_and_a_blind_one_does_not(monkeypatch):
    """Red below, blue above: words that mean red and blue are right; words alike are not sure."""
    thing = two_boxes()
    painted = np.array([RED, BLUE, (0.5, 0.5, 0.5)])[thing.part]
    monkeypatch.setattr(module, "_painted", lambda _: painted)
    proposal = propose_by_table(thing)
    low, high = (part.synonyms for part in proposal.parts.values())
    seen = critic_of(Sees({**dict.fromkeys(low, RED), **dict.fromkeys(high, BLUE)}))
    found = seen(thing, proposal)
    assert found is not None
    assert found.right > 0.9  # cells at the seam see both
    assert found.accepted
    blind = critic_of(Sees(dict.fromkeys([*low, *high], RED)))(thing, proposal)
    assert blind is not None
    assert not blind.accepted


def test_one_part_is_not_judged():
    """There is nothing to tell apart."""
    thing = two_boxes()
    name = next(iter(thing.parts))
    alone = AuditObject(0, 9, "box", {name: thing.parts[name]}, np.minimum(thing.part, 0))
    assert critic_of(Sees({}))(alone, propose_by_table(alone)) is None


def test_the_threshold_decides():
    """A person looks below it."""
    assert Review(("a",), COHERENT, 1.0).accepted
    assert not Review(("a",), COHERENT - 1e-9, 1.0).accepted


def test_lab_is_what_cie_says():
    """White, black and mid grey of D65; sRGB's red is L* 53.24, a* 80.09, b* 67.20 (Lindbloom)."""
    assert srgb_of_lab(np.array([100.0, 0, 0])) == pytest.approx((1, 1, 1), abs=2e-3)
    assert srgb_of_lab(np.array([0.0, 0, 0])) == pytest.approx((0, 0, 0), abs=1e-6)
    assert srgb_of_lab(np.array([53.585, 0, 0])) == pytest.approx([0.5] * 3, abs=2e-3)
    assert srgb_of_lab(np.array([53.24, 80.09, 67.20])) == pytest.approx((1, 0, 0), abs=5e-3)
