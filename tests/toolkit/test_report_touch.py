"""The body to pull: the page steps it as the solver does, and it follows hand and finger."""

from dataclasses import replace

import numpy as np
import pytest
from autophyx_tet.fem import ElementMaterial, Supports, box_mesh
from autophyx_tet.fem.errors import UsageError
from autophyx_tet.fem.reduced.elasticity import ReducedElasticity
from autophyx_tet.fem.scene.scene import Scene
from autophyx_tet.fem.solve.schemes import Kinematics, Scheme, Step
from autophyx_tet.toolkit.asset.document import Sidecar
from autophyx_tet.toolkit.report import pages
from autophyx_tet.toolkit.report.html import Case, ReportContent, write_report
from autophyx_tet.toolkit.report.pages import FINGER, shown, simulation_page, touch_of
from autophyx_tet.toolkit.simulation.simulate import simulate

from .browser import Visit

NEWTON = 2  # of the page


def standing(E=2e4, cells=(3, 3, 9)):
    """A post of 0.1 x 0.1 x 0.3 m, clamped at its foot."""
    mesh = box_mesh((0.1, 0.1, 0.3), cells)
    mesh = mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=E, nu=0.4, rho=1000.0))
    held = Supports.clamp(len(mesh.points), mesh.points[:, 2] == 0)
    return Scene(mesh=mesh, supports=held)


@pytest.fixture(scope="module")
def touch():
    return touch_of(standing())


@pytest.fixture(scope="module")
def page(touch, folder):
    content = ReportContent("post", (Case("jelly", standing().mesh, touch=touch),))
    return write_report(folder / "touch.html", content)


@pytest.fixture
def visit(chromium, page):
    visit = Visit(chromium, page)
    visit.page.locator("#touch").scroll_into_view_if_needed()
    yield visit
    visit.close()


def until(visit, condition):
    """Wait until ``condition`` holds; Playwright's own waiting needs eval: the page forbids it."""
    for _ in range(200):
        if visit.page.evaluate(condition):
            return
        visit.page.wait_for_timeout(50)
    raise AssertionError(condition)


class Solver:
    """Steps of the reduced body by the solver's law and scheme, Newton as often as the page."""

    def __init__(self, model, rows, target, stiffness):
        self.elasticity = ReducedElasticity(model)
        self.rows, self.target, self.stiffness = rows, target, stiffness
        zero = np.zeros(model.dofs)
        self.now, self.before = Kinematics(zero, zero, zero), None

    def step(self, dt):
        step = Step.of(Scheme.BDF2, dt, self.now, self.before)
        q = step.target.copy()
        for _ in range(NEWTON):
            pull = self.stiffness * self.rows.T @ (self.rows @ q - self.target)
            g = self.elasticity.response(q).force + pull + step.factor * (q - step.target)
            K = self.elasticity.tangent(q) + self.stiffness * self.rows.T @ self.rows
            q -= np.linalg.solve(K + step.factor * np.eye(len(q)), g)
        self.now, self.before = step.ended(q), self.now
        return q


@pytest.mark.browser
def test_the_steps_of_the_page_are_those_of_the_solver(visit, touch):
    """A hand pulls the top far (strains of tens of percent): 40 steps agree to 1e-12 m."""
    found = visit.page.evaluate(
        """() => {
            const touch = window.touches[0], { body } = touch;
            body.rest();
            const top = touch.points.length / 3 - 1; // points rise in z
            touch.grab({ corners: [top, top, top], weights: [1, 0, 0], place: [0, 0, 0.3] });
            const { rows, stiffness } = body.grip, target = [0.12, -0.05, -0.02], steps = [];
            body.rest();
            body.grip = { rows, stiffness, target };
            for (let i = 0; i < 40; i += 1) {
                body.step(1 / 60);
                steps.push([...body.q]);
            }
            body.grip = null;
            return { rows: rows.map((row) => [...row]), target, stiffness, steps };
        }"""
    )
    rows, target = np.array(found["rows"]), np.array(found["target"])
    solver = Solver(touch.model, rows, target, found["stiffness"])
    ours = np.array([solver.step(1 / 60) for _ in range(40)])
    u = touch.model.basis @ ours.T
    gap = touch.model.basis @ (np.array(found["steps"]) - ours).T
    assert np.abs(u).max() > 0.05
    assert np.abs(gap).max() < 1e-12


