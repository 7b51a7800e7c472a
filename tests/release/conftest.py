"""What the tests of the release share: a copy of this checkout, a release made in it, its wheel."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from digiclay import __version__

from tests.release.copied_checkout import FOLDER, clone, copy_checkout, run_release


@pytest.fixture(scope="session")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of this checkout with everything committed; never changed."""
    return copy_checkout(tmp_path_factory.mktemp("original") / "checkout")


@pytest.fixture
def checkout(original: Path, tmp_path: Path) -> Path:
    """A clone of the copy, for one test to change."""
    return clone(original, tmp_path / "checkout")


@pytest.fixture(scope="session")
def release(original: Path, tmp_path_factory: pytest.TempPathFactory) -> subprocess.CompletedProcess[str]:
    """The release command, carried out in a clone; `released` has its checkout."""
    return run_release(clone(original, tmp_path_factory.getbasetemp() / "released"))


@pytest.fixture(scope="session")
def released(release: subprocess.CompletedProcess[str], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The checkout of a release."""
    assert release.returncode == 0, release.stderr
    return tmp_path_factory.getbasetemp() / "released"


@pytest.fixture(scope="session")
def wheel(released: Path) -> Path:
    """The wheel of the release."""
    return released / FOLDER / f"digiclay-{__version__}-py3-none-any.whl"


@pytest.fixture(scope="session")
def extension_zip(released: Path) -> Path:
    """The extension's zip of the release."""
    return released / FOLDER / f"digiclay-{__version__}.zip"
