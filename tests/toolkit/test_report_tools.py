"""The report as a tool, in a real browser: looks, parts, vibrations, ranges, files, a phone."""

import csv
import itertools
from dataclasses import replace

import numpy as np
import pytest
from autophyx_tet.converters.mesh.meshdata import read_mesh
from autophyx_tet.toolkit.report.html import ReportContent, write_report
from autophyx_tet.toolkit.verdict.description import Acting

from .browser import Visit
from .test_report import case

pytestmark = pytest.mark.browser
NAMES = ("foot", "leg", "seat")
FREQUENCIES = (4.2, 7.0)
# Of every point of every frame, drawn as large as the slider lets it: its place on the screen,
# -1 to 1 from border to border.
ON_SCREEN = """async () => {
    const view = report.views[0], { scene } = view.node._fullLayout;
    const { projection, view: look } = scene._scene.glplot.cameraParams;
    const row = (m, v, i) => [0, 1, 2, 3].reduce((sum, j) => sum + m[4 * j + i] * v[j], 0);
    const times = (m, v) => [0, 1, 2, 3].map((i) => row(m, v, i));
    const range = view.range(report.room), most = Math.max(...range.map(([lo, hi]) => hi - lo));
    const middle = range.map(([lo, hi]) => (lo + hi) / 2);
    const worst = [0, 0];
    for (let frame = 0; frame < report.times().length; frame += 1) {
        await report.update({ frame, factor: report.most });
        const [x, y, z] = view.order.map((axis) => view.coordinates(axis, report.most));
        for (let k = 0; k < x.length; k += 1) {
            const at = [x[k], y[k], z[k]].map((v, i) => (v - middle[i]) / most);
            const clip = times(projection, times(look, [...at, 1]));
            for (const i of [0, 1]) worst[i] = Math.max(worst[i], Math.abs(clip[i] / clip[3]));
        }
    }
    return worst;
}"""


def falling(frames=20):
    """A bar that falls by 0.6 m and shows two of its vibrations, nine parts of a long name."""
    one = case("oak", names=NAMES)
    times = np.linspace(0, 0.35, frames)
    motion = np.zeros((frames, *one.mesh.points.shape))
    motion[:, :, 2] = -4.905 * times[:, None] ** 2
    height = one.mesh.points[:, 2] / 0.4
    shapes = np.zeros((2, *one.mesh.points.shape))
    shapes[0, :, 0], shapes[1, :, 1] = height**2, 3 * height**3
    long = tuple(
        replace(row, source="A page https://example.org/a/very/long/address?of=it, p. 3")
        for row in one.parts
    )
    return replace(
        one, motion=motion, times=times, frequencies=FREQUENCIES, vibrations=shapes, parts=long,
        answers=(("Moves most", "seat by 600 mm"), ("Gives way", "no")), title="It falls",
        solved=(("Law", "linear"),), acting=(Acting("gravity", "gravity along -z"),),
    )  # fmt: skip


@pytest.fixture(scope="module")
def page(folder):
    content = ReportContent(
        "bar of oak.glb",
        (falling(),),
        made="2026-11-22 17:26 UTC · autophyx-tet 0.1.0 · 5.30 s",
        command="autophyx-tet run bar.glb --text oak --output out",
        warnings=("taken as solid", *(f"{'swivel_chair_posts_' * 9} {i}" for i in range(8))),
        loaded=(("Loaded", "bar.glb: a surface, 3 parts"), ("Mesh", "360 tets")),
    )
    return write_report(folder / "tools.html", content)


@pytest.fixture
def visit(chromium, page):
    visit = Visit(chromium, page, viewport={"width": 1400, "height": 900}, accept_downloads=True)
    yield visit
    visit.close()


def test_the_camera_holds_the_whole_motion(visit):
    """What falls by more than its own length never leaves the picture, and fills a part of it."""
    visit.page.get_by_label("In motion").check()
    visit.settled()
    across, up = visit.page.evaluate(ON_SCREEN)
    assert across <= 1
    assert 0.5 < up <= 1


def test_every_vibration_can_be_picked(visit):
    """The picker has every frequency; the second shape bends the other way, and swings."""
    visit.page.get_by_label("Vibration", exact=True).first.check()
    assert visit.page.locator("#mode option").all_inner_texts() == ["1: 4.2 Hz", "2: 7 Hz"]
    visit.settled()
    read = """report.views[0].moved.reduce((most, u, i) => {
        most[i % 3] = Math.max(most[i % 3], Math.abs(u)); return most; }, [0, 0, 0])"""
    size = 0.05 * np.linalg.norm([0.2, 0.1, 0.4])
    np.testing.assert_allclose(visit.page.evaluate(read), [size, 0, 0], atol=1e-6)
    visit.page.locator("#mode").select_option("1")
    visit.settled()
    np.testing.assert_allclose(visit.page.evaluate(read), [0, size, 0], atol=1e-6)
    visit.page.locator("#frame").fill("6")  # a quarter of the period
    visit.settled()
    np.testing.assert_allclose(visit.page.evaluate(read), 0, atol=1e-6)
    words = visit.page.locator("output[for=frame]").inner_text()
    assert words == f"{1e3 / FREQUENCIES[1] / 4:.1f} ms"


