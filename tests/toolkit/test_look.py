"""The colours of an asset on its tets: nearest surface first, few colours, drawn as they are."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.predictors.asset import Asset, Part
from autophyx_tet.toolkit.report.html import payload, write_report
from autophyx_tet.toolkit.report.pages import MOST, look_of

from .browser import Visit
from .test_report import bar, case, content

RED, BLUE = (200, 30, 20), (20, 40, 190)


def painted(colours):
    """The bar of 0.2 x 0.1 x 0.4 m as a surface, its faces coloured along z."""
    box = box_mesh((0.2, 0.1, 0.4), (2, 1, 8))
    surface = trimesh.Trimesh(box.points, box.boundary.faces, process=False)
    share = surface.triangles_center[:, 2] / 0.4
    rows = np.array(colours)[np.minimum((share * len(colours)).astype(int), len(colours) - 1)]
    surface.visual.face_colors = np.column_stack([rows, np.full(len(rows), 255)])
    return Asset("bar", (Part("body", surface),), up="z")


def test_a_tet_looks_as_the_surface_beside_it():
    """Lower half red, upper half blue: so is every tet, those inside too, but near the middle."""
    mesh = bar((4, 3, 10))
    look = look_of(painted([RED, BLUE]), mesh)
    assert set(look.colors) == {"#c81e14", "#1428be"}
    upper = mesh.centroids[:, 2] > 0.2
    clear = np.abs(mesh.centroids[:, 2] - 0.2) > 0.06  # half the body's thickness, and a sample
    blue = np.array(look.colors)[look.index] == "#1428be"
    np.testing.assert_array_equal(blue[clear], upper[clear])


def test_many_colours_become_few_and_one_colour_none():
    """A rainbow of 200 keeps 64, each near to what it stands for; a grey body says nothing."""
    mesh, many = bar((2, 2, 40)), np.linspace((0, 255, 40), (255, 0, 40), 200).round().astype(int)
    look = look_of(painted(many), mesh)
    assert 8 <= len(look.colors) <= MOST
    shown = np.array([[int(c[i : i + 2], 16) for i in (1, 3, 5)] for c in look.colors])[look.index]
    wanted = np.array(many)[(mesh.centroids[:, 2] / 0.4 * 199).astype(int)]
    assert np.abs(shown - wanted).mean() < 25  # the surface has 8 rings of colour along z
    assert look_of(painted([RED]), mesh) is None


@pytest.mark.browser
def test_the_page_shows_them_beside_its_maps(chromium, folder):
    """Chosen, the picture is red below and blue above, whatever map was shown before."""
    seen = case("oak")
    page = content(replace(seen, look=look_of(painted([RED, BLUE]), seen.mesh)))
    visit = Visit(chromium, write_report(folder / "look.html", page))
    visit.page.get_by_label("As loaded").check()
    visit.page.set_viewport_size({"width": 390, "height": 844})
    uncut = (
        "[...document.querySelectorAll('fieldset')].every((n) => n.scrollWidth <= n.clientWidth)"
    )
    assert visit.page.evaluate(uncut)  # all seven colours on a phone
    visit.page.set_viewport_size({"width": 1280, "height": 900})
    visit.settled()
    picture = visit.picture().astype(int)
    assert "colours of the asset" in visit.page.locator("#scale").inner_text()
    red = picture[..., 0] - picture[..., 2]
    low, high = np.nonzero(red > 60)[0], np.nonzero(red < -60)[0]
    assert min(len(low), len(high)) > 500
    assert np.median(low) > np.median(high)  # rows of a picture grow downwards
    visit.close()


def test_a_page_without_colours_offers_none():
    """Where nobody said colours there is no choice of them."""
    assert '"look": null' in payload(content(case("oak")))
