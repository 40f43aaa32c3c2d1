"""Families of ways to speak that were found on sentences of several hands, ten examples each."""


def test_designations_of_older_and_other_standards(agree):
    """AFNOR before the European ones, GOST, UNE, SS, BS: each the row of its family."""
    agree("""
        shaft XC38, hub XC42 => shaft: carbon steel; hub: aisi 1045 steel
        shaft 35CD4, hub 35NCD16 => shaft, hub: alloy steel
        pin Z2CN18-10, ring Z6CND17-12 => pin, ring: stainless steel
        leaf_a A-U4G, leaf_b A-G5 => leaf_a: aluminium 2xxx; leaf_b: aluminium 5xxx
        plate E24, beam E36 => plate: s235; beam: s355
        shaft 40Х, gear 12ХН3А => shaft, gear: alloy steel
        block СЧ25, lid АМг3 => block: gray iron; lid: aluminium 5xxx
        bush БрОЦС5-5-5, nut Л63 => bush: tin bronze; nut: brass
        axle F-1140, gear F-1270 => axle: aisi 1045 steel; gear: alloy steel
        tray SS 2343, plate SS 1312 => tray: stainless steel; plate: carbon steel
        bush PB1, ring LB2 => bush, ring: tin bronze
        housing FGS 400, base FGL 250 => housing: ductile iron; base: en-gjl-250
        rail DP600, sill 22MnB5 => rail, sill: carbon steel
        nipple H62, worm ZCuSn10P1 => nipple: brass; worm: tin bronze
        arm ZM5, case ZL101A => arm: magnesium; case: aluminium casting alloy
    """)


def test_names_stand_in_brackets(agree):
    agree("""
        fingers (finger_1, finger_2) brass, palm steel => finger_1, finger_2: brass; palm: steel
        screws (screw_1 to screw_3): brass; lid oak => screw_1, screw_2, screw_3: brass; lid: oak
        втулка БрОЦС5-5-5 (part bush), lid oak => bush: tin bronze; lid: oak
        cast iron (part casing), steel (part shaft) => casing: cast iron; shaft: steel
    """)


def test_what_copies_another_part(agree):
    agree("""
        body_1 oak. body_2 as body_1. => body_1, body_2: oak
        the frame is oak, the legs as the frame => frame, leg_1, leg_2: oak
        lid brass; body_2 and body_3 as lid but thinner => lid, body_2, body_3: brass
        pan is cast iron, handle also, lid glass => pan, handle: cast iron; lid: glass
        hub steel, rim also => hub, rim: steel
        base oak; top same; knob brass => base, top: oak; knob: brass
        plate A: brass, plate B like plate A => plate_a, plate_b: brass
    """)


def test_the_plating_is_not_the_matter(agree):
    agree("""
        contacts CuSn6 gold flashed => contacts: cusn6
        tube E235 zinc plated, lid oak => tube: steel; lid: oak
        pin brass nickel plated => pin: brass
        terminal copper tin plated => terminal: copper
        hook S235JR zinc coated => hook: S235
        plate 6061-T6 nickel plated => plate: 6061-T6
        base oak wax coated => base: oak
        busbar copper silver plated => busbar: copper
        knob ABS chrome plated => knob: ABS
        needle 316L gold plated => needle: 316L
    """)


def test_a_part_of_a_range_has_its_own(agree):
    agree("""
        link_1 to link_3: steel, link_2: brass => link_1, link_3: steel; link_2: brass
        link_1 thru link_3: AW-6082, except link_2 = AZ31B => link_1, link_3: 6082; link_2: AZ31
        all legs oak, leg_2 ash => leg_1, leg_3: oak; leg_2: ash
        the legs are beech, leg_1 is pine => leg_1: pine; leg_2, leg_3: beech
        rib_1..rib_3: balsa; rib_3: plywood => rib_1, rib_2: balsa; rib_3: plywood
        everything steel except the lid: oak => body: steel; lid: oak
        everything steel except lid = oak; knob is brass => body: steel; lid: oak; knob: brass
    """)


def test_a_table_is_read_by_its_header(agree):
    agree("""
        pos;part;material;EUR\\n10;tube;E235+N;11,20\\n20;cap;PA6;0,74 => tube: steel; cap: PA6
        name,material\\nlid,oak\\nknob,brass => lid: oak; knob: brass
        Material,Part\\noak,lid\\nbrass,knob => lid: oak; knob: brass
        Item | Part | Material\\n1 | lid | oak\\n2 | knob | brass => lid: oak; knob: brass
        Bauteil;Werkstoff\\nDeckel;Eiche\\nKnopf;Messing => Deckel: oak; Knopf: brass
        Pièce;Matériau\\ncouvercle;chêne\\nbouton;laiton => couvercle: oak; bouton: brass
        Pieza;Material\\ntapa;roble\\nbotón;latón => tapa: oak; botón: brass
        No.  Part  Mat'l\\n1  lid  FC250\\n2  knob  C3604 => lid: en-gjl-250; knob: brass
        part\tmaterial\\nlid\toak\\nknob\tbrass => lid: oak; knob: brass
        part,material,note\\nlid,"oak, oiled",a\\nknob,brass,b => lid: oak; knob: brass
    """)


