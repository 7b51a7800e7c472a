"""The pages: headings, words, links, commands and the figures' sources."""

from __future__ import annotations

import ast
import functools
import re
import shlex
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
from digiclay.commands.parser import parser

from benchmarks.kinds import parser as benchmarks_parser

ROOT = Path(__file__).parents[2]
PAGES = sorted(
    [
        *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "benchmarks/README.md")),
        *ROOT.glob("docs/*.md"),
        *ROOT.glob("addon/digiclay/sample_shapes/*/README.md"),
    ]
)
PACKAGES = ("addon", "benchmarks", "digiclay_paper", "digiclay_serve", "digiclay_study", "tools")
SOURCES = (*PACKAGES, "tests")
#: Words that make a heading a sentence or a question.
SENTENCE = re.compile(
    r"^(what|how|why|where|when|who|which|whether)\b"
    r"|\b(is|are|was|were|has|have|does|do|can|must|costs|brings|comes|goes|stays|knows|says|tells|ends|stands"
    r"|changes|found|moved|moves|recovers|springs)\b",
    re.IGNORECASE,
)
#: A speed or a run time: a row of a table, not a sentence.
TIMING = re.compile(r"\d x real time|\d (?:s|ms|min|minutes) of (?:CPU|processor) time", re.IGNORECASE)
#: A program and its arguments; a number behind a name is a version.
COMMAND = re.compile(r"^\$? *(?:blender --command )?(digiclay|python -m benchmarks) (?!\d)(.*)")


#: Files of the user: a method of one's own, and its copy beside a run.
USERS = ("mine.py", "method.py", "softer.py", "yielding.py")
#: The parsers that the commands of the pages must pass; they only read, nothing is carried out.
PARSERS = {"digiclay": parser, "python -m benchmarks": benchmarks_parser}


def _lines(page: Path) -> Iterator[tuple[int, str, bool]]:
    """Yield number, text and whether it is code, line by line."""
    fenced = False
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
        fence = line.lstrip().startswith("```")
        fenced ^= fence
        yield number, line, fenced or fence or line.startswith("    ")


def _prose(page: Path) -> Iterator[tuple[int, str]]:
    """Yield the lines of English: no code, no quotation in italics."""
    for number, line, code in _lines(page):
        if not code:
            yield number, re.sub(r"`[^`]*`|\*[^*]+\*|\]\([^)]*\)", " ", line.replace("**", ""))


def _headings(page: Path) -> list[str]:
    return [line.lstrip("# ") for _, line, code in _lines(page) if not code and line.startswith("#")]


def _anchors(page: Path) -> set[str]:
    """Return the anchors of a page's headings, as the usual renderers make them."""
    plain = [re.sub(r"[^\w\- ]", "", heading.lower()) for heading in _headings(page)]
    return {heading.replace(" ", "-") for heading in plain}


def _commands(page: Path) -> list[tuple[str, str]]:
    """Return program and arguments of every command of a page, in blocks of code and within sentences."""
    lines = list(_lines(page))
    blocks = [line.strip() for _, line, code in lines if code]
    text = " ".join(line for _, line, code in lines if not code)
    found = [COMMAND.match(line) for line in (*blocks, *re.findall(r"`([^`]+)`", text))]
    # Two blanks or a # begin the remark beside a command.
    return [(match[1], re.split(r"\s{2,}|\s#", match[2])[0]) for match in found if match]


def is_refused(program: str, arguments: str) -> bool:
    words = shlex.split(arguments)
    try:
        PARSERS[program]().parse_args(words if len(words) > 1 else [*words, "--help"])
    except SystemExit as end:
        return end.code != 0
    return False


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_heading_is_a_noun_phrase(page: Path) -> None:
    assert [heading for heading in _headings(page) if "?" in heading or SENTENCE.search(heading)] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_run_time_stands_in_a_table(page: Path) -> None:
    assert [(n, line) for n, line in _prose(page) if not line.startswith("|") and TIMING.search(line)] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_measurement_names_its_date_and_commit(page: Path) -> None:
    """A table with the column *commit* has a date and a commit in every row."""
    rows: list[str] = []
    measured = False
    for _, line, code in _lines(page):
        if code or not line.startswith("|"):
            measured = False
        elif re.search(r"\|\s*commit\s*\|", line, re.IGNORECASE):
            measured = True
        elif measured and not re.fullmatch(r"[|\s:-]+", line):
            rows.append(line)
    assert [r for r in rows if not re.search(r"\b20\d\d-\d\d-\d\d\b.*\b[0-9a-f]{7}\b", r)] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_leads_to_a_file_and_a_heading(page: Path) -> None:
    broken = []
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        # `make docs` makes the pages below reference/ and checks the links to them.
        if "://" in target or target.startswith("reference/"):
            continue
        name, _, anchor = target.partition("#")
        file = page.parent / name if name else page
        if not file.exists() or (anchor and anchor not in _anchors(file)):
            broken.append(target)
    assert broken == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_module_a_page_names_exists(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    own = re.findall(r'title="([^"]+)"', text)
    named = [name for name in re.findall(r"(?<![\w./])((?:\w+/)*\w+\.py)\b", text) if name not in own]
    known = [
        f"/{path.relative_to(ROOT).as_posix()}"
        for folder in SOURCES
        for path in (ROOT / folder).rglob("*.py")
    ]
    named = [name for name in named if Path(name).name not in USERS]
    assert [name for name in named if not any(path.endswith(f"/{name}") for path in known)] == []


@functools.cache
def _definitions() -> dict[str, set[str]]:
    """Return the names that each module defines, by the module's own name; those of equal names together."""
    defined: dict[str, set[str]] = {}
    for path in (path for folder in PACKAGES for path in (ROOT / folder).rglob("*.py")):
        names = defined.setdefault(path.stem, set())
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                names.add(node.name)
            elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                names.add(node.id)
    return defined


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_name_of_a_module_that_a_page_gives_exists(page: Path) -> None:
    parameters = (ROOT / "docs" / "nomenclature.md").read_text(encoding="utf-8")
    endings = {"py", "md", "csv", "png", "jpg", "toml", "json", "npz", "stl", "obj", "html"}
    named = re.findall(r"`(?!bpy)(?:[\w.]+\.)?([a-z_]+)\.([A-Za-z]\w*)", page.read_text(encoding="utf-8"))
    wrong = [
        f"{module}.{name}"
        for module, name in named
        if module in _definitions() and name not in endings and f"`{module}.{name}`" not in parameters
        if name not in _definitions()[module] and name not in _definitions()
    ]
    assert wrong == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_command_is_one_that_its_program_takes(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert [command for command in _commands(page) if is_refused(*command)] == [], capsys.readouterr().err


def test_the_pages_have_commands_to_check() -> None:
    assert sum(len(_commands(page)) for page in PAGES) > 25


def test_the_page_of_the_package_lists_every_extra_that_is_for_its_users() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    page = (ROOT / project["readme"]).read_text(encoding="utf-8")
    assert sorted(re.findall(r"^\| `digiclay\[(\w+)\]` \|", page, re.MULTILINE)) == sorted(
        project["optional-dependencies"].keys() - {"dev"}
    )
