"""The report page: complete, self-contained, small, and inert whatever words it is given."""

import base64
import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.fem.table import Span
from autophyx_tet.toolkit.report.html import (
    Case,
    PartRow,
    ReportContent,
    payload,
    report_page,
    write_report,
)
from autophyx_tet.toolkit.verdict.check import Check, area_words, mass_words, si, volume_words

HOSTILE = (
    "<script>alert(1)</script>",
    '"><img src=x onerror=alert(1)>',
    "</script><script>alert(1)</script>",
    "<!--<script>",
    '{{ 7 * 7 }}{% raw %}{# \' onclick="alert(1)"',
    "a\u2028b\u2029c & \0 $title ${data}",
)


def bar(cells=(4, 3, 5), *, names=("body",)):
    """A bar of 0.2 x 0.1 x 0.4 m, its regions in slabs along z, with a stiffness per tet."""
    mesh = box_mesh((0.2, 0.1, 0.4), cells)
    slab = np.minimum((mesh.centroids[:, 2] / 0.4 * len(names)).astype(int), len(names) - 1)
    mesh = type(mesh)(mesh.points, mesh.tets, slab, names)
    share = mesh.centroids[:, 2] / 0.4
    return mesh.with_material(
        ElementMaterial(1e6 * 1e3**share, 0.2 + 0.2 * share, 500 + 2000 * share)
    )


def bending(mesh, largest=0.01):
    """A clamped bar that bends along x with the square of its height [m]."""
    x = mesh.points
    return largest * np.stack([(x[:, 2] / 0.4) ** 2, 0 * x[:, 0], 0 * x[:, 0]], axis=1)


def case(text="a rubber bar", *, names=("body",), cells=(4, 3, 5), frames=0):
    mesh = bar(cells, names=names)
    u = bending(mesh)
    times = np.linspace(0, 1, frames) if frames else None
    motion = np.sin(2 * np.pi * times)[:, None, None] * u if frames else None
    rows = tuple(
        PartRow(name, f"{name} matter", name, 1e6, 0.3, 900.0, 1e-3, 0.9, "a table", Span(5e5, 2e6))
        for name in names
    )
    verdicts = (Check("holds shape", "passed", f"{text} holds its shape."),)
    stress = 1e4 * (1 + mesh.centroids[:, 2])
    return Case(text, mesh, rows, u, stress, motion, times, (4.2, 7.0), verdicts)


def content(*cases, title="bar.glb", **more):
    return ReportContent(title, cases or (case(),), **more)


class Elements(HTMLParser):
    """Tags, attributes and text of a page as a browser without scripts would see them."""

    def __init__(self, page):
        super().__init__()
        self.tags, self.attributes, self.words = [], [], []
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += [(tag, *pair) for pair in attrs]

    def handle_data(self, data):
        self.words.append(data)


def data_of(page):
    return json.loads(re.search(r'id="data">(.*?)</script>', page, re.S)[1])


def unpacked(text, dtype):
    return np.frombuffer(base64.b64decode(text), dtype)


def test_the_page_refers_to_nothing_outside():
    """No element loads anything, and the policy forbids what a script might try."""
    elements = Elements(report_page(content(case(frames=5))))
    loading = [a for a in elements.attributes if a[1] in ("src", "srcset", "data", "action")]
    assert loading == []
    assert [a[2] for a in elements.attributes if a[:2] == ("link", "href")] == ["data:,"]
    policy = next(a[2] for a in elements.attributes if "default-src" in (a[2] or ""))
    assert "default-src 'none'" in policy
    assert "unsafe-eval" not in policy
    assert "script-src 'sha256-" in policy


def test_hostile_words_stay_words():
    """Whatever the asset, its parts and the text are called, the page's elements are the same."""
    tame = content(case("text", names=tuple("abcdef")), warnings=("w",), provenance={"k": "v"})
    wild = content(
        case(HOSTILE[0], names=HOSTILE),
        title=HOSTILE[1],
        warnings=(HOSTILE[2],),
        provenance={HOSTILE[1]: HOSTILE[3]},
    )
    page = report_page(wild)
    elements = Elements(page)
    assert elements.tags == Elements(report_page(tame)).tags
    shown = "".join(elements.words)
    assert all(word.replace("\0", "") in shown.replace("\0", "") for word in HOSTILE[:5])
    assert data_of(page)["geometries"][0]["names"] == list(HOSTILE)


def test_the_data_block_cannot_end_its_element():
    """No markup character and no exotic line break is written literally into the JSON."""
    text = payload(content(case(names=HOSTILE)))
    assert not set("<>&\u2028\u2029") & set(text)


def test_the_numbers_arrive():
    """Geometry in float32, values per tet, displacements to 2e-5 of the largest."""
    one = case(frames=7)
    data = json.loads(payload(content(one)))
    geometry, values = data["geometries"][0], data["cases"][0]
    points = unpacked(geometry["points"], "<f4").reshape(-1, 3)
    np.testing.assert_allclose(points, one.mesh.points, rtol=1e-6, atol=1e-7)
    np.testing.assert_array_equal(unpacked(geometry["tets"], "<u4"), one.mesh.tets.ravel())
    for name in ("E", "nu", "rho"):
        wanted = getattr(one.mesh.material, name)
        np.testing.assert_allclose(unpacked(values[name], "<f4"), wanted, rtol=1e-6)
    motion = values["motion"]["step"] * unpacked(values["motion"]["steps"], "<i2")
    np.testing.assert_allclose(
        motion.reshape(one.motion.shape), one.motion, atol=2e-5 * np.abs(one.motion).max()
    )