@pytest.mark.parametrize("width", [390, 1400])
def test_answers_stand_above_how_they_were_found(chromium, page, width):
    """In order down the page, none over another; of nine warnings five are open, all can be."""
    visit = Visit(chromium, page, viewport={"width": width, "height": 900})
    parts = ("> .answers", ".what", ".acting", ".case .answers", ".facts", ".command")
    order = [f"#scene {part}" for part in parts]
    places = [visit.page.locator(part).first.bounding_box() for part in order]
    for above, below in itertools.pairwise(places):
        assert above["y"] + above["height"] <= below["y"] + 1
    lines = visit.page.locator(".warnings li")
    assert sum(line.is_visible() for line in lines.all()) == 6
    visit.page.get_by_text("4 more").click()
    assert all(line.is_visible() for line in lines.all())
    assert visit.page.evaluate("document.documentElement.scrollWidth") <= width
    visit.close()


def test_looks_and_reset(visit):
    """Front, side and top look along an axis; reset undoes these, cuts and hidden parts."""
    read = "(({ eye }) => [eye.x, eye.y, eye.z])(report.views[0].camera)"
    for name, axis in (("Front", 1), ("Side", 0), ("Top", 2)):
        visit.page.get_by_role("button", name=name).click()
        visit.page.wait_for_timeout(300)
        eye = np.array(visit.page.evaluate(read))
        assert np.abs(eye[axis]) / np.linalg.norm(eye) > 0.99, name
    whole = visit.faces()
    visit.page.get_by_label("leg", exact=True).uncheck()
    visit.press("z")
    assert visit.faces() != whole
    visit.page.get_by_role("button", name="Reset").click()
    assert visit.faces() == whole
    assert visit.page.get_by_label("leg", exact=True).is_checked()


def test_a_hidden_part_is_not_drawn(visit):
    visit.page.get_by_label("seat", exact=True).uncheck()
    visit.settled()
    owners = "[...new Set(report.views[0].faces.owner.map((t) => report.views[0].tets.region[t]))]"
    assert sorted(visit.page.evaluate(owners)) == [0, 1]


def test_the_largest_value_is_marked(visit):
    """The stress of the case grows along z: the flag is at the top, and the words say where."""
    stress = falling().von_mises
    visit.press("6")
    words = visit.page.locator("#readout0").inner_text()
    assert words.startswith(f"largest {stress.max() / 1e3:.3g} kPa in seat, at (")
    flag = visit.page.evaluate("report.views[0].node.layout.scene.annotations[0]")
    assert flag["text"] == f"largest: {stress.max() / 1e3:.3g} kPa"
    top = visit.page.evaluate("report.views[0].range(report.room)[2]")
    assert flag["z"] > 0.5 * sum(top)


def test_the_range_of_the_colours_is_the_reader_s(visit):
    """A range that is typed in is that of the scale; what lies outside has its end's colour."""
    visit.press("4")
    low, high = visit.page.locator("#range input").all()
    low.fill("1000")
    high.fill("2000")
    high.press("Enter")
    visit.settled()
    scale = visit.page.locator("#scale").inner_text()
    assert "1000 kg/m³" in scale
    assert "2000 kg/m³" in scale
    shares, owner = visit.page.evaluate(
        """() => { const { intensity } = report.views[0].trace(report.state, report.scale());
        return [intensity, report.views[0].faces.owner]; }"""
    )
    rho = falling().mesh.material.rho[owner]
    np.testing.assert_array_equal(np.isclose(shares, 0), rho <= 1000)
    np.testing.assert_array_equal(np.isclose(shares, 1), rho >= 2000)


def test_the_range_is_in_the_unit_that_suits_it(visit):
    """Moduli to 1e9 Pa are read and typed in MPa, in so few figures that no field cuts them."""
    E = falling().mesh.material.E / 1e6
    visit.press("2")
    fields = visit.page.locator("#range input").all()
    assert visit.page.locator("#range > span").inner_text() == "MPa"
    words = [field.input_value() for field in fields]
    np.testing.assert_allclose([float(word) for word in words], [E.min(), E.max()], rtol=1e-3)
    assert max(map(len, words)) <= 6
    for field, value in zip(fields, ("10", "200"), strict=True):
        field.fill(value)
        field.press("Enter")
    visit.settled()
    ticks = visit.page.locator("#scale .ticks span").all_inner_texts()
    assert [ticks[0], ticks[-1]] == ["10 MPa", "200 MPa"]


