"""The site in a browser, opened from its folder with the network cut."""

import json
from pathlib import Path
from typing import Any

import pytest

from tests.scene_files import write_text

#: Longest time in which a page gets ready on a busy machine, s; a test ends as soon as it is.
PATIENCE = 120.0
#: A page of the first level, and one two levels deep.
PAGES = ("index.html", "reference/python/digiclay.core.engine.html")


def open_page(browser: Any, page: Path) -> None:
    browser.get("about:blank")
    browser.get_log("performance")
    browser.get_log("browser")
    browser.get(page.as_uri())


def requested(browser: Any) -> list[str]:
    events = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    sent = [event["params"] for event in events if event["method"] == "Network.requestWillBeSent"]
    return [one["request"]["url"] for one in sent]


def search(browser: Any, word: str, place: str) -> list[str]:
    from selenium.webdriver.support.ui import WebDriverWait

    field = browser.find_element("css selector", "input.md-search__input")
    field.click()
    field.send_keys(word)

    def found(one: Any) -> list[str]:
        """Return the links of the results, none before the place is among them: each key gives results."""
        every = "return [...document.querySelectorAll('a.md-search-result__link')].map(link => link.href)"
        links: list[str] = one.execute_script(every)
        return links if any(place in link for link in links) else []

    links: list[str] = WebDriverWait(browser, PATIENCE).until(
        found, f"no result of {word} at {place}"
    )
    return links


@pytest.mark.parametrize("page", PAGES)
def test_a_typed_word_is_found_in_a_page_opened_from_its_file(
    site: Path, browser: Any, page: str
) -> None:
    open_page(browser, site / page)
    # A name that one page has: the order of the results changes with the pages.
    links = search(browser, "Jindrich", "/nomenclature.html")
    assert {link.split(":")[0] for link in links} == {"file"}
    wrong = [
        one
        for one in requested(browser)
        if not one.startswith(("file:", "data:", "blob:", "about:"))
    ]
    assert wrong == []
    assert [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"] == []


def test_a_result_leads_to_the_parameter_that_was_searched(site: Path, browser: Any) -> None:
    open_page(browser, site / "index.html")
    links = search(
        browser, "control.force_gain", "h=control+force_gain#control-with-method--virtual_master"
    )
    assert "/reference/parameters.html" in links[0]


def test_the_check_notices_a_request_to_another_machine(browser: Any, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    write_text(page, '<script src="https://machine.example/a.js"></script>')
    open_page(browser, page)
    assert "https://machine.example/a.js" in requested(browser)
    assert [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"] != []


@pytest.mark.parametrize("width", [390, 1400])
@pytest.mark.parametrize(
    "page",
    ["index.html", "guide.html", "reference/commands.html", "reference/samples.html", "paper.html"],
)
def test_no_page_is_wider_than_the_window(site: Path, browser: Any, page: str, width: int) -> None:
    size = {"width": width, "height": 800, "deviceScaleFactor": 1, "mobile": width < 700}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        open_page(browser, site / page)
        assert browser.execute_script("return document.documentElement.scrollWidth") <= width
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
