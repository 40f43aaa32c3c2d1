"""The report in a real browser: it draws, obeys its controls, and keeps to itself."""

import io
import itertools

import numpy as np
import pytest
from autophyx_tet.fem.mesh import boundary_faces
from autophyx_tet.toolkit.report.html import write_report
from PIL import Image

from .browser import Visit
from .test_report import HOSTILE, case, content

pytestmark = pytest.mark.browser
NAMES = ("foot", "leg", "seat")


@pytest.fixture(scope="module")
def one(folder):
    return write_report(folder / "one.html", content(case("oak", names=NAMES)))


@pytest.fixture
def visit(chromium, one):
    visit = Visit(chromium, one)
    yield visit
    visit.close()


def test_the_mesh_is_drawn_in_colours(visit):
    """The middle of the view is coloured in many shades; its edge is the grey ground."""
    picture = visit.picture()
    high, wide, _ = picture.shape
    middle = picture[high // 4 : -high // 4, wide // 4 : -wide // 4].reshape(-1, 3)
    assert (np.ptp(middle, axis=1) > 40).mean() > 0.1
    assert (np.ptp(picture[:, 2], axis=1) < 10).all()
    assert len(np.unique(middle, axis=0)) > 50


def test_every_map_has_its_own_picture_and_scale(visit):
    """Keys 1 to 6 choose the colours; the scale says what is shown, and E is logarithmic."""
    pictures, scales = [], []
    for key in "123456":
        visit.press(key)
        pictures.append(visit.picture())
        scales.append(visit.page.locator("#scale").inner_text())
    assert "part" in scales[0]
    assert visit.page.locator("#parts label").all_inner_texts() == list(NAMES)
    assert "Young's modulus E, logarithmic" in scales[1]
    assert "10 MPa" in scales[1]
    assert "kg/m³" in scales[3]
    assert "mm" in scales[4]
    assert "Pa" in scales[5]
    for a, b in itertools.pairwise(pictures):
        assert np.abs(a - b).sum(axis=2).mean() > 1


SURFACE = """([cut, hidden]) => {
    const { tets } = report.views[0];
    const faces = new Surface(tets, tets.shown(new Set(hidden)), cut);
    const { a, b, c, owner } = faces;
    return { a, b, c, owner, x: [0, 1, 2].map((axis) => Array.from(faces.atRest(axis))) };
}"""


def test_the_drawn_surface_is_the_boundary_of_the_shown_parts(visit):
    """Without a hidden part the page finds the faces that the library finds, with their owners."""
    mesh = case("oak", names=NAMES).mesh
    for hidden in ((), ("leg",)):
        keep = np.flatnonzero([mesh.region_names[r] not in hidden for r in mesh.region])
        drawn = visit.page.evaluate(SURFACE, [None, list(hidden)])
        wanted = boundary_faces(mesh.tets[keep])
        ours = {
            (*np.sort(mesh.points[f].round(6), axis=0).ravel(), keep[t])
            for f, t in zip(wanted.faces.tolist(), wanted.tet, strict=True)
        }
        x = np.transpose(drawn["x"]).round(6)
        corners = np.transpose([drawn[name] for name in "abc"])
        theirs = {
            (*np.sort(x[f], axis=0).ravel(), t)
            for f, t in zip(corners.tolist(), drawn["owner"], strict=True)
        }
        assert theirs == ours


def test_a_cut_is_a_plane_with_a_cap(visit):
    """The clipped surface is closed: its divergence is the share of the volume below the plane.

    Nothing is drawn beyond the plane, and what lies in it has the area of the section.
    """
    size = np.array([0.2, 0.1, 0.4])
    for axis, at, flip in [(0, 0.071, False), (2, 0.17, True), (1, 0.02, False)]:
        cut = {"axis": axis, "at": at, "flip": flip}
        drawn = visit.page.evaluate(SURFACE, [cut, []])
        x = np.transpose(drawn["x"])
        away = (x[:, axis] - at) * (-1 if flip else 1)
        assert away.max() < 1e-7
        a, b, c = (x[drawn[name]] for name in "abc")
        normals = np.cross(b - a, c - a) / 2
        left = (size[axis] - at if flip else at) / size[axis]
        volume = np.einsum("fi,fi->", a, normals) / 3
        assert volume == pytest.approx(left * size.prod(), rel=1e-5)  # float32 coordinates
        cap = (np.abs(away[np.transpose([drawn[name] for name in "abc"])]) < 1e-7).all(axis=1)
        section = np.linalg.norm(normals[cap], axis=1).sum()
        assert section == pytest.approx(size.prod() / size[axis], rel=1e-5)


def test_the_slider_moves_the_cut(visit):
    """Choosing an axis cuts the body, the slider's own arrow keys move the cut, `o` heals it."""

    def ends():
        visit.settled()
        z = visit.page.evaluate("Array.from(report.views[0].faces.atRest(2))")
        return pytest.approx((min(z), max(z)), abs=1e-6)

    before = visit.picture()
    visit.press("z")
    assert ends() == (0, 0.2)
    assert np.abs(visit.picture() - before).sum(axis=2).mean() > 1
    visit.page.locator("#cut-at").focus()
    for _ in range(25):
        visit.page.keyboard.press("ArrowLeft")
    assert ends() == (0, 0.1)
    assert visit.page.locator("output[for=cut-at]").inner_text() == "100 mm"
    visit.page.get_by_text("Other side").click()
    assert ends() == (0.1, 0.4)
    visit.press("o")
    assert ends() == (0, 0.4)


def test_exaggeration_multiplies_the_displacement(visit):
    """The drawn shape is points + factor u, in the units of the page; at rest it is the points."""
    mesh = case("oak", names=NAMES).mesh
    bend = 0.01 * (mesh.points[:, 2] / 0.4) ** 2
    read = """() => {
        const view = report.views[0];
        return [view.faces.origin, Array.from(view.coordinates(0, 3), (x) => x / view.zoom)];
    }"""
    for shape, factor in [("Under load", 3), ("At rest", 0)]:
        visit.page.get_by_label(shape).check()
        visit.settled()
        origin, drawn = visit.page.evaluate(read)
        assert set(origin) == set(mesh.boundary.faces.ravel().tolist())
        wanted = (mesh.points[:, 0] + factor * bend)[origin]
        np.testing.assert_allclose(drawn, wanted, atol=1e-6)


def test_sharp_edges_are_drawn_sharp(visit):
    """A box keeps its faces apart: three copies of a corner, two of an edge, one inside a face."""
    origin = np.array(visit.page.evaluate("report.views[0].faces.origin"))
    mesh = case("oak", names=NAMES).mesh
    lo, hi = mesh.bounds
    walls = ((mesh.points == lo) | np.isclose(mesh.points, hi)).sum(axis=1)
    copies = np.bincount(origin, minlength=len(mesh.points))
    np.testing.assert_array_equal(copies, walls)


@pytest.mark.parametrize("map_key", ["2", "5"])  # values per tet, values per point
def test_the_pointer_reads_the_values(visit, map_key):
    """From the top of the bar down the readout names seat, leg and foot, with their numbers."""
    visit.press(map_key)
    picture = visit.picture()
    body = np.argwhere(np.ptp(picture, axis=2) > 40)  # the ground is grey
    box = visit.page.locator("#plot0").bounding_box()
    said = []
    for share in (0.03, 0.5, 0.97):
        y, x = body[int(share * len(body))].tolist()
        for step in range(40):  # plotly picks what is under a pointer that has just moved
            visit.page.mouse.move(box["x"] + x + step % 3, box["y"] + y)
            visit.page.wait_for_timeout(80)
            line = visit.page.locator("#readout0").inner_text()
            if step > 2 and line not in ("", *said):
                break
        said.append(line)
    assert [line.split()[0] for line in said] == ["seat", "leg", "foot"]
    assert all("kg/m³" in line and "moved" in line and "stress" in line for line in said)


def test_hostile_words_do_nothing(chromium, folder):
    """No dialog, no foreign element; the words are read as they were written."""
    wild = content(
        case(HOSTILE[0], names=HOSTILE), case(HOSTILE[2]), title=HOSTILE[1], warnings=(HOSTILE[2],)
    )
    visit = Visit(chromium, write_report(folder / "wild.html", wild))
    visit.press("1")
    assert visit.page.locator("h1").inner_text() == HOSTILE[1]
    assert visit.page.locator("tbody th").first.inner_text() == HOSTILE[0]
    assert HOSTILE[1] in visit.page.locator("#parts").inner_text()
    assert visit.page.locator("img").count() == 0
    assert visit.page.locator("script").count() == 3
    visit.close()


def test_a_script_that_is_not_ours_is_blocked(visit):
    """The policy of the page stops injected markup, inline handlers and requests."""
    visit.page.evaluate(
        """() => {
            const div = document.createElement("div");
            div.innerHTML = '<img src="data:," onerror="window.hacked = 1">';
            document.body.append(div);
            const script = document.createElement("script");
            script.textContent = "window.hacked = 2";
            document.body.append(script);
        }"""
    )
    visit.page.wait_for_timeout(200)
    assert visit.page.evaluate("window.hacked") is None
    assert any("Content Security Policy" in error for error in visit.errors)
    visit.errors.clear()


def test_a_phone_needs_no_sideways_scrolling(chromium, one):
    """At 360 pixels the page is as wide as the screen; only tables scroll, inside their frame."""
    visit = Visit(chromium, one, viewport={"width": 360, "height": 740}, has_touch=True)
    assert visit.page.evaluate("document.documentElement.scrollWidth") <= 360
    assert visit.picture().std() > 10
    visit.close()


@pytest.mark.parametrize(("scheme", "low", "high"), [("dark", 0, 60), ("light", 200, 255)])
def test_the_page_follows_dark_and_light(chromium, one, scheme, low, high):
    visit = Visit(chromium, one, color_scheme=scheme)
    corner = Image.open(io.BytesIO(visit.page.screenshot())).convert("L").getpixel((3, 3))
    assert low <= corner <= high
    visit.close()


def test_without_webgl_the_numbers_remain(chromium, one):
    """A browser that cannot draw says so once and shows the tables."""
    blind = "HTMLCanvasElement.prototype.getContext = () => null"
    visit = Visit(chromium, one, ready=".notice", script=blind)
    assert "WebGL" in visit.page.locator("#viewer .notice").last.inner_text()
    assert visit.page.locator("#materials tbody tr").count() == len(NAMES)
    visit.close()
