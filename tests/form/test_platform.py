"""Rules of Blender's extensions platform that the sources alone can break; docs/release.md lists them.

What only the built zip shows is in tests/release and tests/blender.
"""

import ast
import functools
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tests.scene_files import read_text

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "addon" / "digiclay"
MANIFEST: dict[str, Any] = tomllib.loads(read_text(PACKAGE / "blender_manifest.toml"))
LONGEST = 64
#: Licenses that the platform accepts for code and, CC0, for assets, of those that could ever fit.
LICENSES = {"GPL-3.0-or-later", "CC0-1.0", "MIT"}
#: What the platform's reviewers refuse: threads, beside which Blender crashes, and text that is
#: executed.
THREADS = {"threading", "_thread", "concurrent", "multiprocessing", "asyncio"}
EXECUTED = {"exec", "eval"}
#: What reaches other machines needs the permission `network`.
NETWORK = {
    "asyncio",
    "distributed",
    "ftplib",
    "http",
    "pythonosc",
    "requests",
    "socket",
    "socketserver",
} | {
    "ssl",
    "telnetlib",
    "urllib.request",
    "websockets",
    "xmlrpc",
}
#: What an extension must never do: install, update itself, write into its own folder, patch others.
FORBIDDEN = re.compile(
    r"\bpip\b.*\binstall\b.*subprocess|ensurepip|sys\.path\.(append|insert|extend)|sys\.path\[:0\]"
    r"|extension_sync|package_install|addon_utils\.|keyconfigs\.(default|user)\.keymaps\.(new|remove)"
)


def modules() -> Iterator[tuple[str, str]]:
    left_out = set(MANIFEST["build"]["paths_exclude_pattern"])
    for path in sorted(PACKAGE.rglob("*.py")):
        name = path.relative_to(PACKAGE).as_posix()
        if f"/{name}" not in left_out:
            yield name, read_text(path)


@functools.cache
def imported(text: str) -> frozenset[str]:
    """Return the modules, not those of ours, that a module imports anywhere in it, and their packages."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    # urllib.parse reads text, urllib.request reaches others.
    return frozenset(
        found | {name.split(".")[0] for name in found if not name.startswith("urllib")}
    )


def is_short(text: str) -> bool:
    return (
        0 < len(text) <= LONGEST
        and text == text.strip()
        and text[-1].isalnum()
        and text.isprintable()
    )


def test_what_the_zip_leaves_out_exists_and_no_module_of_it_imports_that_at_once() -> None:
    patterns = MANIFEST["build"]["paths_exclude_pattern"]
    left_out = [name for name in patterns if re.fullmatch(r"/[\w/]+\.py", name)]
    assert left_out
    assert [name for name in left_out if not (PACKAGE / name[1:]).is_file()] == []
    stems = "|".join(Path(name).stem for name in left_out)
    at_once = re.compile(rf"^(from|import) .*\b({stems})\b", re.MULTILINE)
    assert [name for name, text in modules() if at_once.search(text)] == []


def test_the_manifest_has_what_the_platform_takes_and_every_copyright_a_year_and_a_name() -> None:
    texts = [MANIFEST["tagline"], *MANIFEST["permissions"].values()]
    assert [text for text in texts if not is_short(text)] == []
    assert "Blender" not in MANIFEST["name"]
    # Whether the platform has the tags, Blender's own tool tells at each build.
    assert {"Sculpt", "Physics"} <= set(MANIFEST["tags"])
    assert MANIFEST["website"] == f"https://extensions.blender.org/add-ons/{MANIFEST['id']}/"
    lines = MANIFEST["copyright"]
    assert [line for line in lines if not re.fullmatch(r"\d{4}(-\d{4})? \S.*", line)] == []
    # The bundled wheel is of others: the platform asks that they are named.
    bundled = read_text(ROOT / "requirements" / "extension.txt")
    assert re.findall(r"^([\w-]+)==", bundled, re.MULTILINE) == ["trimesh"]
    assert any("Michael Dawson-Haggerty" in line for line in lines)


def test_every_license_has_its_text_and_manifest_package_and_samples_name_the_same() -> None:
    named = [license.removeprefix("SPDX:") for license in MANIFEST["license"]]
    assert named[0] == "GPL-3.0-or-later"
    assert set(named) <= LICENSES
    assert (
        "Creative Commons Legal Code\n\nCC0 1.0 Universal"
        in (ROOT / "LICENSES/CC0-1.0.txt").read_text()
    )
    assert (
        "GNU GENERAL PUBLIC LICENSE\n                       Version 3"
        in (ROOT / "LICENSE").read_text()
    )
    project = tomllib.loads(read_text(ROOT / "pyproject.toml"))["project"]
    # The wheel on a package index has no trimesh in it, the extension has.
    assert project["license"].split(" AND ") == [
        one.removeprefix("SPDX:") for one in MANIFEST["license"][:2]
    ]
    pages = [
        PACKAGE / "sample_shapes" / name / "README.md"
        for name in ("", "shapes", "sessions", "displays", "bodies")
    ]
    assert all("CC0-1.0" in read_text(page) for page in pages)
    assert not any("License:\nGPL" in read_text(page) for page in pages)


def find_refused(text: str) -> set[str]:
    """Return what reviewers refuse in a module: libraries of threads, and text that is executed."""
    names = {node.id for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Name)}
    return imported(text) & THREADS | names & EXECUTED


REFUSED = (
    "def f():\n    from threading import Lock",
    "import multiprocessing.pool",
    "exec('1')",
    "run = eval",
)


def test_the_zip_has_no_threads_executes_no_text_and_installs_or_patches_nothing() -> None:
    assert [text for text in REFUSED if not find_refused(text)] == []
    assert find_refused("import subprocess\nmodule.exec_module(it)\nbed.eval(3)") == set()
    assert {path: found for path, text in modules() if (found := find_refused(text))} == {}
    found = [
        (path, match.group()) for path, text in modules() for match in FORBIDDEN.finditer(text)
    ]
    assert found == []


def test_the_permissions_are_those_that_are_used_and_online_access_is_asked_for() -> None:
    texts = dict(modules())
    used = {"files"}  # runs, meshes and pictures are written wherever the user names a folder
    if any(imported(text) & NETWORK for text in texts.values()):
        used.add("network")
        assert any("online_access" in text for text in texts.values())
    if any("window_manager.clipboard" in text for text in texts.values()):
        used.add("clipboard")
    assert set(MANIFEST["permissions"]) == used
