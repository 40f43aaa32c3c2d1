"""Designations of standards: each is of its family, by E and rho, however it is written.

The lists are written by rule or from what engineers name; none is copied from a table of a
standard. A family's bands are those of handbooks: E and rho differ by a few per cent inside it.
"""

from itertools import product

import pytest
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.resolve.resolve import Lookup
from autophyx_tet.predictors.text.reader import read_sentence

TABLE = load_table()
LOOKUP = Lookup(table=TABLE)

# Family -> E [GPa] and rho [kg/m^3] that its members have.
FAMILIES = {
    "steel": ((180, 220), (7650, 8160)),
    "stainless": ((185, 220), (7600, 8200)),
    "grey iron": ((66, 145), (6900, 7400)),
    "ductile iron": ((150, 185), (6900, 7400)),
    "malleable iron": ((150, 190), (7000, 7500)),
    "aluminium": ((66, 78), (2550, 2900)),
    "aluminium 6": ((67, 71), (2650, 2750)),
    "aluminium 5": ((68, 72.5), (2600, 2740)),
    "aluminium 2": ((70, 75), (2740, 2860)),
    "aluminium 7": ((69, 73.5), (2740, 2860)),
    "copper": ((110, 135), (8850, 9000)),
    "brass": ((90, 120), (8300, 8800)),
    "tin bronze": ((90, 122), (8650, 8950)),
    "aluminium bronze": ((100, 130), (7300, 7850)),
    "cupronickel": ((120, 165), (8800, 9000)),
    "nickel silver": ((115, 150), (8500, 8900)),
    "titanium": ((98, 120), (4400, 4850)),
    "nickel alloy": ((170, 225), (7900, 9300)),
    "magnesium": ((40, 48), (1700, 1870)),
    "zinc": ((70, 100), (6000, 7250)),
    "PE": ((0.1, 1.5), (900, 970)),
    "PP": ((0.9, 2.2), (885, 930)),
    "PA": ((0.8, 4.2), (930, 1190)),
    "PA glass": ((4, 20), (1180, 1700)),
    "PC": ((2.0, 2.6), (1180, 1230)),
    "POM": ((2.4, 3.5), (1380, 1440)),
    "PET": ((2.0, 3.8), (1290, 1420)),
    "PBT": ((2.0, 3.0), (1270, 1350)),
    "PBT glass": ((5, 14), (1380, 1700)),
    "ABS": ((1.6, 2.9), (1010, 1100)),
    "PMMA": ((2.2, 3.6), (1150, 1210)),
    "PVC": ((2.0, 4.2), (1300, 1500)),
    "soft PVC": ((0.001, 0.3), (1100, 1450)),
    "PS": ((1.5, 3.6), (1020, 1100)),
    "PTFE": ((0.3, 0.8), (2100, 2250)),
    "PEEK": ((3.2, 4.5), (1260, 1340)),
    "PPS": ((3.0, 4.5), (1300, 1400)),
    "PPS glass": ((9, 20), (1550, 2050)),
    "rubber": ((0.0005, 0.05), (850, 2000)),
    "hard rubber": ((0.003, 0.2), (850, 1950)),
    "CFRP": ((40, 330), (1400, 1700)),
    "GFRP": ((7, 50), (1400, 2200)),
    "foam": ((0.000005, 0.5), (10, 700)),
    "glass": ((50, 115), (2200, 4000)),
    "alumina": ((300, 420), (3600, 4000)),
    "zirconia": ((180, 230), (5600, 6150)),
    "silicon nitride": ((280, 330), (3100, 3350)),
    "silicon carbide": ((350, 450), (2950, 3250)),
    "tungsten carbide": ((450, 710), (13500, 15900)),
    "ferrite": ((100, 220), (4500, 5300)),
    "NdFeB": ((140, 175), (7300, 7700)),
    "SmCo": ((100, 190), (8000, 8600)),
    "concrete": ((20, 50), (2200, 2600)),
    "wood": ((4, 20), (300, 950)),
}


def _each(*parts):
    """Every way to put one of each list behind the other: "S" "235" "JR"."""
    return ["".join(way) for way in product(*(p if isinstance(p, list) else [p] for p in parts))]