@pytest.mark.browser
def test_a_mouse_pulls_the_body_and_lets_it_go(visit):
    """It follows the pointer, says with what force, swings back, and comes to rest unpulled."""
    box = visit.page.locator("#touch0").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + 0.4 * box["height"]
    before = visit.page.locator("#touch0").screenshot()
    visit.page.mouse.move(x, y)
    visit.page.mouse.down()
    visit.page.mouse.move(x + 80, y, steps=8)
    until(visit, "touches[0].times.length > 10")
    held = visit.page.locator("#pull0").inner_text()
    assert "pulled with" in held
    assert "N, moved" in held
    assert visit.page.locator("#touch0").screenshot() != before
    largest = "Math.max(...touches[0].drawn.map((x, i) => Math.abs(x - touches[0].points[i])))"
    assert visit.page.evaluate(largest) > 0.01
    visit.page.mouse.up()
    assert visit.page.evaluate("touches[0].body.grip") is None
    visit.page.wait_for_timeout(100)
    assert visit.page.locator("#pull0").inner_text() == ""


@pytest.mark.browser
def test_beside_the_body_a_drag_turns_it_and_a_wheel_comes_nearer(visit):
    box = visit.page.locator("#touch0").bounding_box()
    visit.page.mouse.move(box["x"] + 10, box["y"] + 10)
    side, away = visit.page.evaluate("[touches[0].orbit.side, touches[0].orbit.away]")
    visit.page.mouse.down()
    visit.page.mouse.move(box["x"] + 60, box["y"] + 10)
    visit.page.mouse.up()
    visit.page.mouse.wheel(0, -100)
    until(visit, f"touches[0].orbit.away < {away}")
    assert visit.page.evaluate("touches[0].orbit.side") != side
    assert visit.page.evaluate("touches[0].body.q.every((x) => x === 0)")


@pytest.mark.browser
def test_the_slider_makes_it_stiffer(visit):
    """Compliance goes with 1 / E."""
    read = """() => {
        const { body } = touches[0];
        return body.compliance([1, 2, 3].map((k) => new Float64Array(body.dofs).fill(k)));
    }"""
    soft = visit.page.evaluate(read)
    visit.page.locator("#alpha").fill("1")
    assert visit.page.locator("output[for=alpha]").inner_text() == "E × 10"
    assert visit.page.evaluate(read) == pytest.approx(soft / 10, rel=1e-9)


@pytest.mark.browser
def test_a_step_that_cannot_be_solved_is_made_of_smaller_ones(visit):
    """Pulled through itself in one step, the body stays finite and goes on."""
    ends = visit.page.evaluate(
        """() => {
            const touch = touches[0], { body } = touch;
            const top = touch.points.length / 3 - 1;
            touch.grab({ corners: [top, top, top], weights: [1, 0, 0], place: [0, 0, 0.3] });
            body.grip.stiffness *= 1e4;
            body.grip.target = [0.1, 0, -0.8];
            const dts = new Set();
            for (let i = 0; i < 20; i += 1) {
                body.step(touch.dt);
                dts.add(body.dt);
            }
            body.grip = null;
            for (let i = 0; i < 60; i += 1) body.step(touch.dt);
            const most = Math.max(...body.q.map(Math.abs));
            body.rest();
            return [most, Math.min(...dts), touch.dt];
        }"""
    )
    assert np.isfinite(ends[0])
    assert ends[1] < ends[2]


@pytest.mark.browser
def test_a_pull_without_a_step_is_told(visit):
    """A hand beyond all numbers: the body keeps its place, and the reader is told."""
    visit.page.evaluate(
        """() => {
            const touch = touches[0], top = touch.points.length / 3 - 1;
            touch.grab({ corners: [top, top, top], weights: [1, 0, 0], place: [0, 0, 0.3] });
            touch.body.grip.target = [NaN, 0, 0];
        }"""
    )
    until(visit, "touches[0].readout.textContent.includes('it was stopped')")
    assert visit.page.evaluate("touches[0].body.q.every(Number.isFinite)")


