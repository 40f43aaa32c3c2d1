"""A part and its material in every form, joined in every way: none is given another's."""

import itertools

import pytest

# One statement, as people write it: the part first, or what it is of.
FORMS = """
    {m} for the {p}
    use {m} for the {p}
    {m} is used for the {p}
    {m} was chosen for the {p}
    we chose {m} for the {p}
    for the {p}, {m}
    for the {p} use {m}
    for the {p} we took {m}
    {p}: {m}
    {p} = {m}
    {p} -> {m}
    {p} | {m}
    {p} - {m}
    {p} in {m}
    a {p} of {m}
    the {p} from {m}
    {m} {p}
    a {m} {p}
    {p} {m}
    {p} ({m})
    {m} ({p})
    the {p} is {m}
    the {p} is made of {m}
    the {p} must be {m}
    the {p} has been made of {m}
    the {p} was cut from {m}
    the {p} consists of {m}
    the {p} gets {m}
    the {p} needs {m}
    treat the {p} as {m}
    make the {p} out of {m}
    I want the {p} to be {m}
    set the {p} to {m}
    assign {m} to the {p}
    {m} on the {p}
    {m} goes into the {p}
    {m} makes up the {p}
    {m} was used to make the {p}
    with a {p} of {m}
    with {m} as the {p}
    {m} as {p}
    the {p}'s material is {m}
    the material of the {p} is {m}
"""
JOINTS = (
    "{}, {}",
    "{}; {}",
    "{} and {}",
    "{}. {}",
    "{}, and {}",
    "{}\\n{}",
    "{}, while {}",
    "{} but {}",
)
MATTER = ("oak", "brass", "6061-T6", "soft foam", "polypropylene", "rubber")
PARTS = ("lid", "frame", "knob", "panel", "wheel")


@pytest.mark.parametrize("form", [line.strip() for line in FORMS.strip().splitlines()])
def test_each_part_has_its_own_material(agree, form):
    turn = itertools.count()
    agree("\n".join(_two(form, joint, next(turn)) for joint in JOINTS))
    agree("\n".join(_three(form, next(turn)) for _ in range(2)))


def _two(form, joint, turn):
    first, second, _ = _drawn(turn)
    text = joint.format(form.format(p=first[0], m=first[1]), form.format(p=second[0], m=second[1]))
    return f"{text} => {first[0]}: {first[1]}; {second[0]}: {second[1]}"


def _three(form, turn):
    """Three statements, of which the first is of two parts."""
    first, second, third = _drawn(turn)
    more = next(part for part in PARTS if part not in (first[0], second[0], third[0]))
    both = f"{first[0]} and {'the ' * ('the {p}' in form)}{more}"
    said = [form.format(p=both, m=first[1])]
    said += [form.format(p=part, m=matter) for part, matter in (second, third)]
    return (
        f"{', '.join(said)} => {first[0]}, {more}: {first[1]}; {second[0]}: {second[1]};"
        f" {third[0]}: {third[1]}"
    )


def _drawn(turn):
    """Three parts with a material each, others at every turn."""
    return [
        (PARTS[(turn + i) % len(PARTS)], MATTER[(2 * turn + i) % len(MATTER)]) for i in range(3)
    ]


def test_words_that_point_to_parts_named_before(agree):
    agree("""
        The lid and the cup: the former is granite, the latter brass => lid: granite; cup: brass
        There are a pane and a lid. The first is glass, the second oak => pane: glass; lid: oak
        Lid, pane, rail. The first is oak, the third brass => lid: oak; rail: brass
        The tank is polypropylene; the lid is to be made of it as well => tank, lid: polypropylene
        the frame is rubber, likewise the base => frame, base: rubber
        The cup is brass. So is the saucer. => cup, saucer: brass
        like the wheel, the panel is oak => wheel, panel: oak
        the lid is ABS like the body, the axle is steel => lid, body: ABS; axle: steel
    """)


def test_a_question_and_its_answer(agree):
    agree("""
        The lid? Brass. The box? Oak. => lid: brass; box: oak
        What is the tray? Oak. And the arm? Rubber. => tray: oak; arm: rubber
        Could the tray be oak? => tray: oak
    """)