NAMED = {
    "steel": [
        *_each("S", ["235", "275", "355", "420", "460"], ["JR", "J0", "J2", "K2", "N", "ML", "", "J2+N"]),
        *_each("E", ["235", "295", "335", "355", "360"]),
        *_each("P", ["235GH", "265GH", "355NH", "355NL1", "460Q"]),
        *_each("L", ["245", "360", "450"], ["M", "Q"]),
        *_each("DC0", list("13456")), "DX51D+Z275", "H320LA", "HX340LAD",
        *_each("C", ["10", "15", "22", "35", "40", "45", "50", "55", "60"], ["E", "R", ""]),
        *_each("Ck", ["15", "35", "45", "60"]), "St 37", "St37-2", "St 44", "St52-3", "St 60-2", "St 70",
        "16MnCr5", "20MnCr5", "42CrMo4", "34CrNiMo6", "25CrMo4", "30CrNiMo8", "50CrV4", "51CrV4",
        "100Cr6", "18CrNiMo7-6", "34CrMo4", "41Cr4", "36CrNiMo4", "30CrMoV9", "31CrMoV9", "15CrNi6",
        "11SMn30", "11SMnPb30", "9SMn28K", "28Mn6", "55Si7", "61SiCr7", "38Si7", "16Mo3", "13CrMo4-5",
        "90MnCrV8", "X38CrMoV5-1", "X153CrMoV12", "115CrV3", "60WCrV8", "HS6-5-2", "S690QL", "S960QL",
        *_each("AISI ", ["1018", "1020", "1045", "1095", "4130", "4140", "4340", "8620", "52100", "5160", "9310"]),
        *_each("SAE ", ["1010", "1035", "1050", "4118", "6150"]),
        "A36", "ASTM A36", "ASTM A572", "ASTM A572 Gr. 50", "ASTM A514", "ASTM A992", "A500", "ASTM A106",
        "A283 Gr C", "ASTM A193 B7", "ASTM A516 Gr 70",
        *_each("UNS ", ["G10180", "G10450", "G41400", "K02600", "T30402"]),
        "SS400", "SM490A", "S45C", "S50C", "S20C", "SCM415", "SCM435", "SCM440", "SNCM439", "SUJ2", "SUP9",
        "SPCC", "SPHC", "SECC", "SK5", "SKD11", "SKD61", "SKH51", "STKM13A", "SWRH82B",
        "Q235", "Q235B", "Q345B", "45#", "20#", "40Cr", "65Mn", "GCr15", "20CrMnTi", "35CrMo", "42CrMo", "Cr12MoV",
        "St3", "Ст3", "30KhGSA", "40Kh", "12Kh1MF", "09G2S", "EN8", "EN24", "EN3B", "EN19", "080M40", "817M40", "BS 4360 43A",
        "1.0037", "1.0038", "1.0503", "1.0577", "1.1191", "1.2379", "1.2343", "1.3505", "1.7131", "1.7225",
        "1.6582", "1.8159", "class 8.8", "class 10.9", "grade 12.9", "M400-50A", "B500B", "D2", "O1", "H13", "A2 tool steel",
        "M2 HSS", "Hardox 450", "Hardox 500", "Strenx 700", "Toolox 44", "maraging 300", "EN 10025 S355", "300M",
    ],
    "stainless": [
        *_each("1.", ["4301", "4305", "4307", "4310", "4401", "4404", "4435", "4541", "4571", "4016", "4021",
                      "4034", "4057", "4104", "4112", "4122", "4125", "4462", "4539", "4542", "4568", "4828"]),
        "X5CrNi18-10", "X2CrNiMo17-12-2", "X6CrNiTi18-10", "X10CrNi18-8", "X20Cr13", "X46Cr13", "X90CrMoV18",
        "X8CrNiS18-9", "X2CrNiMoN22-5-3", "X5CrNiCuNb16-4", "X6Cr17", "X12CrNi25-21", "GX5CrNiMo19-11-2",
        *_each(["AISI ", "SS ", "SUS", "type "], ["303", "304", "304L", "316", "316L", "316Ti", "321", "410", "420", "430", "440C"]),
        *_each("UNS S", ["30400", "31603", "32205", "17400", "41000", "44004", "32750"]),
        "A2-70", "A4-80", "17-4 PH", "17-4PH H900", "15-5 PH", "15-5PH H1025", "17-7 PH", "duplex 2205", "2507", "904L",
        "SUS316", "SUS304-CSP", "SUS420J2", "SUS630", "08Kh18N10", "12Kh18N10T", "12X18H10T", "06Cr19Ni10",
        "A240 316L", "ASTM A276 304", "254 SMO", "Nitronic 60", "CF8M", "18/10 stainless", "V2A", "V4A",
    ],
    "grey iron": [
        *_each(["EN-GJL-", "GJL-", "GG-", "GG", "GG "], ["15", "20", "25"]),
        "EN-GJL-200", "EN-GJL-250", "GJL-300", "EN-JL1040", "0.6025", "FC250", "HT200", "HT250", "GG30",
        "ASTM A48 class 30", "class 35 grey iron", "SCh20", "5.1301",
    ],
    "ductile iron": [
        *_each(["EN-GJS-", "GJS-", "GJS "], ["400-15", "500-7", "600-3", "700-2", "400-18-LT"]),
        "GGG-40", "GGG40", "GGG-50", "GGG 60", "0.7040", "0.7050", "FCD450", "FCD500", "QT450-10", "QT500-7",
        "ASTM A536 65-45-12", "65-45-12 ductile iron", "80-55-06 ductile", "EN-JS1030", "VCh50",
    ],
    "malleable iron": [*_each("EN-GJM", ["B-350-10", "W-400-5", "B-450-6"]), "GTW-40-05", "GTS-35-10"],
    "aluminium 6": [
        *_each(["EN AW-", "EN AW ", "AW-", "AA", "AA ", "Al "], ["6060", "6061", "6063", "6082"]),
        *_each(["6061", "6063", "6082", "6005A"], [" T6", "-T6", "-T651", "-T5", " T66"]),
        "A6061", "A6063", "AlMgSi1", "AlMgSi0.5", "AlMgSi1 F31", "AlMg1SiCu", "EN AW-AlSi1MgMn", "UNS A96061", "3.3206", "3.2315", "HE30", "AD31", "6061",
    ],
    "aluminium 5": [
        *_each(["EN AW-", "AA", "A"], ["5052", "5083", "5754", "5005"]),
        "EN AW-5049 H24", "5083-H111", "5083 H116", "5754 H22", "5052-H32", "AlMg3", "AlMg4.5Mn", "AlMg4.5Mn0.7", "AlMg2.5", "AMg6", "UNS A95083",
    ],
    "aluminium 2": ["2024-T3", "2024 T351", "EN AW-2024", "2014-T6", "2017A T4", "AlCu4Mg1", "AlCuMg2", "D16T", "AA2024", "A2017", "2219-T87", "EN AW-2007", "AlCu4PbMgMn"],
    "aluminium 7": ["7075-T6", "7075 T651", "7050-T7451", "EN AW-7075", "AlZn5.5MgCu", "AlZnMgCu1.5", "7020 T6", "EN AW-7022", "A7075", "V95", "AA7075", "7068-T6511", "3.4365"],
    "aluminium": [
        "EN AC-42000", "EN AC-44300", "EN AC-46000", "EN AC-43400", "EN AC-AlSi7Mg0.3", "AlSi10Mg", "AlSi12", "AlSi12(Fe)", "AlSi9Cu3", "AlSi9Cu3(Fe)",
        "GD-AlSi12", "G-AlSi10Mg", "A356", "A356-T6", "A380", "A383", "ADC12", "ADC10", "LM25", "LM24", "LM6", "AC4C", "AlSi7Mg", "319.0", "356.0-T6",
        "EN AW-1050A", "1050A H14", "Al99.5", "Al 99.5", "EN AW-1200", "EN AW-3003", "3003-H14", "3105", "AlMn1", "8011", "EN AW-4032",
    ],
    "copper": ["Cu-ETP", "CW004A", "CW008A", "CW024A", "Cu-DHP", "Cu-OF", "C11000", "C10100", "C12200", "E-Cu58", "SF-Cu", "OFHC copper", "M1 copper", "2.0060", "C1100"],
    "brass": ["CuZn37", "CuZn39Pb3", "CuZn40", "CuZn36Pb3", "CW614N", "CW508L", "CW617N", "CW602N", "Ms58", "Ms63", "C26000", "C36000", "C2801", "C3604", "CuZn39Pb2", "CZ121", "L63", "LS59-1", "2.0401", "H62 brass", "CuZn38As"],
    "tin bronze": ["CuSn6", "CuSn8", "CuSn8P", "CuSn12", "CuSn10", "CuSn7Zn4Pb7", "CuSn5Zn5Pb5", "CW452K", "CW453K", "CC483K", "CC493K", "RG7", "Rg7", "Rg5", "GBZ12", "C51000", "C93200", "SAE 660", "PB102", "LG2", "C5191", "BrOF10-1", "2.1020"],
    "aluminium bronze": ["CuAl10Ni5Fe4", "CuAl10Fe5Ni5", "CuAl10Fe3Mn2", "CW307G", "CC333G", "C95400", "C63000", "C95500", "AB2", "CuAl8", "BrAZh9-4", "CA104"],
    "cupronickel": ["CuNi10Fe1Mn", "CuNi30Mn1Fe", "CuNi25", "CW352H", "C70600", "C71500", "MNZh5-1"],
    "nickel silver": ["CuNi12Zn24", "CuNi18Zn20", "CW403J", "C75200", "CuNi18Zn27"],
    "titanium": ["Ti-6Al-4V", "Ti6Al4V", "TiAl6V4", "Ti 6-4", "Ti64", "Ti-6Al-4V ELI", "Grade 5 titanium", "titanium grade 5", "titanium grade 2", "Grade 2 Ti", "Gr. 5 titanium", "3.7165", "3.7035", "TC4", "TA2", "VT6", "VT1-0", "UNS R56400", "UNS R50400", "Ti-3Al-2.5V", "CP titanium", "Ti Gr.23"],
    "nickel alloy": ["Inconel 718", "Inconel 625", "IN718", "IN625", "Alloy 718", "Alloy 625", "2.4668", "2.4856", "NiCr19NbMo", "NiCr22Mo9Nb", "Hastelloy C-276", "Hastelloy C22", "Hastelloy X", "Monel 400", "Monel K500", "Nimonic 80A", "Waspaloy", "Incoloy 825", "UNS N07718", "UNS N06625", "UNS N10276", "Alloy C276", "Rene 41", "Haynes 230", "Nickel 200", "2.4066"],
    "magnesium": ["AZ31", "AZ31B", "AZ91", "AZ91D", "AZ61A", "AM60", "AM60B", "AM50A", "ZK60", "WE43", "MgAl9Zn1", "EN-MCMgAl9Zn1", "3.5312", "UNS M11311", "MA2-1"],
    "zinc": ["Zamak 3", "Zamak 5", "ZAMAK5", "ZnAl4", "ZnAl4Cu1", "ZP3", "ZP0400", "ZP5", "ZL0410", "Z410", "ZA-8", "GD-ZnAl4Cu1", "ZA27"],
    "PE": ["PE-HD", "HDPE", "PEHD", "PE-LD", "LDPE", "PE-LLD", "LLDPE", "PE 100", "PE80", "PE-UHMW", "UHMWPE", "PE-HMW", "PE 1000", "PE500", "PE-MD"],
    "PP": ["PP", "PP-H", "PP-C", "PP-R", "PPH", "PP-B"],
    "PA": ["PA6", "PA 6", "PA66", "PA 6.6", "PA6-G", "PA12", "PA 11", "PA 46", "PA6/66", "PA612", "PA 6 cast", "PA2200", "PA12 MJF", "polyamide 6", "PA-66"],
    "PA glass": ["PA6-GF30", "PA66-GF30", "PA6 GF30", "PA66 GF 35", "PA 6.6 GF30", "PA66 GF50", "PA6-GF15", "PA12-GF30", "PA66+30%GF", "PA6 with 30% glass fibre", "PA 66 (GF 25)", "PA46-GF30", "PA6T/66-GF35"],
    "PC": ["PC", "polycarbonate", "Makrolon"],
    "POM": ["POM", "POM-C", "POM-H", "POM C", "POM-Copolymer", "Delrin", "acetal"],
    "PET": ["PET", "PET-P", "PETP", "PET-C"],
    "PBT": ["PBT", "Crastin"],
    "PBT glass": ["PBT-GF20", "PBT-GF30", "PBT GF30", "PBT-GF 30"],
    "ABS": ["ABS", "ABS-M30", "ASA"],
    "PMMA": ["PMMA", "PMMA GS", "PMMA XT", "Plexiglas"],
    "PVC": ["PVC-U", "uPVC", "PVC-C", "CPVC"],
    "soft PVC": ["PVC-P", "plasticised PVC"],
    "PS": ["PS", "PS-HI", "HIPS", "PS-I", "GPPS"],
    "PTFE": ["PTFE", "Teflon"],
    "PEEK": ["PEEK", "PEEK 450G", "PEEK natural"],
    "PPS": ["PPS"],
    "PPS glass": ["PPS-GF40", "PPS GF40", "PPS-GF 40"],
    "rubber": _each(
        ["NBR", "EPDM", "SBR", "VMQ", "silicone", "CR", "HNBR", "FKM"],
        [" 40 Shore A", " 50 ShA", " 60 Sh A", " 50A", " 60 ShA", " 55 shore", " 60 IRHD", " 50°ShA"],
    ) + ["NBR 70", "EPDM 60", "FKM 75", "VMQ 60", "NR 40 ShA", "IIR 50 Shore A", "CSM 60 Shore A", "ACM 60 ShA", "AU 60 Shore A", "HNBR 80 ShA", "FFKM 75", "Shore A 60 NBR", "NBR (70 Shore A)", "NBR70", "EPDM70", "FPM 80", "MVQ 40", "ECO 60 Shore A"],
    "hard rubber": ["TPU 85A", "TPU 95A", "TPE-S 60A", "TPE-U 90 ShA", "TPC 40D", "PUR 90 ShA", "PU 80 Shore A", "TPV 64A", "TPU 98A", "TPE 70A"],
    "CFRP": ["M40J/epoxy UD 0 deg", "T700/epoxy UD", "T300/epoxy", "CFRP UD Vf 60%", "carbon/epoxy prepreg", "CFK", "CFRP quasi-isotropic", "carbon twill laminate", "CFRP"],
    "GFRP": ["GFRP", "GFK", "E-glass/epoxy Vf 50%", "E-glass/polyester CSM laminate", "FR4", "FR-4", "G10", "satin weave glass laminate", "EP GC 202", "Hgw 2372"],
    "foam": ["PVC foam H100", "Divinycell H80", "Rohacell 51", "Rohacell 71 IG", "EPP 30 g/l", "EPS 100", "EPP 60 g/l", "PU foam 40 kg/m3", "XPS 300", "EPS 20 kg/m³", "PUR foam RG 35", "PET foam 115 kg/m3", "EPDM sponge"],
    "glass": ["N-BK7", "BK7", "N-SF11", "N-SF6", "B270", "Borofloat 33", "fused silica", "soda-lime glass", "ESG", "VSG", "borosilicate 3.3", "N-LAK9", "F2 glass", "Zerodur"],
    "alumina": ["Al2O3", "Al2O3 99.7 %", "99.5 % alumina", "Al₂O₃", "C799"],
    "zirconia": ["ZrO2", "Y-TZP", "3Y-TZP", "MgO-PSZ", "ZrO2 (Y-TZP)"],
    "silicon nitride": ["Si3N4", "SSN", "GPSN", "SiAlON"],
    "silicon carbide": ["SSiC", "SiC", "SiSiC", "RBSiC"],
    "tungsten carbide": ["WC-Co", "WC-6Co", "K10 carbide", "tungsten carbide", "cemented carbide"],
    "ferrite": ["ferrite Y30", "Y30 ferrite", "Y35 ferrite", "MnZn ferrite", "N87 ferrite"],
    "NdFeB": ["NdFeB N42", "NdFeB", "N52 magnet", "N35 magnet", "Nd2Fe14B", "neodymium magnet"],
    "SmCo": ["SmCo", "Sm2Co17", "SmCo5"],
    "concrete": ["C25/30", "C30/37", "C20/25", "C35/45", "B25 concrete", "C40/50", "C50/60"],
    "wood": ["GL24h", "GL28c", "C24 timber", "C24 spruce", "KVH", "BSH GL24"],
}  # fmt: skip


@pytest.mark.parametrize("family", NAMED)
def test_a_designation_is_of_its_family(family):
    """Written after a part's name, as a parts list does it; no word of it is left unread."""
    (E_low, E_high), (rho_low, rho_high) = FAMILIES[family]
    wrong = [said for said in NAMED[family] if not _is_of(said, E_low, E_high, rho_low, rho_high)]
    assert not wrong


def _is_of(said, E_low, E_high, rho_low, rho_high):
    value = value_of(said)
    return (
        value is not None and E_low <= value.E / 1e9 <= E_high and rho_low <= value.rho <= rho_high
    )


def value_of(said):
    """E, nu and rho of a part that is said to be of it, None where the text is not understood."""
    labels = [["bracket"]]
    bound = read_sentence(f"bracket: {said}", labels, TABLE)
    (choice,) = LOOKUP.settle(labels, bound).choices
    return None if choice.guessed or choice.unknown else choice.value