def test_numbers_of_a_table_have_the_unit_of_their_column(clauses_of):
    for head in (
        "name,E_GPa,nu,rho_kgm3",
        "part,E [GPa],poisson,density [kg/m3]",
        "Name,E (GPa),nu,rho (kg/m3)",
    ):
        (said,) = clauses_of(f"{head}\nlid,70,0.33,2700\nhub,210,0.3,7850", ["lid", "hub"])["lid"]
        found = {number.measure: number.value for number in said.numbers}
        assert found == {"E": 70e9, "nu": 0.33, "rho": 2700.0}, head


def test_a_text_takes_back_what_it_said(agree):
    agree("""
        rim is 6061... correction, rim is PA6; hub oak => rim: PA6; hub: oak
        the lid is oak. sorry, the lid is ash. knob brass => lid: ash; knob: brass
        bush delrin no, make it sintered bronze => bush: sintered bronze
        top_plate: HPL? no -> EN AW-5083 => top_plate: 5083
        crankcase from EN-GJL-200 to A380; piston steel => crankcase: A380; piston: steel
        the weight is lead? God, no: iron. => weight: iron
        lid oak, no wait, lid ash => lid: ash
    """)


def test_a_word_means_what_stands_around_it(agree):
    agree("""
        crown: enamel, body: dentine => crown: tooth enamel; body: dentine
        a molar: cap enamel => cap: tooth enamel
        limbs whittled from pear => limbs: pear wood
        the case is pear, carved by hand => case: pear wood
        the mug is clay => mug: earthenware
        the ground is clay => ground: clay
        the pan is enamel => pan: enamel
    """)


def test_a_plastic_far_lighter_than_itself_is_its_foam(table):
    from autophyx_tet.predictors.resolve.numbers import row_by_numbers
    from autophyx_tet.predictors.text.numerals import Quantity

    for name, density, stiffness, wanted in [
        ("PUR", 80, 4, "rigid PU foam"), ("PUR", 40, None, "flexible PU foam"),
        ("polyurethane", 60, 5, "rigid PU foam"), ("PE", 30, None, "polyethylene foam"),
        ("polypropylene", 60, None, "epp"), ("polystyrene", 25, None, "eps foam"),
        ("rigid PVC", 80, None, "pvc foam"), ("PET", 100, None, "pet foam"),
        ("polypropylene", 900, None, "polypropylene"), ("steel", 100, None, "steel"),
    ]:  # fmt: skip
        row = table.exact("thermoplastic polyurethane (tpu)" if name == "PUR" else name)
        said = [Quantity("rho", float(density), f"{density} kg/m3")]
        assert row_by_numbers(row, table, said, stiffness) is table.exact(wanted), name


def test_densities_in_the_names_of_foams(clauses_of):
    for text, rho in [
        ("core Divinycell H80", 80), ("core Divinycell H 100", 100), ("core Rohacell 51", 51),
        ("core Plastazote LD45", 45), ("core Plastazote LD 33", 33), ("core Evazote EV50", 50),
        ("core PVC foam H60", 60), ("core Rohacell 71 IG-F", 71),
    ]:  # fmt: skip
        (said,) = clauses_of(text, ["core"])["core"]
        assert [n.value for n in said.numbers if n.measure == "rho"] == [rho], text


def test_other_languages(agree):
    """Compounds, adjectives of matter, other words for a part, the same as another, the rest."""
    agree("""
        Buchenholzgriff, Stahlklinge, Messingnieten => griff: beech; klinge: steel; nieten: brass
        ein eisernes Gestell mit ledernem Sitz => gestell: iron; sitz: leather
        Der Hahn ist verchromtes Messing, der Hebel auch => hahn, hebel: brass
        Scheibe Floatglas, Rahmen Fichtenholz => scheibe: float glass; rahmen: spruce
        Deckel aus Eiche, Boden ebenso, Griff aus Messing => deckel, boden: oak; griff: brass
        Le corps est en laiton chromé, la manette pareil => corps, manette: brass
        la quille en plomb, le mat dans le même métal que la quille => quille, mat: lead
        des yeux de verre, une robe en coton => oeil_g, oeil_d: glass; robe: cotton
        El depósito es de acero y lo demás de latón => deposito: steel; valvula: brass
        la tapa de roble, el fondo también, el pomo de latón => tapa, fondo: oak; pomo: brass
        los patines de hierro y el asiento de cuero => patin_1, patin_2: iron; asiento: leather
        coque en stratifié verre, mât en épicéa => coque: GFRP; mat: spruce
    """)


