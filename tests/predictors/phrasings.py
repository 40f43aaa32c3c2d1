"""Sentences with the material that each part of an asset should get: (parts, text, materials).

Parts are separated by spaces, further labels of a part by slashes; materials stand in the order of
the parts, as words of the table. ``HELD_OUT`` was written before any rule was tuned on ``TUNED``
and is only ever counted.
"""

CHAIR = "frame seat"
CHAIR4 = "legs seat back"
PLANT = "pot soil trunk leaves"
TABLE = "table_top leg_1 leg_2 leg_3 leg_4"
LAMP = "base/Metal_Chrome pole shade"
SCANNED = "mat_1/metal wood_seat plastic_feet"

TUNED = [
    (CHAIR, "a steel frame with an oak seat", "steel, oak"),
    (CHAIR, "a rubber frame with a foam seat", "rubber, foam"),
    (CHAIR4, "the legs are oak and the seat is soft foam", "oak, soft foam, *"),
    (CHAIR4, "oak legs and back, foam seat", "oak, foam, oak"),
    ("legs cushion", "legs made of oak, cushion of soft foam", "oak, soft foam"),
    (
        PLANT,
        "the pot is ceramic while the trunk is wood; leaves are flexible",
        "ceramic, soil, wood, leaf",
    ),
    ("ball", "solid steel ball, 10 cm", "steel"),
    ("cube", "oak cube", "oak"),
    ("cube", "natural rubber cube", "natural rubber"),
    (
        CHAIR4,
        "legs, which are oak, and a leather seat with an aluminium back",
        "oak, leather, aluminium",
    ),
    (CHAIR4, "oak legs foam seat steel back", "oak, foam, steel"),
    (CHAIR4, "the legs are oak the seat is foam the back is wicker", "oak, foam, wicker"),
    (CHAIR4, "legs are pine seat is leather back is steel", "pine, leather, steel"),
    (CHAIR4, "legs oak, seat foam, back steel", "oak, foam, steel"),
    (CHAIR4, "seat: foam; legs: brass; back: oak", "brass, foam, oak"),
    (CHAIR4, "the legs, back and seat are oak", "oak, oak, oak"),
    (
        CHAIR4,
        "The seat is leather and the legs and the back are made out of stainless steel.",
        "stainless steel, leather, stainless steel",
    ),
    (CHAIR4, "wooden chair with a foam seat", "wood, foam, wood"),
    (
        CHAIR4,
        "a chair whose legs are cast iron and whose seat and back are teak",
        "cast iron, teak, teak",
    ),
    (CHAIR4, "everything is aluminium", "aluminium, aluminium, aluminium"),
    (CHAIR4, "foam seat, everything else is steel", "steel, foam, steel"),
    (
        CHAIR4,
        "a chair. The legs are steel. The seat is plywood. The back is mesh fabric.",
        "steel, plywood, fabric",
    ),
    (TABLE, "a glass table top on four steel legs", "glass, steel, steel, steel, steel"),
    (TABLE, "marble top and brass legs", "marble, brass, brass, brass, brass"),
    (
        TABLE,
        "the tabletop is made of walnut, the feet of steel",
        "walnut, steel, steel, steel, steel",
    ),
    (TABLE, "table, oak", "oak, oak, oak, oak, oak"),
    (
        PLANT,
        "a terracotta pot with soil, a wooden trunk and green leaves",
        "terracotta, soil, wood, leaf",
    ),
    (
        PLANT,
        "plastic leaves, plastic trunk, porcelain planter and foam soil",
        "porcelain, foam, plastic, plastic",
    ),
    (
        PLANT,
        "the leaves are silk, the trunk is plastic, the pot is concrete and the soil is moss",
        "concrete, moss, plastic, silk",
    ),
    (LAMP, "brass base, fabric shade, steel pole", "brass, steel, fabric"),
    (LAMP, "the shade is paper", "steel, *, paper"),
    (LAMP, "", "steel, *, *"),
    (SCANNED, "a steel frame with an oak seat", "steel, oak, plastic"),
    (SCANNED, "a rubber frame with a foam seat", "rubber, foam, plastic"),
    ("sweethome3d_mat_1 sweethome3d_mat_2", "a steel frame with an oak seat", "steel/oak"),
    ("legno_scuro acciaio vetro", "", "wood, steel, glass"),
    ("Bois tissu cuir", "", "wood, fabric, leather"),
    ("toy", "a very stiff rigid rubber toy", "stiff rubber"),
    ("toy", "a soft squishy rubber toy", "soft rubber"),
    (CHAIR, "the seat is stiff foam, the frame stiff", "*, firm foam"),
    (CHAIR, "foam seat that is very soft, oak frame", "oak, soft foam"),
    ("handle head", "a hammer: hickory handle, steel head", "hickory, steel"),
    ("handle head", "steel head on an ash handle, 1.2 kg and 30 cm long", "ash, steel"),
    ("blade handle", "stainless steel blade and a handle in ebony", "stainless steel, ebony"),
    ("front_leg back_leg", "front legs steel, back legs oak", "steel, oak"),
    (
        "seat_back seat legs",
        "oak legs, the seat is foam and the back of the seat is leather",
        "leather, foam, oak",
    ),
]
HELD_OUT = [
    (CHAIR4, "pine legs with a leather seat and a wicker back", "pine, leather, wicker"),
    (
        CHAIR4,
        "Seat made from plywood; legs and back from aluminum tubing",
        "aluminium, plywood, aluminium",
    ),
    (CHAIR4, "it has brass legs, a marble seat, and a back carved from oak", "brass, marble, oak"),
    (CHAIR4, "a metal chair with a cushioned fabric seat", "metal, fabric, metal"),
    (CHAIR4, "the chair is made of beech, except that the seat is cork", "beech, cork, beech"),
    (
        CHAIR4,
        "the back and the legs, both of them maple, hold a seat of firm foam",
        "maple, firm foam, maple",
    ),
    (CHAIR4, "rigid plastic seat bamboo legs rattan back", "bamboo, rigid plastic, rattan"),
    (
        TABLE,
        "granite slab for the top, legs in cast iron",
        "granite, cast iron, cast iron, cast iron, cast iron",
    ),
    (TABLE, "a solid walnut table, 120 x 80 cm", "walnut, walnut, walnut, walnut, walnut"),
    (TABLE, "legs = steel, top = glass", "glass, steel, steel, steel, steel"),
    (
        PLANT,
        "an artificial plant: plastic stem, fabric foliage, foam in a concrete vase",
        "concrete, foam, plastic, fabric",
    ),
    (
        PLANT,
        "ceramic planter filled with earth, oak trunk, and soft flexible foliage",
        "ceramic, earth, oak, foliage",
    ),
    (LAMP, "lamp with a marble foot, a brass rod and a linen lampshade", "marble, brass, linen"),
    (LAMP, "copper pole and base; the shade, made of parchment paper", "copper, copper, paper"),
    (
        "body lid handle",
        "cast iron pot with a wooden handle and a glass lid",
        "cast iron, glass, wood",
    ),
    ("Sole Upper Laces", "rubber sole, leather upper and cotton laces", "rubber, leather, cotton"),
    (
        "wheel_fl wheel_fr chassis seat",
        "wheels of rubber on an aluminium chassis, and the seat upholstered in vinyl",
        "rubber, rubber, aluminium, vinyl",
    ),
    ("Material_0 Material_1 Material_2", "glass top, oak legs and brass screws", "glass/oak/brass"),
    (
        "mattress/foam bed_frame pillow",
        "the bed frame is pine, the mattress is memory foam and the pillow is feathers",
        "memory foam, pine, feathers",
    ),
    ("duck", "squeaky flexible rubber duck", "soft rubber"),
]
