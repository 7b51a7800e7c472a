"""What every test shares: one random source, no user settings, no window unless one is named."""

import gc
import os
import shlex
import tempfile
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, settings

# Set before anything imports matplotlib or Blender: no window, and nobody's own Blender settings.
os.environ.setdefault("MPLBACKEND", "Agg")
# As `digiclay` itself: on several cores numpy's small products take three times the processor time.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# pytest makes errors of warnings in its own process; in those that tests start, numpy's are errors
# by this.
os.environ.setdefault("PYTHONWARNINGS", "error::RuntimeWarning")
SETTINGS = tempfile.TemporaryDirectory(prefix="digiclay-blender-")
if "PYTEST_XDIST_WORKER" in os.environ or "BLENDER_USER_RESOURCES" not in os.environ:
    os.environ["BLENDER_USER_RESOURCES"] = SETTINGS.name  # each worker its own: presets, extensions

# The same examples in every run, so that a failure can be seen again; no deadline, since machines
# are shared.
settings.register_profile(
    "repeatable",
    derandomize=True,
    database=None,
    deadline=None,
    max_examples=50,
    suppress_health_check=[HealthCheck.too_slow],
)
# Where it only counts that a test fails, as in make mutants: no failing example is made simpler.
settings.register_profile(
    "first_failure",
    settings.get_profile("repeatable"),
    phases=(Phase.explicit, Phase.generate),
    max_examples=20,
)
settings.register_profile("many", settings.get_profile("repeatable"), max_examples=5_000)
settings.load_profile(os.environ.get("DIGICLAY_HYPOTHESIS", "repeatable"))

WINDOW = Path(__file__).parent / "window"

# Thousands of tests are collected, none of which is garbage. They are not frozen: Blender's module,
# whose objects were never looked at again, would hang at the end of the process.
gc.disable()


def pytest_collection_finish():
    """Begin to collect garbage."""
    gc.enable()


def pytest_collection_modifyitems(items):
    """Skip the window's tests where no Blender with a window is named."""
    if os.environ.get("DIGICLAY_BLENDER_WINDOW"):
        return
    skip = pytest.mark.skip(reason="DIGICLAY_BLENDER_WINDOW does not name a Blender with a window")
    for item in items:
        if item.path.is_relative_to(WINDOW):
            item.add_marker(skip)


@pytest.fixture
def quick_machine(monkeypatch):
    """Leave out no control period: what a test forms must not depend on the machine's load."""
    from digiclay.core.session import live_session

    monkeypatch.setattr(live_session, "SHARE", 1e9)
    monkeypatch.setattr(live_session, "RELEASED_SHARE", 1e9)


@pytest.fixture
def here(request, tmp_path, monkeypatch):
    """Work in an empty folder with one scene, my.toml: the module's SCENE, or a tap on 3 x 4 pins."""
    from tests.scene_files import SCENE, folder_with

    # One process unless a test asks for more: each takes a second to start.
    monkeypatch.setattr("digiclay.commands.evaluation_pool.count_cores", lambda: 1)
    return folder_with(getattr(request.module, "SCENE", SCENE), tmp_path, monkeypatch)


@pytest.fixture
def refused(capsys):
    """Give a check that a command ends with exit code 2 and one line that has some words."""
    from digiclay.cli import main

    def check(line, said):
        arguments = shlex.split(line) if isinstance(line, str) else line
        code, (out, err) = main(arguments), capsys.readouterr()
        assert (code, out, err.count("\n"), said in err) == (2, "", 1, True), err

    return check


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Work in an empty folder, with a blank and an umlaut in its path."""
    folder = tmp_path / "schöne Tasten"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


@pytest.fixture
def no_methods():
    """Make methods that a test adds unknown again at its end."""
    from tests.own_methods import forgotten

    with forgotten():
        yield


@pytest.fixture(scope="module")
def tap():
    """Return the first 0.3 s of the sample *tap*."""
    import digiclay

    return digiclay.scene("tap", {"simulation.duration": 0.3})
