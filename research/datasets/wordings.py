"""How people say that a thing is soft or stiff, light or dense: wordings by level.

Every fifth wording of a level is held out of training. A wording completes "the seat is ..." if
it starts with "~", and "the seat ..." otherwise.
"""

from __future__ import annotations

HELD_OUT_EVERY = 5


_TEXT = {
    "very soft": """~very soft; ~extremely soft; ~super squishy; ~ultra soft; ~as soft as can be;
        ~incredibly floppy; ~very flexible; ~extremely bendy; ~exceptionally pliable;
        ~really squashy; gives way at the slightest touch; ~limp and very soft; ~utterly limp;
        ~very easy to deform; collapses under a finger; ~extremely compliant; ~very floppy;
        ~soft as jelly; ~super soft and yielding; ~remarkably soft; ~extraordinarily flexible;
        sags under its own weight; ~very squishy; ~almost without any stiffness; ~so very soft""",
    "soft": """~soft; ~flexible; ~squishy; ~pliable; ~bendy; ~supple; ~fairly soft; ~quite flexible;
        ~easy to bend; ~somewhat soft; bends easily; ~yielding; ~rather pliant; ~softish;
        ~elastic and soft; gives a little when pressed; ~springy; ~compliant; ~cushiony;
        ~on the soft side; flexes readily; ~deformable; ~rather soft; ~moderately flexible;
        ~easily squeezed""",
    "medium": """~of medium stiffness; ~neither soft nor stiff; ~moderately stiff; ~of average
        stiffness; ~medium firm; ~of normal stiffness; ~halfway between soft and hard; ~of typical
        stiffness; ~ordinary in stiffness; ~of intermediate stiffness; has a medium stiffness; ~in
        the middle between soft and rigid; ~averagely stiff; ~medium hard; has an average firmness;
        ~of usual stiffness; ~not too soft and not too stiff; ~of middling stiffness; ~normally
        stiff; ~moderately rigid; has a moderate stiffness; ~of common stiffness; ~medium rigid;
        has a typical firmness; ~balanced between soft and stiff""",
    "stiff": """~stiff; ~firm; ~rigid; ~hard; ~sturdy; ~fairly stiff; ~quite rigid; ~hard to bend;
        ~rather firm; ~solid and firm; barely bends; ~unyielding; ~inflexible; ~on the stiff side;
        resists bending; ~robustly firm; ~pretty stiff; ~quite hard; keeps its shape; ~tough and
        stiff; ~rather rigid; ~quite firm; ~not flexible; ~resistant to bending; ~strong and
        stiff""",
    "very stiff": """~very stiff; ~extremely rigid; ~super hard; ~ultra stiff; ~as stiff as can be;
        ~incredibly hard; ~very rigid; ~exceptionally firm; ~totally inflexible; ~completely rigid;
        does not bend at all; ~rock hard; ~extremely hard; ~absolutely unyielding; cannot be bent;
        ~remarkably stiff; ~extraordinarily rigid; ~perfectly rigid; ~very hard; ~hard as rock;
        never
        deforms; ~impossible to bend; ~so very stiff; ~immensely stiff; ~extremely stiff""",
    "brittle": """~brittle; ~fragile; breaks easily; ~prone to cracking; shatters when dropped;
        ~crisp and brittle; snaps rather than bends; ~easily broken; cracks easily; ~crumbly and
        brittle; ~very brittle; ~delicate and breakable; splinters under load; ~rather fragile;
        ~quick to crack; fractures without warning; ~breakable; ~extremely fragile; chips easily;
        ~hard but brittle; snaps under load; ~likely to shatter; breaks like a biscuit;
        ~easily cracked; shatters on impact""",
    "very light": """~very light; ~extremely lightweight; ~feather light; ~ultra light; ~as light as
        air; ~incredibly light; weighs next to nothing; ~super lightweight; ~remarkably light;
        ~exceptionally light; ~almost weightless; weighs hardly anything; ~extraordinarily light;
        ~light as a feather; ~of very low density; ~very lightweight; has a very low density;
        ~so very light; ~of minimal weight; ~barely heavier than air; ~amazingly light; ~ultra low
        in density; ~surprisingly weightless; ~very airy; ~extremely light""",
    "light": """~light; ~lightweight; ~fairly light; ~quite light; ~not heavy; ~of low density;
        ~rather light; ~easy to lift; ~somewhat light; ~low in weight; ~on the light side; weighs
        little; has a low density; ~pretty light; ~light in weight; ~moderately light; ~airy;
        ~easy to carry; ~rather lightweight; weighs less than usual; ~lighter than average; ~of
        little weight; ~porous and light; ~quite lightweight; has little weight""",
    "average weight": """~of average weight; ~of medium density; ~neither light nor heavy;
        ~of normal
        weight; ~medium heavy; ~of typical density; has an average density; ~of ordinary weight;
        ~moderately heavy; ~of usual density; has a medium weight; ~not too light and not too heavy;
        ~of intermediate density; has a normal density; ~averagely heavy; ~of common weight; has a
        typical weight; ~middling in weight; ~of moderate density; ~normally heavy; ~in the middle
        between light and heavy; has a moderate weight; ~of standard density; ~halfway between light
        and dense; has an ordinary density""",
    "dense": """~dense; ~heavy; ~fairly heavy; ~quite dense; ~weighty; ~of high density; ~rather
        heavy; ~hard to lift; ~somewhat heavy; ~compact and heavy; ~on the heavy side; weighs a lot;
        has a high density; ~pretty heavy; ~high in weight; ~solid and dense; ~hefty; ~heavier than
        average; ~rather dense; weighs more than usual; ~quite heavy; ~of great weight; ~packed and
        dense; ~burdensome to carry; has much weight""",
    "very dense": """~very dense; ~extremely heavy; ~super dense; ~ultra dense; ~as heavy as can be;
        ~incredibly heavy; weighs a ton; ~exceptionally dense; ~remarkably heavy; ~extraordinarily
        dense; ~very heavy; ~heavy as lead; ~of very high density; ~immensely heavy; has a very high
        density; ~so very heavy; ~tremendously heavy; ~massively dense; ~enormously heavy; ~almost
        too heavy to lift; ~extremely dense; ~super heavy; ~dense as can be; ~amazingly heavy;
        ~exceedingly heavy""",
    "floats": """floats; floats on water; ~buoyant; ~able to float; would float; stays on top of the
        water; does not sink; bobs on water; ~lighter than water; rises to the surface; keeps
        afloat; swims on water; ~less dense than water; will float; can float on water; never sinks;
        ~unsinkable; drifts on the surface; ~buoyant in water; floats easily; floats like a cork;
        stays afloat; would not sink in water; ~so light that it floats; pops up in water""",
    "sinks": """sinks; sinks in water; might sink to the bottom; does not float; would sink; goes
        under in water; ~heavier than water; drops to the bottom of a pool; ~denser than water; will
        sink; sinks like a stone; cannot float; ~not buoyant; falls to the bottom in water; sinks
        quickly; would go down in water; ~unable to float; plunges to the bottom; never floats;
        sinks right away; ~so dense that it sinks; settles on the bottom; would not stay afloat;
        sinks to the ground; goes straight to the bottom""",
}


