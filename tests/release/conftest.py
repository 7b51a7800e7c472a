"""What the tests of the release share: a copy of this checkout, a release made in it, its files."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from digiclay import __version__

from tests.other_process import carry_out
from tests.scene_files import read_text, write_text
from tests.timeouts import TIMEOUT

ROOT = Path(__file__).parents[2]
FOLDER = f"dist/digiclay-{__version__}"
TAG = f"v{__version__}"
CHANGELOG = "CHANGELOG.md"
VERSION_FILE = "addon/digiclay/core/version.py"
MANIFEST = "addon/digiclay/blender_manifest.toml"
#: Wheels fetched before; without a copy of them each release would fetch them again.
WHEELS = "build/wheels"
#: Git as nobody's settings have it.
ENVIRONMENT = {name: value for name, value in os.environ.items() if not name.startswith("GIT_")} | {
    "GIT_CONFIG_GLOBAL": os.devnull,
    "GIT_CONFIG_NOSYSTEM": "1",
}


def git(folder, *words):
    return carry_out("git", "-c", "safe.directory=*", *words, cwd=folder, env=ENVIRONMENT)


def commit(folder):
    git(folder, "add", "--all")
    git(folder, "commit", "-q", "--allow-empty", "-m", "tests: a copy")


def clone(source, folder):
    git(source, "clone", "-q", "--no-tags", str(source), str(folder))
    for name, value in {"user.name": "A Tester", "user.email": "tester@example.org"}.items():
        git(folder, "config", name, value)
    if (ROOT / WHEELS).is_dir():
        shutil.copytree(ROOT / WHEELS, folder / WHEELS)
    return folder


def copy_checkout(folder):
    clone(ROOT, folder)
    listed = git(ROOT, "ls-files", "-co", "--exclude-standard", "-z").split("\0")
    for name in filter(None, listed):
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, folder / name)
        else:
            (folder / name).unlink()
    commit(folder)
    return folder


def release_command(folder, version=__version__):
    return [sys.executable, str(folder / "tools" / "make_release.py"), version]


def run_release(folder, version=__version__, **added):
    return subprocess.run(
        release_command(folder, version),
        cwd=folder.parent,
        env=ENVIRONMENT | added,
        umask=0o022,
        capture_output=True,
        encoding="utf-8",
        timeout=TIMEOUT,
    )


def leftovers(folder):
    places = ("dist/*", "build/release-*", "build/lib", "addon/*.egg-info")
    found = [str(path.relative_to(folder)) for place in places for path in folder.glob(place)]
    return [*found, *git(folder, "tag").split(), *git(folder, "status", "--porcelain").splitlines()]


def edit(name, old, new):

    def change(folder):
        text = read_text(folder / name)
        assert old in text, f"{name} has no {old!r}"
        write_text(folder / name, text.replace(old, new, 1))
        commit(folder)

    return change


@pytest.fixture(scope="session")
def original(tmp_path_factory):
    return copy_checkout(tmp_path_factory.mktemp("original") / "checkout")


@pytest.fixture
def checkout(original, tmp_path):
    return clone(original, tmp_path / "checkout")


@pytest.fixture(scope="session")
def released(original, tmp_path_factory):
    folder = clone(original, tmp_path_factory.mktemp("release") / "released")
    done = run_release(folder)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="session")
def wheel(released):
    return released / FOLDER / f"digiclay-{__version__}-py3-none-any.whl"


@pytest.fixture(scope="session")
def extension_zip(released):
    return released / FOLDER / f"digiclay-{__version__}.zip"
