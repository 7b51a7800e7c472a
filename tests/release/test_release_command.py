"""The release command: what it leaves, what it refuses, and that a failure leaves nothing."""

import os
import signal
import subprocess
from importlib import import_module

import pytest
from digiclay import __version__

from tests.release.conftest import (
    CHANGELOG,
    ENVIRONMENT,
    FOLDER,
    MANIFEST,
    TAG,
    VERSION_FILE,
    commit,
    edit,
    git,
    leftovers,
    release_command,
    run_release,
)
from tests.scene_files import read_text, write_text
from tests.timeouts import TIMEOUT

ARCHIVES = [f"digiclay-{__version__}{end}" for end in ("-py3-none-any.whl", ".tar.gz", ".zip")]


def tag(name):
    return lambda folder: print(git(folder, "tag", name))


def write(name, text):

    def change(folder):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        write_text(folder / name, text)

    return change


def remove(name):

    def change(folder):
        (folder / name).unlink()
        commit(folder)

    return change


def empty_the_section(folder):
    text = read_text(folder / CHANGELOG)
    heading = next(line for line in text.splitlines() if line.startswith("## "))
    (folder / CHANGELOG).write_text(
        f"# Changelog\n\n{heading}\n\n## 0.0.1 - 2026-01-01\n\n- First.\n"
    )
    commit(folder)


def have_no_name(folder):
    git(folder, "config", "--unset", "user.email")
    git(folder, "config", "user.useConfigOnly", "true")


HEADING = f"## {__version__} - "
REPORT = ".reports/window.txt"
FAILED = "tests in a window: FAILED (status 1)\n"
BROKEN = {
    "a change that is not committed": (
        write("README.md", "Changed."),
        "README.md is not committed",
    ),
    "a file that git does not know": (
        write("addon/digiclay/new.py", ""),
        "addon/digiclay/new.py is not",
    ),
    "another version of the package": (
        edit(VERSION_FILE, __version__, "9.9.9"),
        f"{VERSION_FILE} has version 9.9.9, and",
    ),
    "another version of the extension": (
        edit(MANIFEST, f'\nversion = "{__version__}"', '\nversion = "9.9.9"'),
        f"{MANIFEST} has version 9.9.9",
    ),
    "another version in the changelog": (
        edit(CHANGELOG, HEADING, "## 9.9.9 - "),
        "CHANGELOG.md has version 9",
    ),
    "no day in the changelog": (edit(CHANGELOG, HEADING, f"## {__version__} "), "must be '## "),
    "no such day": (edit(CHANGELOG, HEADING + "20", HEADING + "2026-02-31\n\n20"), "must be '## "),
    "a day to come": (edit(CHANGELOG, HEADING + "20", HEADING + "9999-12-31\n\n20"), "9999-12-31"),
    "no notes": (empty_the_section, "is empty"),
    "no changelog": (remove(CHANGELOG), f"{CHANGELOG} is missing"),
    "another website": (edit(MANIFEST, "add-ons/digiclay/", "add-ons/clay/"), "website must be"),
    "a later release": (tag("v99.0.0"), f"{__version__} is below 99.0.0"),
    "a folder that is there": (write(f"{FOLDER}/mine.txt", "mine"), "exists without the tag"),
    "a failed test": (write(REPORT, FAILED), f"{REPORT} has a failure"),
    "nobody's name for the tag": (have_no_name, "user.name"),
}


def assert_refused(done, reason):
    """Assert that a release is refused in one line with a reason."""
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith("Nothing is released: ")
    assert (done.stderr.count("\n"), reason in done.stderr) == (1, True), done.stderr


@pytest.mark.parametrize("broken", BROKEN)
def test_a_broken_condition_is_one_line_and_nothing_is_left(broken, checkout):
    change, reason = BROKEN[broken]
    change(checkout)
    before = leftovers(checkout)
    assert_refused(run_release(checkout), reason)
    assert leftovers(checkout) == before


@pytest.mark.parametrize(
    "version", ["", "0.1", "v0.1.0", "0.1.0rc1", "01.0.0", "0.1.0 ", "nan", "٠.١.٠"]
)
def test_a_version_is_three_numbers(version, original):
    assert_refused(run_release(original, version), "such as 0.1.0")
    assert leftovers(original) == []


def test_several_broken_conditions_are_a_line_each(checkout):
    write("README.md", "Changed.")(checkout)
    done = run_release(checkout, "9.9.9")
    lines = done.stderr.splitlines()
    assert len(lines) == 4
    assert all(line.startswith("Nothing is released: ") for line in lines)


