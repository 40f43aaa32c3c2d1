"""What parts and whole things are called, and what parts may be made of."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from ...fem.scene.materials import NU_CAP, Material, MaterialValue, load_table

# Part: its words | the materials it may plausibly have, as phrases of the table.
_PARTS = """
leg: leg, legs, chair legs | oak, pine, steel, aluminium, plastic
seat: seat, seating | foam, leather, plywood, fabric, plastic, oak
backrest: back, backrest | oak, plastic, fabric, leather, foam, wicker
armrest: armrest, armrests, arm | oak, foam, steel, leather, plastic
tabletop: top, tabletop, table top | oak, glass, marble, mdf, steel
drawer: drawer, drawers | oak, mdf, plywood, plastic
mattress: mattress | foam, memory foam, latex foam, firm foam
bedframe: bed frame, bedstead | pine, oak, steel, mdf
sofaframe: sofa frame, frame | pine, oak, plywood, steel
headboard: headboard | oak, fabric, leather, mdf
pillow: pillow, cushion, pillows | polyester fibre fill, foam, memory foam, cotton
base: base, stand, lamp base | steel, brass, marble, ceramic, plastic
pole: pole, rod, post, posts | steel, aluminium, brass, oak
shade: shade, lampshade | fabric, paper, glass, plastic
shelf: shelf, shelves | pine, mdf, glass, steel
cabinet: cabinet, carcass, casing | mdf, oak, plywood, steel
door: door, doors | oak, glass, mdf, steel
knob: knob, knobs | brass, ceramic, plastic, steel
pot: pot, planter, flowerpot | ceramic, terracotta, plastic, concrete
soil: soil, earth, ground | soil, sand, gravel, clay, moss
trunk: trunk, tree trunk | living trunk, green wood, bamboo, plastic
leaves: leaves, foliage, crown | leaf, grass, silk, plastic, paper
cactus: cactus, plant | cactus, plastic, felt
flower: flower, blossom, petals | petal, silk, paper, plastic
stem: stem, stalk | green wood, grass, plastic
vase: vase, jar | glass, ceramic, porcelain, plastic
mug: mug, cup | ceramic, porcelain, glass, steel, plastic
handle: handle, grip | oak, plastic, steel, rubber, leather
bottle: bottle, flask | glass, pet, steel, aluminium, hdpe
cap: cap, stopper | plastic, cork, aluminium, rubber
lid: lid, cover | glass, steel, plastic, ceramic
pan: pan, skillet | cast iron, aluminium, steel, copper
kettle: kettle, teapot | steel, ceramic, glass, copper
spout: spout, nozzle | steel, ceramic, plastic
head: head, hammer head | steel, cast iron, rubber, wood
blade: blade | steel, stainless steel, ceramic, plastic, titanium
bristles: bristles, brush hairs | nylon, straw, wool
sole: sole, soles | rubber, eva, leather, cork
upper: upper, shoe upper | leather, fabric, nylon fabric, suede
laces: laces, shoelaces | cotton, nylon fabric, rope
bag: bag, pouch | leather, canvas, nylon fabric, cotton
strap: strap, straps, belt | leather, nylon fabric, cotton
carbody: car body, bodywork, chassis | steel, aluminium, plastic, carbon fibre, pine
wheel: wheel, wheels, tyres | rubber, plastic, wood, steel
window: windows, windscreen | glass, acrylic, polycarbonate
fuselage: fuselage, airframe | aluminium, carbon fibre, plastic, balsa
wing: wing, wings | aluminium, carbon fibre, balsa, plastic
propeller: propeller, rotor | oak, plastic, aluminium, carbon fibre
torso: torso, belly, body | plush, cotton, rubber, plastic, wood
limb: limbs, paws | plush, cotton, rubber, plastic, wood
ear: ears, ear | plush, felt, plastic
nose: nose, snout | plastic, felt, rubber, carrot
beak: beak, bill | rubber, plastic, wood
weights: weights, weight plates, discs | cast iron, steel, rubber, concrete
bar: bar, crossbar | steel, aluminium, cast iron
candle: candle, candles | wax, beeswax
holder: holder, candlestick | brass, silver, glass, ceramic
wick: wick | cotton, rope
cake: cake, cake layer | cake, bread, butter
icing: icing, frosting, topping | butter, sugar, chocolate
cone: cone, waffle cone | biscuit, paper
scoop: scoop, ice cream | snow, butter, gelatin
bun: bun, bread roll | bread, cake, sponge
patty: patty, filling | meat, cheese, mushroom
lettuce: lettuce, salad leaf | leaf, tissue paper
fruit: fruit, apple flesh | apple, tomato, wax, plastic
mushroomcap: mushroom cap | mushroom, plastic, ceramic
bookcover: book cover, binding | leather, cardboard, fabric
pages: pages, page block | paper, book
crate: crate, box | cardboard, pine, plastic, steel
staves: staves, barrel wood | oak, pine, plastic
hoops: hoops, metal bands, rings | steel, iron, brass, rope
bucket: bucket, pail | steel, plastic, zinc, wood
bowl: bowl, dish | gold, silver, brass, glass, wood
plinth: plinth, pedestal | marble, oak, plastic
clockcase: clock case, housing | oak, plastic, brass
dial: dial, clock face | paper, ceramic, plastic, steel
hands: hands, pointers | steel, brass, plastic
drumshell: drum shell, shell | maple, steel, acrylic
membrane: membrane, drumhead | pet, leather
hoopframe: racket frame, rim | carbon fibre, aluminium, ash
strings: strings, netting | nylon, silk, steel
guard: guard, crossguard | brass, steel, wood
shank: shank | steel, stainless steel
pencilshaft: pencil shaft, casing wood | cedar, basswood, plastic
tip: tip, point | graphite, steel, wax
eraser: eraser, eraser end | rubber, soft rubber
sweet: candy, sweet | hard candy, gelatin, chocolate
stick: stick | paper, wood, plastic
panel: panel, door panel | oak, mdf, steel, glass
doorframe: door frame, jamb | pine, steel, plastic
pane: pane, window pane | glass, acrylic, polycarbonate
sill: sill, window sill | marble, oak, pvc, concrete
windowframe: window frame, sash | pvc, aluminium, pine
wall: wall, walls | brick, concrete, wood, limestone
roof: roof, roofing | slate, clay, straw, steel
chimney: chimney, smokestack | brick, concrete, steel
rail: rail, rails, railing | oak, steel, aluminium, bamboo
fins: fins, fin | aluminium, plastic, plywood, rubber
antenna: antenna, aerial | steel, copper, plastic
lining: lining, padding | foam, eva, eps, felt
helmet: helmet, hard shell | polycarbonate, abs, carbon fibre, steel
basket: basket, trug | wicker, straw, plastic, steel wire
brim: brim, hat brim | felt, straw, leather
hatcrown: hat crown, hat top | felt, straw, wool
suitcase: suitcase, luggage | polycarbonate, aluminium, leather, canvas
lens: lens, lenses | glass, polycarbonate, acrylic
spectacles: spectacle frame, glasses frame | acetal, titanium, wood, steel
rock: rock, boulder | granite, limestone, sandstone, foam
statue: statue, figure | bronze, marble, plaster, wood
"""
# Whole things that people know, in the order of the training's categories.
CATEGORY_NAMES = tuple(
    "chair armchair sofa stool bench table desk bed lamp bookshelf wardrobe dresser door window "
    "house fence clock candlestick hammer axe knife sword screwdriver shovel broom brush pan "
    "saucepan teapot mug bottle jar bucket basket barrel parcel suitcase handbag shoe hat "
    "helmet glasses car wagon airplane rocket dumbbell trophy drum racket pencil book "
    "potted_plant cactus tree bouquet apple mushroom layer_cake ice_cream burger lollipop teddy "
    "duck snowman robot monument garden candy_bowl".split()
)
# Parts of the two categories that training never sees, with words that nothing else uses.
_HELD_OUT_PARTS = """
hull: hull, boat hull | oak, gfrp, aluminium, plastic
mast: mast, spar | spruce, aluminium, carbon fibre
sail: sail, sailcloth | canvas, nylon fabric, cotton
canopy: canopy, umbrella cloth | nylon fabric, silk, paper, cotton
hook: hook, crook | bamboo, plastic, steel
ribs: ribs, stretchers | steel, gfrp, bamboo
"""


@dataclass(frozen=True)
class PartKind:
    """A kind of part: its words and the rows of the table it may plausibly be made of."""

    name: str
    words: tuple[str, ...]
    materials: tuple[Material, ...]
    held_out: bool = False

    def value(
        self, *, stiffness: float = 0.5, density: float = 0.5, nu: float = 0.5
    ) -> MaterialValue:
        """Return E [Pa], nu [1], rho [kg/m^3] at shares of the range that its materials span.

        E and rho move in log space; one half everywhere is the mean that unmentioned parts get.
        """
        E_low, E_high = (f(m.E[i] for m in self.materials) for i, f in enumerate((min, max)))
        rho_low, rho_high = (f(m.rho[i] for m in self.materials) for i, f in enumerate((min, max)))
        nus = [m.value().nu for m in self.materials]
        poisson = max(0.0, min(nus) + nu * (max(nus) - min(nus)))
        return MaterialValue(
            E_low ** (1 - stiffness) * E_high**stiffness,
            min(poisson, NU_CAP),
            rho_low ** (1 - density) * rho_high**density,
        )

    @property
    def rho_range(self) -> tuple[float, float]:
        """Lowest and highest density [kg/m^3] of its materials."""
        return min(m.rho.min for m in self.materials), max(m.rho.max for m in self.materials)


def _read(text: str, held_out: bool) -> dict[str, PartKind]:
    table = load_table()
    kinds = {}
    for line in text.strip().splitlines():
        name, rest = line.split(":", 1)
        words, materials = (
            tuple(item.strip() for item in side.split(",")) for side in rest.split("|")
        )
        rows = tuple(table.exact(material) for material in materials)
        kinds[name] = PartKind(name, words, rows, held_out)
    return kinds


@lru_cache(maxsize=1)
def part_kinds() -> dict[str, PartKind]:
    """Every kind of part by name; the held-out ones last."""
    return {**_read(_PARTS, False), **_read(_HELD_OUT_PARTS, True)}


def spoken(category: str) -> str:
    """Return the name of a category as people say it: "potted plant"."""
    return category.replace("_", " ")


@lru_cache(maxsize=1)
def known_words() -> tuple[str, ...]:
    """Words for parts and whole things, but for those that only tests of the network speak of."""
    kinds = [kind for kind in part_kinds().values() if not kind.held_out]
    return (*(word for kind in kinds for word in kind.words), *map(spoken, CATEGORY_NAMES))
