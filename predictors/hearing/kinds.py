"""Kinds of material by the words in a name of an asset: "blackMetal_02", "madera oscura"."""

from __future__ import annotations

import re

# Whole words, and stems that also count inside a word ("whiteplastic"); the first kind that matches
# is taken, so that "fiberglass" is plastic and "glass_frame_metal" is metal's, not glass's.
_WORDS = {
    "rubber": "rubber tire tires tyre tyres tread goma",
    "leather": "leather cuir cuero skai",
    "ceramic": "ceramic ceramica porcelain tile tiles loza enamel",
    "stone": "stone stones marble granite concrete rock brick bricks cement pietra piedra",
    "paper": "paper cardboard papel carton book books",
    "plant": "leaf leaves grass flower flowers petal plant cactus foliage hoja hojas petalred",
    "plastic": "plastic plastics plastico plast plastique lastic vinyl pvc acrylic nylon fiberglass"
    " polyester melamine",
    "metal": "metal metall metalic metallic metalico chrome cromo aluminum aluminium alu alumain"
    " steel stainless inox acier acero iron brass gold silver argent copper bronze zinc wire tin",
    "glass": "glass vidro vidrio cristal crystal mirror verre windshield window pane lens espejo",
    "wood": "wood wooden madera fusta bois legno holz oak pine walnut teak teck bamboo cherry"
    " maple mahogany birch beech wenge venge ash parquet plywood redwood rattan"
    " trunk branch branches",
    "fabric": "fabric textile textil tela telas cloth cotton wool curtain curtains towel toalla"
    " felt carpet rug pillow cushion coixi mattress matress linen canvas velvet blanket shirt pants"
    " sheet tissu tejido",
}
_INSIDE = {
    "rubber": ("rubber",),
    "leather": ("leather",),
    "plastic": ("plastic", "fiberglass"),
    "metal": ("metal", "chrome", "alumin"),
    "glass": ("glass",),
    "wood": ("wood",),
    "fabric": ("fabric", "textile"),
}
KINDS = tuple(_WORDS)
_KIND_OF = {word: kind for kind, words in _WORDS.items() for word in words.split()}
_CHAFF = frozenset(
    "jpg jpeg png tga texture textured tex map mat material generic sweethome".split()
)


def bare_words(name: str) -> list[str]:
    """Lower-case words of a name, without digits, file suffixes and the like."""
    spaced = re.sub(r"(?<=[a-zà-ÿ])(?=[A-ZÀ-Ý])", " ", name)
    words = re.findall(r"[^\W\d_]+", spaced.lower())
    return [word for word in words if len(word) > 1 and word not in _CHAFF]


def kind_of(name: str) -> str | None:
    """Kind of material that a name speaks of, or None."""
    words = bare_words(name)
    found = {_KIND_OF[word] for word in words if word in _KIND_OF}
    if not found:
        found = {k for k, stems in _INSIDE.items() for s in stems if any(s in w for w in words)}
    return next((kind for kind in KINDS if kind in found), None)