@pytest.mark.browser
def test_a_finger_pulls_it_on_a_phone(chromium, page):
    """Touch events, and the page is as wide as the screen."""
    options = {"viewport": {"width": 390, "height": 800}, "has_touch": True, "is_mobile": True}
    visit = Visit(chromium, page, **options)
    visit.page.locator("#touch").scroll_into_view_if_needed()
    assert visit.page.evaluate("document.documentElement.scrollWidth") <= 390
    box = visit.page.locator("#touch0").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + 0.45 * box["height"]
    finger = visit.page.context.new_cdp_session(visit.page)
    for kind, shift in (("touchStart", 0), ("touchMove", 20), ("touchMove", 40)):
        points = [{"x": x + shift, "y": y}]
        finger.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    until(visit, "touches[0].times.length > 3")
    assert "pulled with" in visit.page.locator("#pull0").inner_text()
    finger.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    until(visit, "touches[0].body.grip === null")
    visit.close()


@pytest.mark.slow
def test_magnification_and_pace_are_those_that_show_it(touch):
    """A corner of a post's tip bends, shears and twists; stiffer by 1e4: larger and slower."""
    side, length, E = 0.1, 0.3, 2e4
    G, inertia, torsion = E / 2.8, side**4 / 12, 0.1406 * side**4  # Roark, of a square
    bends = length**3 / (3 * E * inertia)
    shears, twists = length / (5 / 6 * G * side**2), (side / 2) ** 2 * length / (G * torsion)
    exact = FINGER * (bends + shears + twists)
    assert touch.moved == pytest.approx(exact, rel=0.1)  # and the dent at the corner itself
    assert touch.magnification == 1
    assert "as large as it is and in its own time" in touch.words
    model = touch.model.with_moduli(1e4 * touch.model.E)
    stiff = shown(model)
    assert stiff.moved == pytest.approx(1e-4 * touch.moved, rel=1e-9)
    diagonal = np.sqrt(0.1**2 + 0.1**2 + 0.3**2)
    assert stiff.magnification * stiff.moved / diagonal == pytest.approx(0.1, rel=0.6)
    assert f"magnified {stiff.magnification:,.0f} times" in stiff.words
    assert stiff.slowness > 10


@pytest.mark.slow
def test_what_the_body_to_pull_is_not_is_said(touch, monkeypatch, caplog):
    """A model that is not what it says is a warning here too, not only where it moves."""
    poor = replace(touch.model, accuracy=touch.model.accuracy._replace(frequency=1.2))
    monkeypatch.setattr(pages, "touch_of", lambda scene: shown(poor))
    simulation_page("post", simulate(standing().mesh), Sidecar(up="z"), touch=True)
    assert "of the body to pull, the reduced body's lowest frequency is 1.200" in caplog.text


def test_what_cannot_be_pulled_is_refused():
    mesh = standing().mesh
    with pytest.raises(UsageError, match="nothing holds it"):
        touch_of(Scene(mesh=mesh))
    with pytest.raises(UsageError, match="give --report"):
        simulate(mesh, touch=True)


@pytest.mark.slow
def test_a_page_of_a_free_body_has_none_and_says_why(tmp_path, caplog):
    mesh = standing(cells=(1, 1, 2)).mesh
    path = tmp_path / "free.html"
    simulate(mesh, scenario="squeeze", touch=True, report=path)
    assert 'id="touch0"' not in path.read_text()
    assert "no body to pull: nothing holds it" in caplog.text
    simulate(mesh, touch=True, report=path)
    assert 'id="touch0"' in path.read_text()
    assert path.stat().st_size < 12e6


@pytest.mark.browser
@pytest.mark.slow
def test_a_frame_is_done_in_16_ms(chromium, touch, folder):
    """Step, skin and draw with 34 coordinates and 250 cells: each cell is split, its energy too."""
    model = touch.model
    cells = np.resize(np.arange(len(model.cells)), 250)
    shares = np.bincount(cells)[cells]
    model = model.on_cells(cells, model.weights[cells] / shares)
    content = ReportContent("p", (Case("jelly", standing().mesh, touch=shown(model)),))
    visit = Visit(chromium, write_report(folder / "frames.html", content))
    visit.page.evaluate(
        "touches[0].grab({ corners: [9, 9, 9], weights: [1, 0, 0], place: [0, 0, 0.3] }) || 0"
    )
    visit.page.evaluate("touches[0].body.v.fill(0.01); touches[0].run()")
    until(visit, "touches[0].times.length > 100")
    times = visit.page.evaluate("touches[0].times")
    visit.close()
    assert model.dofs == 34
    assert np.median(times) <= 16.0