def test_what_is_said_otherwise_in_other_languages(agree):
    """Shares, states, sameness, comparisons, karats, colours, capitals, changes, big numbers."""
    agree("""
        Griff aus Polyamid mit 30 % Glasfaser, Deckel aus Zink => griff: nylon 6/6; deckel: zinc
        capot en PP chargé 20 % fibre de verre, pied en zinc => capot: polypropylene; pied: zinc
        der Balken ist klatschnasse Eiche, Kette Messing => balken: wet oak; kette: brass
        la poutre en chêne fraîchement scié, le socle en granit => poutre: wet oak; socle: granite
        tige en laiton, cupule du même métal que la tige => tige: brass; cupule: brass
        la anilla es de oro de 18 quilates, la caja de nogal => anilla: 18 karat gold; caja: walnut
        la boya es de corcho pintada de naranja, el cabo de algodón => boya: cork; cabo: cotton
        CARTER: FONTE GRISE. BOUCHON: LAITON. => carter: grey cast iron; bouchon: brass
        Topf samt Deckel: Kupfer; Griff aus Horn => topf, deckel: copper; griff: horn
        la carcasa pasó de acero a policarbonato, tapa de ABS => carcasa: polycarbonate; tapa: ABS
    """)


def test_matters_that_engineers_name_by_maker_or_formula(agree):
    """Each the row of its own kind, and none by a word that is spelt nearly so."""
    agree("""
        pin AMPCOLOY 940, base Perunal => pin: copper nickel silicon; base: aluminium 7xxx
        ring 1.2709, disc GH4169 => ring: maraging steel; disc: inconel 718
        shield SUS430, lid X2CrTi12 => shield: martensitic stainless; lid: aisi 430 stainless steel
        tray 5A06, rib LY12 => tray: aluminium 5056; rib: aluminium 2xxx
        pad PPS-GF40, nut POM-PTFE => pad: pps gf40; nut: acetal with ptfe
        gear PEEK HPV, seal PTFE/25GF => gear: peek bearing grade; seal: filled ptfe
        duct PP-TV40, box PA6-GK30 => duct: polypropylene td40; box: mineral-filled nylon
        spar biax +-45 glass, skin T800S UD => spar: glass/epoxy biaxial laminate (45); skin: im7
        board RO4350B, window LiTaO3 => board: ro4350b; window: lithium tantalate
        beam BauBuche GL75, cover Tyvek => beam: baubuche; cover: tyvek
        disc EN-GJL-150, drum GG30 => disc: en-gjl-150; drum: en-gjl-300
        sheath XLPE, liner XLPE liner => sheath: pex; liner: hxlpe
        horn Ti-6Al-2Sn-4Zr-2Mo, lid polyvinyl butyral => horn: ti-6242; lid: pvb
        gear acetal homopolymer, lid gutta-percha => gear: delrin 500; lid: gutta-percha
    """)


def test_fineness_of_gold_is_no_count(agree):
    agree("""
        three 9 karat gold rings => ring_1, ring_2, ring_3: 375 gold
        ring 18 ct gold, clasp 14k gold => ring: 18 karat gold; clasp: 14 karat gold
        clasp 22 carat gold, ring gold 750 => clasp: 22 karat gold; ring: 18 karat gold
        ring 24 karat gold, stone diamond, 2 ct => ring: gold; stone: diamond
    """)


def test_parts_that_share_the_beginning_of_their_names(agree):
    agree("""
        busbar L1/L2/L3 copper, lid ABS => busbar_L1, busbar_L2, busbar_L3: copper; lid: ABS
        four rings PZT-4, lid brass => pzt_ring_1, pzt_ring_4: lead zirconate titanate; lid: brass
        pos 1 lid brass\\npos 2 box, as pos 1\\npos 3 pin oak => lid, box: brass; pin: oak
    """)


def test_a_kind_before_what_says_which(agree):
    agree("""
        lid ABS, rubber foot NBR 70 => lid: ABS; foot: nbr
        lid ABS. The foot is elastomer, EPDM 60 => lid: ABS; foot: epdm
        lid rubber, neoprene box => lid: rubber; box: neoprene
        plastic lid PP, box metal, brass => lid: polypropylene; box: brass
    """)


def test_what_fills_a_thing_is_its_filling(agree):
    """Where a part is called so, and the text says nothing else of it."""
    agree("""
        a felt bear full of wool => bear: felt; filling: wool
        a felt bear full of wool, the filling is cotton => bear: felt; filling: cotton
        a felt bear full of wool => bear, lid: felt
    """)