def test_reports_of_other_commits_do_not_count(checkout, monkeypatch):
    monkeypatch.syspath_prepend(str(checkout / "tools"))
    find_obstacles = import_module("release_rules").find_obstacles
    report = checkout / REPORT
    write(REPORT, FAILED)(checkout)
    assert len(find_obstacles(checkout, __version__, checkout / FOLDER)) == 1
    os.utime(report, (1e9, 1e9))
    assert find_obstacles(checkout, __version__, checkout / FOLDER) == []


def put_chance_into_the_zip(folder):
    line = '    shutil.copyfile(ROOT / "LICENSE", folder / "LICENSE")\n'
    edit(
        "tools/extension.py", line, f'{line}    (folder / "chance.md").write_bytes(os.urandom(9))\n'
    )(folder)


def make_the_zip_large(folder):
    (folder / "addon/digiclay/sample_shapes/shapes/large.png").write_bytes(os.urandom(1_200_000))
    commit(folder)


FAILING = {
    "a zip that Blender refuses": (edit(MANIFEST, '"Modeling"', '"Pottery"'), "extension.py --out"),
    "a wheel that is not built": (
        edit("pyproject.toml", "[build-system]", "[build-system"),
        "'-m build",
    ),
    "builds that differ": (
        put_chance_into_the_zip,
        f"two builds of the same commit differ in {ARCHIVES[2]}",
    ),
    "a large zip": (make_the_zip_large, "2 MB is the most"),
}


@pytest.mark.parametrize("failing", FAILING)
def test_a_failure_during_the_builds_leaves_nothing(failing, checkout):
    change, reason = FAILING[failing]
    change(checkout)
    done = run_release(checkout)
    last = done.stderr.splitlines()[-1]
    assert (done.returncode, last.startswith("Nothing is released: ")) == (1, True), done.stderr
    assert reason in last
    assert leftovers(checkout) == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_stop_during_the_builds_leaves_nothing(number, checkout):
    process = subprocess.Popen(
        release_command(checkout),
        env=ENVIRONMENT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        encoding="utf-8",
    )
    assert process.stdout.readline().startswith(f"building {__version__}")
    process.send_signal(number)
    _, told = process.communicate(timeout=TIMEOUT)
    assert (process.returncode, told) == (
        1,
        f"Nothing is released: stopped by {signal.Signals(number).name}.\n",
    )
    assert leftovers(checkout) == []


def test_a_release_leaves_its_files_their_checksums_and_an_annotated_tag_with_the_notes(released):
    assert sorted(path.name for path in (released / FOLDER).iterdir()) == sorted(
        [*ARCHIVES, "SHA256SUMS", "release-notes.md"]
    )
    assert git(released, "tag").split() == [TAG]
    assert git(released, "rev-parse", f"{TAG}^{{commit}}") == git(released, "rev-parse", "HEAD")
    notes = read_text(released / FOLDER / "release-notes.md")
    assert (
        git(released, "for-each-ref", "--format=%(contents)", f"refs/tags/{TAG}").strip()
        == notes.strip()
    )
    assert list(released.glob("build/release-*")) == []
    check = ["sha256sum", "--check", "--strict", "SHA256SUMS"]
    done = subprocess.run(
        check, cwd=released / FOLDER, capture_output=True, encoding="utf-8", timeout=TIMEOUT
    )
    assert (done.returncode, done.stdout.count(": OK")) == (0, len(ARCHIVES) + 1), done.stdout


def test_the_notes_are_the_newest_section_without_links_to_pages(released):
    section = read_text(released / CHANGELOG).split("\n## ")[1]
    notes = read_text(released / FOLDER / "release-notes.md")
    assert notes.startswith(f"# digiclay {__version__}\n\n")
    items = [line for line in section.splitlines() if line.startswith("- ") and "](" not in line]
    assert len(items) > 5
    assert [line for line in items if line not in notes] == []
    assert "](docs/" not in notes


def test_a_second_release_is_refused_and_leaves_the_first_as_it_is(released):
    before = {path: path.stat().st_mtime_ns for path in (released / FOLDER).iterdir()}
    reason = f"{__version__} is released already, as tag {TAG} of commit"
    assert_refused(run_release(released), reason)
    assert {path: path.stat().st_mtime_ns for path in (released / FOLDER).iterdir()} == before
