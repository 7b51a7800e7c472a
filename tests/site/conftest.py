"""The built site, and a browser without network."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
SITE = ROOT / "site"


@pytest.fixture(scope="session")
def site() -> Path:
    """The folder of the site; `make docs` builds it."""
    if not (SITE / "index.html").is_file():
        pytest.skip("the site is not built: run 'make docs'")
    return SITE


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    webdriver = pytest.importorskip(
        "selenium.webdriver", reason="selenium is not installed: run 'make docs'"
    )
    program, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if not program or not driver:
        pytest.skip("chromium and chromedriver are not installed: run 'make docs'")
    options = webdriver.ChromeOptions()
    options.binary_location = program
    for option in (
        "headless=new",
        "no-sandbox",
        "disable-gpu",
        "disable-dev-shm-usage",
        "window-size=1400,900",
        "disable-background-networking",
        "disable-component-update",
        "no-first-run",
        "host-resolver-rules=MAP * ~NOTFOUND",
        "proxy-server=127.0.0.1:9",
    ):
        options.add_argument(f"--{option}")
    options.set_capability("goog:loggingPrefs", {"performance": "ALL", "browser": "ALL"})
    opened = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    try:
        yield opened
    finally:
        opened.quit()