def test_numbers_of_no_part_are_of_the_part_before(clauses_of):
    """Up to the next stop: "the maker says ..."."""
    for text, rho in [
        ("the lid is brass, the maker says 8500 kg/m3; the box is oak", [8500]),
        ("the lid is brass. The maker says 8500 kg/m3. The box is oak", []),
    ]:
        (said,) = clauses_of(text, ["lid", "box"])["lid"]
        assert [n.value for n in said.numbers] == rho, text


def test_what_is_said_once_more_and_otherwise_is_told(clauses_of):
    (said,) = clauses_of("the lid is oak; it is steel; the box is oak", ["lid", "box"])["lid"]
    assert said.material == "carbon steel"
    assert [doubt.kind for doubt in said.doubts] == ["reader.again"]
    (said,) = clauses_of("the lid is oak; it is walnut; the box is oak", ["lid", "box"])["lid"]
    assert not said.doubts


def test_what_is_so_unless_said_otherwise(agree):
    """In four languages, and where the whole text shouts."""
    agree("""
        MATERIAL UNLESS OTHERWISE STATED S355. PIN C45. => plate, rib: s355; pin: c45
        unless otherwise noted 6082-T6; seal NBR => body, lid: 6082-t6; seal: nbr
        Material wenn nicht anders vermerkt S355. Buchse aus Messing. => Platte: s355; Buchse: brass
        MATIERE SAUF INDICATION CONTRAIRE : 6061-T6. VIS EN ACIER. => CORPS: 6061-t6; VIS: steel
        Salvo indicación contraria S235. Eje de latón. => placa: s235; eje: brass
    """)


def test_two_matters_of_one_part_are_told_wherever_they_stand(clauses_of):
    for text, doubted in (
        ("The seat is oak. The legs are pine. The seat is steel.", ["reader.again"]),
        ("seat: oak; legs: pine; seat: walnut", ["reader.again"]),
        ("The seat is oak. The legs are pine. The seat is oak.", []),
        ("The legs are oak. The front leg is steel. The seat is oak.", []),
    ):
        found = clauses_of(text, ["seat", "leg_front", "leg_rear"])
        told = {doubt.kind for said in found.values() for one in said for doubt in one.doubts}
        assert sorted(told) == doubted, text


def test_a_coined_name_is_no_misspelt_matter(clauses_of):
    """Two letters off and numbered; with its consonants it is a misspelling still."""
    (said,) = clauses_of("body quindle-7, lid oak", ["body", "lid"])["body"]
    assert (said.material, said.unknown) == (None, "quindle-7")
    (said,) = clauses_of("body alumnium-6061, lid oak", ["body", "lid"])["body"]
    assert "aluminium" in said.material


def test_what_is_empty_is_measured_in_words_of_all(clauses_of):
    for words, measure, value in (
        ("bronze, 85 % of its volume is empty", "void", 0.85),
        ("bronze, 60 % empty", "void", 0.6),
        ("bronze with 70 % porosity", "void", 0.7),
        ("bronze lattice of relative density 30 %", "infill", 0.3),
        ("bronze, relative density 8.8", "rho", 8800),
    ):
        (said,) = clauses_of(f"the horse is {words}; plinth marble", ["horse", "plinth"])["horse"]
        assert [(n.measure, n.value) for n in said.numbers] == [(measure, value)], words


def test_a_symbol_that_is_no_property_is_no_doubt(clauses_of):
    (said,) = clauses_of("plate S235 t=8, dowel steel; L = 450", ["plate", "dowel"])["plate"]
    assert [doubt.kind for doubt in said.doubts] == ["numerals.aside"]
    for modulus in ("G = 80 GPa", "G = 80", "E_y = 9"):
        found = clauses_of(f"plate S235, {modulus}; dowel steel", ["plate", "dowel"])
        assert [doubt.kind for doubt in found["plate"][0].doubts] == ["numerals.used"], modulus


def test_alloy_behind_a_grade_says_no_more(agree):
    agree("""
        steerer 7075 alloy, lid 6061-T6 alloy => steerer: aluminium 7075; lid: aluminium 6061-T6
        body AZ91 alloy, lid Ti-6Al-4V alloy => body: magnesium AZ91; lid: Ti-6Al-4V
        body cast alloy, lid alloy => body, lid: aluminium alloy
        rim_1 alloy, rim_2 steel => rim_1: aluminium alloy; rim_2: carbon steel
    """)


def test_bolts_have_the_strength_of_their_class(agree):
    agree("""
        bolt: M8 class 8.8, plate: S355 => bolt: 8.8 steel; plate: s355
        bolt 10.9, plate 16MnCr5 => bolt: 10.9 steel; plate: alloy steel
        M12x40 ISO 4762 12.9 bolts, plate S235 => bolt: 12.9 steel; plate: s235
        bolt 8.8 verzinkt, plate S235 => bolt: 8.8 steel; plate: s235
        bolt class 4.8, stud 5.6 => bolt, stud: carbon steel
    """)
