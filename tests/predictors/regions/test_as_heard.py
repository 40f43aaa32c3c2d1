"""What the product hears of a sentence, for the region network to learn from."""

from autophyx_tet.fem.table import load_table
from autophyx_tet.research.datasets.natural import Meant, Natural, as_heard


def test_what_is_heard_means_the_slots_of_what_was_meant():
    said = (Meant("lid", "brass", ("a",)), Meant("side and floor", "cork", ("b", "c")))
    text = "A casket, its lid in brass, sides and floor of cork."
    heard = as_heard(Natural("Scopia", 0, text, said), load_table())
    assert [(one.material, one.slots) for one in heard] == [("brass", ("a",)), ("cork", ("b", "c"))]
    assert heard[0].part == "lid"


def test_what_nobody_meant_means_no_slot():
    said = (Meant("lid", "brass", ("a",)), Meant("body", "cork", ("b",)))
    text = "A casket on a marble table, its lid in brass, the body of cork."
    heard = as_heard(Natural("Scopia", 0, text, said), load_table())
    assert {one.material: one.slots for one in heard} == {
        "marble": (), "brass": ("a",), "cork": ("b",),
    }  # fmt: skip
