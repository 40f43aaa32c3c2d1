"""Word lists of the text understanding: small, closed sets, by their role in a sentence.

All words are stems as ``vocabulary.stem`` makes them (singular, lower case).
"""

from __future__ import annotations

# Between clauses. "and" and "," may also continue a list of parts ("oak legs and back").
BREAKS = frozenset(". ; while whereas but then except".split())
JOINTS = frozenset(
    ", and & + plus with has have having featuring whose on over atop under beneath for "
    "hold holding support supporting".split()
)
# Between a part and its material: "legs are oak", "cushion of foam", "seat upholstered in vinyl".
LINKS = frozenset(
    "is are be was were being = made make built of from in out crafted constructed carved cast "
    "forged moulded molded filled stuffed padded upholstered covered wrapped lined consist "
    "consisting".split()
)
PARTICIPLES = frozenset("filled stuffed padded upholstered covered wrapped lined made".split())
DETERMINERS = frozenset(
    "the a an it its their thi these those each every both all my your our one two three four five "
    "six seven eight nine ten twelve some".split()
)
NEGATIONS = frozenset("not no non without instead than".split())
# Words that say nothing of a part or a material: how it looks, how big it is, how much.
FILLERS = frozenset(
    "x use using very really quite extremely rather somewhat slightly so too also entirely "
    "completely fully "
    "mostly mainly only just which that who to by at as them there can will should "
    "red green blue yellow black white grey gray brown pink purple dark bright pale beige "
    "old new modern antique vintage rustic classic small big large huge tiny tall short long wide "
    "thick thin round square flat narrow high low nice beautiful elegant simple solid hollow whole "
    "entire polished brushed painted matte shiny glossy smooth rough comfortable comfy cheap "
    "expensive strong weak real genuine natural artificial fake".split()
)
# Everything the sentence did not name.
REST = frozenset("everything else rest other remaining remainder anything".split())
# Names of whole objects: "oak chair" does not speak of one part among several.
OBJECTS = frozenset(
    "chair stool armchair sofa couch bench table desk lamp bed cupboard cabinet wardrobe shelf "
    "plant bonsai tree ball cube box sphere toy object thing item piece model asset furniture "
    "car vehicle house bicycle bottle mug cup vase hammer knife tool shoe boot "
    "duck bear statue sculpture part component".split()
)
# The load-bearing whole: such a clause also takes the parts that nothing else claims.
STRUCTURE = frozenset("frame structure body skeleton chassi framework carcass main".split())

# How stiff or dense; the table's own adjectives for each level, tried in this order.
LEVELS = {
    "soft": "soft softer squishy squashy squeezable plush flexible bendy pliable floppy supple "
    "elastic springy",
    "stiff": "stiff stiffer rigid firm hard inflexible unyielding sturdy",
    "dense": "dense heavy",
    "light": "light lightweight",
}
LEVEL_OF = {word: level for level, words in LEVELS.items() for word in words.split()}
ALIAS_OF_LEVEL = {
    "soft": ("soft", "flexible"),
    "stiff": ("firm", "stiff", "hard", "rigid"),
    "dense": ("dense", "heavy"),
    "light": ("light", "lightweight"),
}
# Where in [min, max] of E (log) an adjective points when the family has no row of its own for it.
ALPHA_OF_LEVEL = {"soft": 0.1, "stiff": 0.9}

# Nouns that only repeat the family of the material before them: "oak wood", "ABS plastic".
FAMILIES = frozenset(
    "wood wooden metal plastic fabric cloth textile rubber glass ceramic stone paper alloy".split()
)
# Parts that people call by each other's names.
SYNONYMS = [
    frozenset(group.split())
    for group in (
        "leg foot feet",
        "seat cushion sitting seating pad seatpad",
        "back backrest backboard",
        "top tabletop desktop tabletop worktop countertop slab plate",
        "handle grip knob haft hilt",
        "leaf foliage crown canopy frond leafage greenery",
        "pot planter vase flowerpot container",
        "trunk stem stalk",
        "soil earth dirt ground",
        "shade lampshade",
        "wheel tire tyre caster castor",
        "base foot stand pedestal plinth",
        "pole rod post column shaft stand",
        "arm armrest",
        "door panel leaf",
        "lid cover cap",
        "frame structure skeleton chassi framework body",
        "mattress matress",
        "pillow cushion",
        "head blade",
    )
]
# What a frame usually is when no part is called so: used only where no better word matched.
FRAME_PARTS = frozenset(
    "leg base stand support structure back arm armrest backrest rail rung "
    "stretcher crossbar".split()
)

# What such parts are usually made of, by category: tells parts apart that only a material names.
USUAL = {
    (STRUCTURE | {"leg", "foot", "base", "pole"}): {
        "metal": 0.5, "wood": 0.4, "plastic": 0.2,
    },
    frozenset("seat cushion pillow mattress back pad".split()): {
        "fabric and leather": 0.5, "soft foam": 0.5, "wood": 0.2,
    },
}  # fmt: skip
# Words in names that exporters write: they say nothing of the part.
EXPORTED = frozenset(
    "mat material texture default mesh node group geometry geom sweethome d color colour lambert "
    "phong blinn surface polygon mtl none root scene instance".split()
)

# Material words of other languages in names of asset parts -> a name in the table.
FOREIGN = {
    word: name
    for name, words in {
        "wood": "legno bois holz madera madeira hout drewno tre trä",
        "oak": "rovere chene chêne eiche roble eik",
        "pine": "pino kiefer",
        "beech": "faggio hetre hêtre buche",
        "walnut": "noce noyer nussbaum nogal",
        "steel": "acciaio acier stahl acero aço staal",
        "metal": "metallo métal metall metaal metallico metalic metalique",
        "iron": "ferro eisen hierro ijzer",
        "cast iron": "ghisa fonte gusseisen",
        "aluminium": "alluminio aluminio",
        "brass": "ottone laiton messing laton latón",
        "copper": "rame cuivre kupfer cobre",
        "chrome": "cromo chrom cromato",
        "glass": "vetro verre glas vidrio vidro szklo",
        "mirror": "specchio miroir spiegel espejo",
        "fabric": "tessuto tissu stoff tejido tecido tela toile stof",
        "cotton": "cotone coton baumwolle algodon algodón",
        "wool": "lana laine wolle",
        "plastic": "plastica plastique plastik kunststoff plastico plástico",
        "leather": "cuoio pelle cuir leder cuero couro",
        "rubber": "gomma caoutchouc gummi caucho goma borracha",
        "foam": "schiuma mousse schaum schaumstoff espuma",
        "ceramic": "ceramica céramique ceramique keramik cerámica",
        "porcelain": "porcellana porcelaine porzellan porcelana",
        "marble": "marmo marbre marmor mármol marmol",
        "stone": "pietra pierre stein piedra pedra",
        "concrete": "calcestruzzo beton béton hormigon hormigón cemento",
        "paper": "carta papier papel",
        "cardboard": "cartone karton",
        "soil": "terra terre erde tierra",
        "leaf": "foglia foglie feuille feuilles blatt hoja hojas",
        "wicker": "vimini osier weide mimbre",
        "plaster": "gesso platre plâtre gips yeso",
    }.items()
    for word in words.split()
}
