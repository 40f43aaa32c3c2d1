"""The motion of a report in a real browser: played, scrubbed, two texts side by side."""

from dataclasses import replace

import numpy as np
import pytest
from autophyx_tet.toolkit.report.html import write_report

from .browser import Visit
from .test_report import case, content

pytestmark = pytest.mark.browser
NAMES = ("foot", "leg", "seat")


@pytest.fixture
def moving(chromium, folder):
    """Two texts on one bar, each with a motion of 25 frames in half a second."""
    stiff, soft = case("a stiff bar", names=NAMES, frames=25), case("a soft bar", frames=25)
    soft = replace(soft, motion=4 * soft.motion)
    visit = Visit(chromium, write_report(folder / "two.html", content(stiff, soft)))
    visit.page.get_by_label("In motion").check()
    yield visit
    visit.close()


def test_play_advances_the_frames_and_space_stops_them(moving):
    """The button starts the motion, the picture changes, the space bar holds it."""
    slider = moving.page.locator("#frame")
    start, before = slider.input_value(), moving.picture()
    moving.page.get_by_role("button", name="Play").click()
    moving.page.locator("#play", has_text="Pause").wait_for()
    seen = set()
    for _ in range(20):
        moving.page.wait_for_timeout(150)
        seen.add(slider.input_value())
    assert len(seen | {start}) >= 4
    moving.page.locator("h1").click()
    moving.page.evaluate("document.activeElement.blur()")
    moving.press(" ")
    moving.page.locator("#play", has_text="Play").wait_for()
    held = slider.input_value()
    moving.page.wait_for_timeout(400)
    assert slider.input_value() == held
    slider.fill("6")  # a quarter of the swing: the largest bend
    moving.settled()
    assert np.abs(moving.picture() - before).sum(axis=2).mean() > 1


def test_scrubbing_shows_the_frame_that_was_asked_for(moving):
    """Frame 6 of a sine over 24 steps is its crest; `.` and `,` step by one; the time is told."""
    read = "Math.max(...report.views[0].moved.map(Math.abs))"
    moving.page.locator("#frame").fill("6")
    moving.settled()
    assert moving.page.evaluate(read) == pytest.approx(0.01, rel=1e-3)
    assert moving.page.locator("output[for=frame]").inner_text() == "250 ms"
    moving.press(".")
    moving.press(".")
    assert moving.page.evaluate("report.state.frame") == 8
    moving.press(",")
    assert moving.page.evaluate("report.state.frame") == 7
    assert moving.page.evaluate(read) == pytest.approx(0.01 * np.sin(2 * np.pi * 7 / 24), rel=1e-3)


def test_two_texts_share_exaggeration_scale_and_camera(moving):
    """Side by side means alike: what differs between the pictures is the material alone."""
    assert moving.page.locator("blockquote").all_inner_texts() == ["A a stiff bar", "B a soft bar"]
    moving.press("5")
    moving.page.locator("#frame").fill("6")
    moving.settled()
    scale = moving.page.locator("#scale").inner_text()
    assert "40 mm" in scale
    shares = moving.page.evaluate(
        """() => {
            const scale = new Scale(MAPS.moved, 0, 0.04);
            return report.views.map((v) => Math.max(...v.trace(report.state, scale).intensity));
        }"""
    )
    np.testing.assert_allclose(shares, [0.25, 1], rtol=1e-3)
    first = moving.page.evaluate(
        "Object.values(report.views[0].node._fullLayout.scene._scene.getCamera().eye)"
    )
    moving.page.locator("#plot0").scroll_into_view_if_needed()
    box = moving.page.locator("#plot0").bounding_box()
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    moving.page.mouse.move(*middle)
    moving.page.mouse.down()
    for share in np.linspace(0.2, 1, 5):  # as slowly as a hand: the page looks once a frame
        moving.page.wait_for_timeout(300)
        moving.page.mouse.move(middle[0] + 80 * share, middle[1] + 20 * share)
    moving.page.wait_for_timeout(300)
    moving.page.mouse.up()
    read = "report.views.map((v) => Object.values(v.node._fullLayout.scene._scene.getCamera().eye))"
    for _ in range(40):  # until both have come to rest
        moving.page.wait_for_timeout(250)
        eyes = np.array(moving.page.evaluate(read))
        if np.abs(eyes[0] - first).max() > 0.05 and np.allclose(eyes[0], eyes[1], atol=1e-6):
            break
    assert np.abs(eyes[0] - first).max() > 0.05
    np.testing.assert_allclose(eyes[0], eyes[1], atol=1e-6)


@pytest.fixture
def dialled(chromium, folder):
    """A bar of E and of 100 E and 10^4 E, that moves a tenth as far each time."""
    cases = []
    for k, alpha in enumerate((0.0, 0.5, 1.0)):
        bar = case("a bar", names=NAMES, frames=5)
        parts = tuple(replace(part, E=1e6 * 100.0**k) for part in bar.parts)
        cases.append(replace(bar, parts=parts, motion=0.1**k * bar.motion, alpha=alpha))
    visit = Visit(chromium, write_report(folder / "dial.html", content(*cases)))
    yield visit
    visit.close()


def test_the_dial_tells_e_and_switches_among_the_motions(dialled):
    """log E is even between its known places; the nearest motion is shown alone, or all again."""
    shown = "report.views.filter((v) => v.node.clientWidth > 0).map((v) => v.index)"
    assert dialled.page.evaluate(shown) == [0, 1, 2]
    for alpha, E, nearest in (("0.25", 1e7, 0), ("0.5", 1e8, 1), ("0.75", 1e9, 2), ("1", 1e10, 2)):
        found = dialled.page.evaluate(f"dial.stiffness('a bar', {alpha})")
        assert found == pytest.approx([E] * len(found), rel=1e-9)
        if alpha == "0.75":  # between two: either is the nearest
            continue
        dialled.page.locator("#dial").fill(alpha)
        dialled.settled()
        assert dialled.page.evaluate(shown) == [nearest]
    dialled.page.get_by_role("button", name="Side by side").click()
    dialled.settled()
    assert dialled.page.evaluate(shown) == [0, 1, 2]
