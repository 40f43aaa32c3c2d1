"""Words by what they say of a thing: how stiff or heavy it is, how it breaks, how much so.

Plain English word lists, closed: the lexicon scores them, and the reader of statements and the
speaker of plain words tell them from the words for parts and materials.
"""

from __future__ import annotations

SOFT = frozenset(
    "soft softer softish squishy squashy squeezable plush flexible bendy pliable pliant floppy "
    "supple elastic springy limp yielding cushiony compliant deformable spongy stretchy "
    "flabby tender mushy malleable bouncy rubbery weak slack doughy".split()
)
STIFF = frozenset(
    "stiff stiffer rigid firm hard harder inflexible unyielding sturdy tough solid robust strong "
    "unbending stout taut steely hardened rocklike".split()
)
LIGHT = frozenset("light lighter lightweight airy weightless feathery porous hollow fluffy".split())
HEAVY = frozenset(
    "heavy heavier dense denser weighty hefty burdensome ponderous massive leaden".split()
)
BEND = frozenset(
    "bend bends bending bent flex flexes deform deforms squeeze squeezed compress press pressed "
    "sag sags give gives yield yields dent dents collapse collapses stretch stretches fold "
    "folds".split()
)
BRITTLE = frozenset(
    "brittle fragile break breaks broken breakable shatter shatters crack cracks cracked cracking "
    "snap snaps splinter splinters fracture fractures chip chips crumbly crumble crumbles delicate "
    "crisp frail".split()
)
FLOAT = frozenset(
    "float floats floating afloat buoyant bob bobs unsinkable drift drifts swim swims".split()
)
SINK = frozenset("sink sinks sinking plunge plunges submerge submerges".split())
STRONGER = frozenset(
    "very extremely super ultra incredibly exceptionally really remarkably utterly extraordinarily "
    "totally completely absolutely perfectly immensely tremendously massively enormously "
    "exceedingly amazingly surprisingly highly hugely terribly so never cannot impossible "
    "slightest own air ton lead jelly feather almost minimal nothing anything all too "
    "collapse collapses".split()
)
MODERATE = frozenset(
    "medium moderate moderately average averagely typical normal normally usual ordinary common "
    "intermediate middling middle halfway neither standard balanced between".split()
)
SOMEWHAT = frozenset("fairly quite rather somewhat pretty reasonably".split())
ADVERBS = frozenset(word for word in STRONGER if word.endswith("ly")) | frozenset(
    "very super ultra so almost moderately averagely normally medium not easily quick prone".split()
)
ADJECTIVES = (
    SOFT
    | STIFF
    | LIGHT
    | HEAVY
    | frozenset("brittle fragile breakable crumbly delicate crisp frail buoyant unsinkable".split())
)
MANNER = ADJECTIVES | ADVERBS | SOMEWHAT
