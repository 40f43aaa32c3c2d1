"""The documentation, opened from a folder without a server or a network."""

import pytest

from .browser import Visit


@pytest.mark.browser
def test_the_search_works_from_a_file(site, chromium):
    """Typed into the box: pages are found, marked and led to, and nothing is asked of elsewhere."""
    visit = Visit(chromium, site / "tutorial.html", ready=".md-search__input")
    page = visit.page
    page.keyboard.press("f")
    page.keyboard.type("buckling")
    page.wait_for_selector(".md-search-result__link")
    links = page.locator(".md-search-result__link").evaluate_all("them => them.map(a => a.href)")
    assert any("solver.html" in link for link in links)
    page.locator(".md-search-result__link").first.click()
    page.wait_for_selector("h1 >> text=Solver")
    assert not visit.errors
    assert all(one.startswith(("file:", "data:", "about:")) for one in visit.requests)