def test_the_scale_of_the_axes_stands_beside_their_names(visit):
    """The round length is written below the axes: over no name and no line."""
    axes = visit.page.evaluate("report.views[0].axes()[1]")
    assert [axes["text"][3], axes["textposition"][3]] == ["50 mm", "bottom center"]
    assert axes["z"][3] < min(axes["z"][:3])


def test_what_is_compared_stands_at_the_top_of_its_column(chromium, folder):
    """Lines of a short answer are not stretched to the height of a long one beside it."""
    answers = ((("Moves most", "seat"), ("Gives way", end)) for end in ("no", "no, but " * 80))
    cases = [replace(falling(2), answers=one, text=one[1][1][:3]) for one in answers]
    path = write_report(folder / "columns.html", ReportContent("columns", tuple(cases)))
    visit = Visit(chromium, path, viewport={"width": 1280, "height": 900})
    tops = [word.bounding_box()["y"] for word in visit.page.locator(".case .answers dt").all()]
    assert tops[:2] == tops[2:]
    assert tops[1] - tops[0] < 40
    visit.close()


def test_files_can_be_taken_away(visit, tmp_path):
    """The mesh as meshio reads it, the field with a row a tet, the table of parts, a PNG."""
    one = falling()
    files = {}
    for label in ("Mesh .vtk", "Field .csv", "Materials .csv", "Picture .png"):
        with visit.page.expect_download() as waiting:
            visit.page.get_by_role("button", name=label).click()
        files[label] = tmp_path / waiting.value.suggested_filename
        waiting.value.save_as(files[label])
    assert files["Mesh .vtk"].name == "bar_of_oak.glb.vtk"
    back = read_mesh(files["Mesh .vtk"])
    np.testing.assert_allclose(back.points, one.mesh.points, atol=1e-7)
    np.testing.assert_array_equal(back.tets, one.mesh.tets)
    np.testing.assert_allclose(back.material.E, one.mesh.material.E, rtol=1e-6)
    rows = list(csv.DictReader(files["Field .csv"].open(encoding="utf-8")))
    np.testing.assert_allclose([float(r["rho"]) for r in rows], one.mesh.material.rho, rtol=1e-6)
    np.testing.assert_allclose([float(r["z"]) for r in rows], one.mesh.centroids[:, 2], atol=1e-6)
    table = list(csv.DictReader(files["Materials .csv"].open(encoding="utf-8")))
    assert [row["Part"] for row in table] == list(NAMES)
    assert files["Picture .png"].read_bytes()[:4] == b"\x89PNG"


def test_the_first_screen_says_what_was_done(visit):
    """Without scrolling: what, when, by what, what is not understood, and how to do it again."""
    for words in ("bar of oak.glb", "2026-11-22", "0.1.0", "taken as solid"):
        box = visit.page.get_by_text(words).first.bounding_box()
        assert box["y"] + box["height"] < 900, words


def test_no_table_is_cut_on_a_phone(chromium, page):
    """At 390 pixels every cell of every table, and every word of a source, is on the screen."""
    visit = Visit(chromium, page, viewport={"width": 390, "height": 844}, has_touch=True)
    visit.page.locator("#provenance summary").click()
    over = visit.page.evaluate(
        """() =>
        Array.from(document.querySelectorAll("td, th, li, dd, p, button, label")).filter((node) => {
            const { right, width } = node.getBoundingClientRect();
            return width > 0 && right > 391 && !node.closest("fieldset");
        }).map((node) => node.outerHTML)"""
    )
    assert over == []
    assert visit.page.evaluate("document.documentElement.scrollWidth") <= 390
    scrolled = (
        "[...document.querySelectorAll('.scroll')].every((n) => n.scrollWidth <= n.clientWidth)"
    )
    assert visit.page.evaluate(scrolled)
    assert visit.page.locator(".sources a").first.inner_text() == "example.org"
    visit.close()


@pytest.mark.slow
def test_the_first_picture_is_there_within_three_seconds(chromium, folder, capsys):
    """9,000 tets, a motion: CPU seconds of the page's thread until it is drawn, the best of 3."""
    big = case("oak", names=NAMES, cells=(8, 6, 31), frames=6)
    visit = Visit(chromium, write_report(folder / "big.html", ReportContent("big", (big,))))
    meter = visit.page.context.new_cdp_session(visit.page)
    meter.send("Performance.enable", {"timeDomain": "threadTicks"})
    seconds = []
    for _ in range(3):
        visit.page.reload()
        visit.page.wait_for_selector("body[data-ready]", timeout=60_000)
        found = {m["name"]: m["value"] for m in meter.send("Performance.getMetrics")["metrics"]}
        seconds.append(found["TaskDuration"])
    with capsys.disabled():
        print(f"\nfirst picture after {', '.join(f'{s:.2f}' for s in sorted(seconds))} CPU s")
    assert min(seconds) < 3
    visit.close()
