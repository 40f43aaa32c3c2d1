"""What a part bears, hits or stands on is of no part, unless it is one; it is told."""

from autophyx_tet.predictors.text.reader import parse


def test_what_stands_on_a_part_or_under_it_is_not_its_matter(agree):
    agree("""
        the boards are pine, the sides are steel; board2 carries books => board1, board2: pine
        the top is oak and carries a marble bust => top: oak; leg1: -
        the legs stand on a concrete floor and are steel, the top is ash => leg1: steel; top: ash
        legs: oak, resting on rubber mats; top: pine => leg1: oak; top: pine
        top of slate, weighed down with lead => top: slate; leg1: -
        the head is steel; it hits glass => head: steel; handle: -
        a brass base bolted to a concrete wall, the shade is linen => base: brass; shade: linen
        the blade strikes a brass bell, it is bronze; grip oak => blade: bronze; grip: oak
        a steel blade for slicing cork, walnut grip => blade: steel; guard: -; grip: walnut
    """)


def test_what_is_borne_may_be_another_part(agree):
    agree("""
        the top is a sheet of glass that lies on steel legs => top: glass; leg1, leg2: steel
        the frame carries a glass top, the legs are beech => top: glass; leg1: beech
        a memory foam mattress lying on slats of beech => mattress: memory foam; slat: beech
        the plate is brass, it stands on a slab of concrete => plate: brass; slab: concrete
        the base holds up a paper shade; base marble => base: marble; shade: paper
        stand of brass supporting a copper tank => stand: brass; tank: copper
    """)


def test_what_is_left_out_so_is_told(clauses_of, table):
    (said,) = clauses_of("the top is oak and carries a marble bust", ["top"])["top"]
    assert "marble" in " ".join(said.doubts)
    assert "glass" in parse("it hits glass; the head is steel", table, ["head"]).unread


def test_an_article_is_no_label_of_a_part(agree):
    """Of parts "leg_a", "leg_b" the "a" of "a marble plinth" names none."""
    agree("""
        pine seat glued to a marble plinth => seat: pine; leg_a: -; leg_b: -
        a pine seat, a brass leg => seat: pine; leg_a, leg_b: brass
        leg a is oak, leg b brass => leg_a: oak; leg_b: brass
        plate A: steel, plate B: brass => plate_a: steel; plate_b: brass
    """)
