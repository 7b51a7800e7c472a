"""Conditions of a release: version, changelog, website, tree, tag, folder, reports of the tests.

Each function returns what stands in the way, one line each, and changes nothing.
"""

import datetime
import re
import subprocess
import tomllib
from pathlib import Path
from typing import Any

VERSION_FILE = "addon/digiclay/core/version.py"
MANIFEST = "addon/digiclay/blender_manifest.toml"
CHANGELOG = "CHANGELOG.md"
REPORTS = ".reports"
VERSION = re.compile(r"(0|[1-9]\d*)\.(0|[1-9]\d*)\.(0|[1-9]\d*)")
HEADING = re.compile(r"^## (.*)$", re.MULTILINE)
#: A link to a page of the repository, which has no meaning elsewhere.
LINK = re.compile(r"\[([^\]]+)\]\((?![a-z]+://)[^)]+\)")
LIMIT = 60


def git(root: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run git in a checkout, also in that of another user; the caller reads the status."""
    command = ["git", "-c", "safe.directory=*", *words]
    # In a session of its own: Ctrl-C is for the release, which ends in order.
    return subprocess.run(
        command, cwd=root, capture_output=True, text=True, timeout=LIMIT, start_new_session=True
    )


def tag_of(version: str) -> str:
    """Return the name of a version's tag."""
    return f"v{version}"


def read_versions(root: Path) -> dict[str, str]:
    """Return the version in each file that has one, empty where there is none."""
    version = re.search(
        r'^__version__ = "([^"]*)"$',
        (root / VERSION_FILE).read_text(encoding="utf-8"),
        re.MULTILINE,
    )
    return {
        VERSION_FILE: version[1] if version else "",
        MANIFEST: str(read_manifest(root).get("version", "")),
        CHANGELOG: read_section(root)[0].split(" ")[0],
    }


def read_manifest(root: Path) -> dict[str, Any]:
    """Return the manifest of the extension."""
    return tomllib.loads((root / MANIFEST).read_text(encoding="utf-8"))


def read_section(root: Path) -> tuple[str, str]:
    """Return heading and text of the newest section of the changelog, both empty without one."""
    _, *sections = HEADING.split((root / CHANGELOG).read_text(encoding="utf-8"))
    return (sections[0], sections[1]) if sections else ("", "")


def read_notes(root: Path) -> str:
    """Return the newest section of the changelog without its heading, links to pages as their text alone."""
    return LINK.sub(r"\1", read_section(root)[1]).strip()


def _find_in_files(root: Path, version: str) -> list[str]:
    """Return what is wrong with the files of the checkout."""
    wrong = [
        f"{path} has version {found or 'none'}, and {version} is to be released."
        for path, found in read_versions(root).items()
        if found != version
    ]
    day = re.fullmatch(r"\S+ - (\d{4}-\d\d-\d\d)", read_section(root)[0])
    try:
        dated = datetime.date.fromisoformat(day[1]) if day else None
    except ValueError:
        dated = None
    if dated is None:
        wrong.append(f"{CHANGELOG}: its newest heading must be '## {version} - YYYY-MM-DD'.")
    elif dated > datetime.datetime.now(datetime.UTC).date():
        wrong.append(f"{CHANGELOG}: {dated} in the heading of {version} is in the future.")
    if not read_notes(root):
        wrong.append(
            f"{CHANGELOG}: the section of {version} is empty, and the notes are taken from it."
        )
    manifest = read_manifest(root)
    page = f"https://extensions.blender.org/add-ons/{manifest.get('id')}/"
    if manifest.get("website") != page:
        wrong.append(f"{MANIFEST}: website must be {page}, the page of this id.")
    return wrong


def _find_in_history(root: Path, version: str) -> list[str]:
    """Return what is wrong with the tree and the tags."""
    wrong = []
    changed = git(root, "status", "--porcelain").stdout.splitlines()
    if changed:
        others = f", and {len(changed) - 1} more" if len(changed) > 1 else ""
        wrong.append(f"{changed[0][3:]} is not committed{others}.")
    tags = git(root, "tag", "--list", "v*").stdout.split()
    released = [tuple(map(int, tag[1:].split("."))) for tag in tags if VERSION.fullmatch(tag[1:])]
    if tag_of(version) in tags:
        commit = git(root, "rev-parse", "--short", f"{tag_of(version)}^{{commit}}").stdout.strip()
        wrong.append(f"{version} is released already, as tag {tag_of(version)} of commit {commit}.")
    elif released and max(released) > tuple(map(int, version.split("."))):
        wrong.append(
            f"{version} is below {'.'.join(map(str, max(released)))}, which is released already."
        )
    if git(root, "var", "GIT_COMMITTER_IDENT").returncode:
        wrong.append("git has no user.name and user.email, which a tag needs.")
    return wrong


def _find_in_reports(root: Path) -> list[str]:
    """Return the tests that failed since the commit was made; older reports are of other commits."""
    committed = float(git(root, "log", "-1", "--format=%ct").stdout or 0)
    recent = [
        path for path in sorted((root / REPORTS).glob("*.txt")) if path.stat().st_mtime >= committed
    ]
    return [
        f"{path.relative_to(root)} has a failure: {line.strip()}"
        for path in recent
        for line in path.read_text(encoding="utf-8", errors="replace").splitlines()
        if "FAILED" in line
    ]


def find_obstacles(root: Path, version: str, folder: Path) -> list[str]:
    """Return the obstacles to a release, one line each; `folder`: where the files are to be."""
    if not VERSION.fullmatch(version):
        return [f"the version must be three numbers such as 0.1.0 (got {version!r})."]
    if git(root, "rev-parse", "--verify", "HEAD").returncode:
        return [f"{root} is no git repository with a commit."]
    missing = [path for path in (VERSION_FILE, MANIFEST, CHANGELOG) if not (root / path).is_file()]
    if missing:
        return [f"{path} is missing." for path in missing]
    wrong = _find_in_history(root, version)
    # An exact second time has one reason, not two.
    if folder.exists() and not any("released already" in line for line in wrong):
        wrong.append(f"{folder} exists without the tag {tag_of(version)}: remove it.")
    return [*wrong, *_find_in_files(root, version), *_find_in_reports(root)]