def test_two_texts_on_one_mesh_share_its_geometry():
    assert len(json.loads(payload(content(case("a"), case("b"))))["geometries"]) == 1
    assert (
        len(json.loads(payload(content(case("a"), case("b", cells=(2, 2, 2)))))["geometries"]) == 2
    )


def test_long_motions_are_thinned_and_the_page_says_so(monkeypatch):
    """A motion beyond the page's room keeps its first and last frame, and a warning counts."""
    long = case(frames=100)
    monkeypatch.setattr(
        "autophyx_tet.toolkit.report.html.MOTION_NUMBERS", 10 * long.mesh.points.size
    )
    page = report_page(content(long))
    assert data_of(page)["cases"][0]["times"][::9] == [0, 1]
    assert "10 of 100 motion frames" in page


def test_twenty_thousand_tets_and_a_motion_stay_below_12_megabytes(tmp_path):
    """The size promised to whoever mails a report: 20k tets with as many frames as it holds."""
    big = case(cells=(10, 8, 42), frames=300)
    assert len(big.mesh.tets) > 20_000
    path = write_report(tmp_path / "deep" / "report.html", content(big))
    assert path.stat().st_size < 12e6
    assert [p.name for p in path.parent.iterdir()] == ["report.html"]


def test_tables_facts_and_quality_are_written_out():
    """The words and numbers are in the page itself, readable without scripts."""
    page = report_page(
        content(
            case("a steel leg"),
            quality={"Smallest angle [deg]": 12.5, "closed": True, "Angles": np.arange(50.0)},
            provenance={"input": {"sha256": "ab" * 32}},
            warnings=("taken as solid",),
        )
    )
    mass = case().mesh.mass
    for words in (
        "a steel leg holds its shape.", "body matter", "500\u00a0kPa – 2.00\u00a0MPa", "12.50",
        "yes", "input, sha256", "ab" * 32, "taken as solid", "10.0\u00a0mm", "4.20\u00a0Hz",
        mass_words(mass),
    ):  # fmt: skip
        assert words in page
    assert page.count("<figure>") == 1
    assert len(re.findall(r"<rect x=", page)) == 36


def test_si_prefixes():
    rows = (
        (1.2e9, "Pa", "1.20 GPa"),
        (999.9e6, "Pa", "1,000 MPa"),
        (1e6, "Pa", "1.00 MPa"),
        (0.0, "m", "0 m"),
        (3.456e-5, "m", "34.6 µm"),
        (-2e-3, "m", "-2.00 mm"),
        (2.1e11, "Pa", "210 GPa"),
        (float("nan"), "Pa", "– Pa"),
    )
    for value, unit, words in rows:
        assert si(value, unit) == words.replace(" ", "\u00a0"), value


def test_masses_and_volumes_in_the_unit_of_their_size():
    assert mass_words(0.0123) == "12.3\u00a0g"
    assert mass_words(4.1) == "4.10\u00a0kg"
    assert mass_words(25_000.0) == "25.0\u00a0t"
    assert volume_words(5e-9) == "5.00\u00a0mm³"
    assert volume_words(523.6e-6) == "524\u00a0cm³"
    assert volume_words(2.5) == "2.50\u00a0m³"
    for value, words in ((4e-6, "4.00 mm²"), (0.127, "1,270 cm²"), (1200.0, "1,200 m²")):
        assert area_words(value).replace("\u00a0", " ") == words


def test_wrong_content_is_refused_with_the_numbers():
    """Shapes, missing material and values that cannot be drawn are named."""
    one = case(frames=3)
    points, tets = len(one.mesh.points), len(one.mesh.tets)
    with pytest.raises(InputError, match="assign"):
        Case("t", one.mesh.with_material(None))
    with pytest.raises(InputError, match=rf"displacement .*\({points}, 3\).*\(2, 3\)"):
        Case("t", one.mesh, displacement=np.zeros((2, 3)))
    with pytest.raises(InputError, match=rf"von_mises .*\({tets},\)"):
        Case("t", one.mesh, von_mises=np.zeros(3))
    with pytest.raises(InputError, match="1 values that are not finite"):
        Case("t", one.mesh, von_mises=np.r_[np.zeros(tets - 1), np.nan])
    with pytest.raises(InputError, match="time"):
        Case("t", one.mesh, motion=one.motion)
    with pytest.raises(InputError, match="at least one case"):
        ReportContent("t", ())


def test_pictures_are_shown_with_their_captions():
    """A PNG given to the report lies in the page, its caption escaped; without one no heading."""
    page = report_page(content(pictures={"<features>": b"\x89PNG"}))
    assert "data:image/png;base64,iVBORw==" in page
    assert "<figcaption>&lt;features&gt;</figcaption>" in page
    assert "<figcaption>" not in report_page(content())


def test_what_makes_a_body_unfit_is_found_first():
    """Warnings stand above what holds, each in the order it was found."""
    of = {"warning": ("buckling", "failed"), "note": ("dial", "failed")}
    marks = ("good", "warning", "note", "warning", "good")
    outcomes = [of.get(mark, ("size", "passed")) for mark in marks]
    found = tuple(Check(*one, f"sentence {i}") for i, one in enumerate(outcomes))
    assert tuple(one.mark for one in found) == marks
    page = report_page(content(replace(case(), verdicts=found)))
    assert re.findall(r"sentence (\d)", page) == ["1", "3", "0", "2", "4"]