# Combined freely, for training alone: degree and adjective, and what a thing is compared with.
_VERY = (
    "very extremely super ultra incredibly exceptionally really remarkably extraordinarily "
    "immensely utterly hugely terribly"
).split()
_SOMEWHAT = "fairly quite rather somewhat pretty reasonably".split()
_SOFT = "soft flexible bendy pliable squashy floppy supple yielding compliant springy".split()
_STIFF = "stiff firm rigid hard sturdy inflexible unyielding tough".split()
_LIGHT, _HEAVY = ["light", "lightweight", "airy"], ["heavy", "dense", "weighty", "hefty"]
_BRITTLE = "brittle fragile breakable delicate crumbly".split()
_GRADED = {
    "very soft": (_VERY, _SOFT),
    "soft": (_SOMEWHAT, _SOFT),
    "stiff": (_SOMEWHAT, _STIFF),
    "very stiff": (_VERY, _STIFF),
    "very light": (_VERY, _LIGHT),
    "light": (_SOMEWHAT, _LIGHT),
    "dense": (_SOMEWHAT, _HEAVY),
    "very dense": (_VERY, _HEAVY),
    "brittle": (_VERY + _SOMEWHAT, _BRITTLE),
}
# Most are materials of the table: what is compared with one is not made of it.
_LIKE = {
    "very soft": ("soft", "butter dough cotton wool foam snow silk sponge velvet clay cake"),
    "very stiff": ("hard", "steel iron granite glass stone concrete oak brick bone marble"),
    "very light": ("light", "cork foam paper balsa straw snow silk cotton wool bread"),
    "very dense": ("heavy", "iron gold stone steel concrete granite brick bronze marble"),
}
_IN_WATER = {
    "floats": ("floats", "wood foam balsa wax ice bamboo"),
    "sinks": ("sinks", "iron steel brick gold concrete bronze"),
}


def wordings(level: str, *, held_out: bool) -> list[str]:
    """Wordings of a level: those of training, or the fifth of the listed that is held out."""
    words = [" ".join(word.split()) for word in _TEXT[level].split(";")]
    kept = [w for i, w in enumerate(words) if i % HELD_OUT_EVERY == 2]
    if held_out:
        return kept
    listed = [w for w in words if w not in kept]
    return 2 * listed + [w for w in _combined(level) if w not in words]


def _combined(level: str) -> list[str]:
    """Wordings made of degree and adjective, and comparisons."""
    degrees, adjectives = _GRADED.get(level, ((), ()))
    out = [f"~{degree} {adjective}" for degree in degrees for adjective in adjectives]
    adjective, others = _LIKE.get(level, ("", ""))
    for other in others.split():
        out += [f"~{adjective} as {other}", f"~as {adjective} as {other}", f"~{other} {adjective}"]
    verb, others = _IN_WATER.get(level, ("", ""))
    return out + [f"{verb} like {other}" for other in others.split()]


def sentence(subject: str, wording: str) -> str:
    """Return the clause that says a wording of a subject: "the seat", "~soft": the seat is soft."""
    return f"{subject} is {wording[1:]}" if wording.startswith("~") else f"{subject} {wording}"


def adjective(wording: str) -> str | None:
    """Return the wording as it can stand before a noun ("very soft"), or None if it cannot."""
    words = wording.removeprefix("~").split()
    plain = wording.startswith("~") and len(words) <= 2 and words[0] not in ("of", "on", "in", "as")
    return " ".join(words) if plain and words[-1] not in ("easy", "hard to", "stiffness") else None