def test_contrasts_and_exchanges(agree):
    agree("""
        unlike the knob, which is leather, the base is titanium => knob: leather; base: titanium
        the shelf, not the back, is oak; the back is nylon => shelf: oak; back: nylon
        the frame not in pine but in beech => frame: beech
        we changed the arm from brass to oak => arm: oak
        the shelf is now beech, it was rubber before => shelf: beech
        the ABS panel holds the base, which is leather => panel: ABS; base: leather
        oak for everything but the seat, which gets plywood => rail: oak; seat: plywood
        the client asked for oak in the lid and plywood in the knob => lid: oak; knob: plywood
        nylon: bracket, shelf; rubber: leg => bracket, shelf: nylon; leg: rubber
        frame oak | saddle leather => frame: oak; saddle: leather
        seat is made form pine, legs oak => seat: pine; leg: oak
        Apart from the rubber tyre the whole bike is oak => rail: oak; tyre: rubber
        nylon makes the liner, and brass forms the knob => liner: nylon; knob: brass
        Copper? No: brass. That goes for the bell. The cup is oak => bell: brass; cup: oak
    """)


NUMBERS = """
    {p}: E = {E} GPa, rho = {rho} kg/m3
    {p}: {E} GPa / 0.31 / {rho} kg/m3
    {E} GPa and {rho} kg/m3 for the {p}
    the {p} is oak; it has E = {E} GPa and {rho} kg/m3
    the {p} is oak, which has E = {E} GPa and {rho} kg/m3
    oak with E = {E} GPa and {rho} kg/m3 for the {p}
    the Young's modulus of the {p} is {E} GPa and its density is {rho} kg/m3
    Young's modulus of the {p}: {E} GPa; density: {rho} kg/m3
    for the {p} take {E} GPa and {rho} kg/m3
    for the {p} E = {E} GPa, rho = {rho} kg/m3
    set E of the {p} to {E} GPa and rho to {rho} kg/m3
"""


@pytest.mark.parametrize("form", [line.strip() for line in NUMBERS.strip().splitlines()])
@pytest.mark.parametrize("joint", ["{}; {}", "{}, {}", "{}. {}"])
def test_each_part_has_its_own_numbers(clauses_of, form, joint):
    wanted = {"lid": {"E": 11e9, "rho": 640.0}, "frame": {"E": 14e9, "rho": 905.0}}
    said = (form.format(p=p, E=v["E"] / 1e9, rho=v["rho"]) for p, v in wanted.items())
    found = clauses_of(joint.format(*said), list(wanted))
    for part, clauses in found.items():
        numbers = {q.measure: q.value for clause in clauses for q in clause.numbers}
        numbers.pop("nu", None)  # of one form
        assert numbers == pytest.approx(wanted[part])


@pytest.mark.parametrize(
    ("said", "factor"),
    [
        ("three times as stiff", 3),
        ("half as stiff", 0.5),
        ("twice as stiff", 2),
        ("20 % stiffer", 1.2),
        ("20 % softer", 0.8),
    ],
)
@pytest.mark.parametrize("form", ["the lid is oak and the rail is {}", "lid: oak, rail {}"])
def test_a_comparison_may_leave_out_with_what(clauses_of, form, said, factor):
    clauses = clauses_of(form.format(said), ["lid", "rail"])["rail"]
    assert [(c.factor, c.exact) for clause in clauses for c in clause.comparisons] == [
        (factor, True)
    ]


def test_numbers_as_programs_write_them(clauses_of):
    """Each part's own three, named by the symbol's index too; the hub has what the rim has."""
    text = "core = (7e10, 0.33, 2700); E_rim 210 GPa, nu_rim .29, rho_rim 7860; hub same as rim"
    found = clauses_of(text, ["core", "rim", "hub"])
    steel = {"E": 210e9, "nu": 0.29, "rho": 7860.0}
    wanted = {"core": {"E": 7e10, "nu": 0.33, "rho": 2700.0}, "rim": steel, "hub": steel}
    for part, clauses in found.items():
        assert {q.measure: q.value for c in clauses for q in c.numbers} == wanted[part]
