"""The pages: measurements, links, names, commands and navigation."""

import ast
import functools
import re
import shlex
import tomllib
from collections.abc import Callable, Iterable, Iterator
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import pytest
import yaml
from digiclay.commands.parser import parser
from digiclay.core.base.quantity import Quantity, list_quantities
from digiclay.core.control.methods import METHODS
from digiclay.core.mesh_io.mesh_reader import READERS
from digiclay.core.mesh_io.mesh_writer import FORMATS
from digiclay.core.scene.scene_source import list_samples
from digiclay.core.scene.schema import SECTIONS, import_parameters
from digiclay.core.studies.evaluation import FIGURES

from benchmarks.kinds import parser as benchmarks_parser
from tests.scene_files import read_text

ROOT = Path(__file__).parents[2]
PAGES = sorted(
    [
        *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "benchmarks/README.md")),
        *ROOT.glob("docs/**/*.md"),
        *ROOT.glob("addon/digiclay/sample_shapes/*/README.md"),
    ]
)
PACKAGES = ("addon", "benchmarks", "tools", *(path.name for path in ROOT.glob("digiclay_*")))
SOURCES = {
    f"/{path.relative_to(ROOT)}"
    for name in (*PACKAGES, "docs", "tests")
    for path in (ROOT / name).rglob("*.py")
}
#: A program and its arguments; a number behind a name is a version.
COMMAND = re.compile(r"^\$? *(?:blender --command )?(digiclay|python -m benchmarks) (?!\d)(.*)")
#: End of a line of a command that goes on in the next.
CONTINUED = re.compile(r" *\\\n\s*")
#: Files of the user: a method of one's own, and its copy beside a run.
USERS = ("mine.py", "method.py", "softer.py", "yielding.py")
#: The parsers that the commands of the pages must pass; they only read, nothing is carried out.
PARSERS = {"digiclay": parser, "python -m benchmarks": benchmarks_parser}
#: Row of the table of pictures, and a picture that a page shows.
ROW = re.compile(r"^\| (`[\w.*/]+\.(?:jpg|png|svg|webp)`.*?) \| (.*) \|$", re.MULTILINE)
SHOWN = re.compile(r"!\[[^\]]*\]\(([^)\s]+)\)")
#: Pages of the navigation that `tools/site_pages.py` makes at the build.
MADE = {"benchmarks.md", "changes.md", "contributing.md"}


def list_lines(text: str) -> Iterator[tuple[str, bool]]:
    fenced = False
    for line in text.splitlines():
        fence = line.lstrip().startswith("```")
        fenced ^= fence
        yield line, fenced or fence or line.startswith("    ")


def _headings(text: str) -> list[str]:
    return [
        line.lstrip("# ") for line, code in list_lines(text) if not code and line.startswith("#")
    ]


def _anchors(text: str) -> set[str]:
    return {
        re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in _headings(text)
    }


def find_commands(text: str) -> list[tuple[str, str]]:
    """Return program and arguments of every command of a page, in blocks of code and within sentences."""
    lines = list(list_lines(CONTINUED.sub(" ", text)))
    blocks = [line.strip() for line, code in lines if code]
    prose = " ".join(line for line, code in lines if not code)
    matches = [COMMAND.match(line) for line in (*blocks, *re.findall(r"`([^`]+)`", prose))]
    # Two blanks or a # begin the remark beside a command.
    return [(match[1], re.split(r"\s{2,}|\s#", match[2])[0]) for match in matches if match]


def is_refused(program: str, arguments: str) -> bool:
    words = shlex.split(arguments)
    try:
        PARSERS[program]().parse_args(words if len(words) > 1 else [*words, "--help"])
    except SystemExit as end:
        return end.code != 0
    return False


@functools.cache
def _definitions() -> dict[str, set[str]]:
    defined: dict[str, set[str]] = {}
    for path in (path for folder in PACKAGES for path in (ROOT / folder).rglob("*.py")):
        names = defined.setdefault(path.stem, set())
        for node in ast.walk(ast.parse(read_text(path))):
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                names.add(node.name)
            elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                names.add(node.id)
    return defined


@functools.cache
def _parameters() -> list[tuple[str, str, Quantity]]:
    return [
        (section, name, quantity)
        for section in (*SECTIONS, "body")
        for method in METHODS
        for name, quantity in list_quantities(import_parameters(section, method)).items()
    ]


def find_undated(page: Path, text: str) -> list[str]:
    rows, measured = [], False
    for line, code in list_lines(text):
        if code or not line.startswith("|"):
            measured = False
        elif re.search(r"\|\s*commit\s*\|", line, re.IGNORECASE):
            measured = True
        elif measured and not re.fullmatch(r"[|\s:-]+", line):
            rows.append(line)
    return [row for row in rows if not re.search(r"\b20\d\d-\d\d-\d\d\b.*\b[0-9a-f]{7}\b", row)]


def find_dead_links(page: Path, text: str) -> list[str]:
    """Return the links to a file or heading that does not exist; `make docs` checks those to reference/."""
    dead = []
    for target in re.findall(r"\]\((?!\w+://|(?:\.\./)?reference/)([^)\s]+)\)", text):
        name, _, anchor = target.partition("#")
        file = page.parent / name if name else page
        if not file.exists() or (anchor and anchor not in _anchors(read_text(file))):
            dead.append(target)
    return dead


def find_absent_modules(page: Path, text: str) -> list[str]:
    given = {*USERS, *re.findall(r'title="([^"]+)"', text)}
    named = re.findall(r"(?<![\w./])((?:\w+/)*\w+\.py)\b", text)
    return [
        name
        for name in named
        if name not in given and Path(name).name not in given
        if not any(path.endswith(f"/{name}") for path in SOURCES)
    ]


def find_absent_names(page: Path, text: str) -> list[str]:
    """Return ``module.name`` where a page names what the module does not define."""
    endings = {"py", "md", "csv", "png", "jpg", "svg", "toml", "json", "npz", "stl", "obj", "html"}
    parameters = {(section, name) for section, name, _ in _parameters()}
    return [
        f"{module}.{name}"
        for module, name in re.findall(r"`(?!bpy)(?:[\w.]+\.)?([a-z_]+)\.([A-Za-z]\w*)", text)
        if module in _definitions() and name not in endings and (module, name) not in parameters
        if name not in _definitions()[module] and name not in _definitions()
    ]


def find_refused_commands(page: Path, text: str) -> list[str]:
    return [" ".join(command) for command in find_commands(text) if is_refused(*command)]


CHECKS = (
    find_undated,
    find_dead_links,
    find_absent_modules,
    find_absent_names,
    find_refused_commands,
)
#: A page with one fault of each kind, in the order of the checks.
WRONG = """\
# A page
[there](nowhere.md), `core/absent.py`, `simulation.absent_name`, `digiclay run --absent tap`

| commit | s |
|---|---|
| today | 3 |
"""


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_no_page_has_a_fault_that_the_check_finds(check: Callable[[Path, str], list[str]]) -> None:
    faults = {page.name: check(page, read_text(page)) for page in PAGES}
    assert {name: found for name, found in faults.items() if found} == {}
    assert len(check(ROOT / "README.md", WRONG)) == 1


def test_all_fourteen_equations_have_a_row_and_places_that_exist() -> None:
    text = read_text(ROOT / "docs" / "equations.md")
    assert {int(n) for n in re.findall(r"^\| (\d+)", text, re.MULTILINE)} == set(range(1, 15))
    named = re.findall(r"`core/([\w/]+)\.py: ([\w.]+)`", text)
    assert len(named) > 12
    absent = []
    for module, name in named:
        code = read_text(ROOT / "addon" / "digiclay" / "core" / f"{module}.py")
        patterns = (rf"\b(def|class) {part}\b|^ *{part}\b *[:=]" for part in name.split("."))
        if not all(re.search(pattern, code, re.MULTILINE) for pattern in patterns):
            absent.append(f"{module}: {name}")
    assert absent == []


def test_every_parameter_says_where_it_comes_from() -> None:
    page = read_text(ROOT / "docs" / "nomenclature.md")
    sources = {source for *_, quantity in _parameters() for source in quantity.source.split(", ")}
    # The paper, derived, chosen; or a reference of the page, and none without a value.
    assert sources - {"P", "D", "C"} == set(re.findall(r"^- \*\*(.+?)\*\*:", page, re.MULTILINE))


def test_the_page_of_the_package_lists_every_extra_that_is_for_its_users() -> None:
    project = tomllib.loads(read_text(ROOT / "pyproject.toml"))["project"]
    page = read_text(ROOT / project["readme"])
    assert sorted(re.findall(r"^\| `digiclay\[(\w+)\]` \|", page, re.MULTILINE)) == sorted(
        project["optional-dependencies"].keys() - {"dev"}
    )


#: Section of a page that names all entries of a table of the code: page, heading, entries, their
#: form there.
NAMED = {
    "mesh formats that are written": ("docs/export.md", "## Formats", FORMATS, "`{}`"),
    "mesh formats that are read": (
        "docs/shapes.md",
        "### Meshes",
        [ending[1:].upper() for ending in READERS],
        "{}",
    ),
    "metrics of a run": ("docs/metrics.md", "## Metrics of a session", FIGURES, "`{}`"),
}


@pytest.mark.parametrize(("page", "heading", "entries", "form"), NAMED.values(), ids=list(NAMED))
def test_a_page_names_each_entry_of_a_table(
    page: str, heading: str, entries: Iterable[str], form: str
) -> None:
    before, _, rest = read_text(ROOT / page).partition(f"\n{heading}\n")
    section = rest.partition("\n#")[0]
    lacking = [name for name in entries if form.format(name) not in section.replace("glTF", "GLTF")]
    assert lacking == [], (
        f"{page}, line {before.count(chr(10)) + 2}, '{heading}', needs {', '.join(lacking)}"
    )


#: A symbol with an index, in the text of a page or in a formula of a plot.
SYMBOL = re.compile(
    r"(?<![\w`./])(?:Δ?[A-Za-zα-ω]|Re)_\{?[A-Za-z]{1,8}\}?(?:\^[A-Za-z]+)?(?![\w(.])"
)
#: Those that pages define themselves, each for what stands around it.
LOCAL = """
F_a F_com F_j F_max F_n F_set F_trig H_VM H_j H_own H_rest K_v T_a U_f a_i d_j e_j f_di g_down g_up h_p r_j
t_i t_j u_i u_j v_free w_i w_j w_max w_min ΔP_c β_i ν_i
"""


def read_prose(path: Path) -> str:
    """Return the lines of a file without what is no prose: code of a page, names in Python."""
    text = read_text(path)
    if path.suffix == ".py":
        kept = {
            line
            for node in ast.walk(ast.parse(text))
            if isinstance(node, ast.Constant)
            and isinstance(node.value, str)
            and re.search(r"[ $]", node.value)
            for line in range(node.lineno, (node.end_lineno or 0) + 1)
        }
        return "\n".join(line if n in kept else "" for n, line in enumerate(text.splitlines(), 1))
    return "\n".join(
        "" if code else re.sub(r"`[^`]*`", "", line) for line, code in list_lines(text)
    )


def test_every_symbol_of_pages_and_of_the_paper_is_declared() -> None:
    """A parameter whose symbol has changed leaves its former one behind."""
    page = read_text(ROOT / "docs" / "nomenclature.md")
    declared = {quantity.symbol for *_, quantity in _parameters()}
    variables = set(
        re.findall(r"[^\s|,]+", " ".join(re.findall(r"^\| ([^|]+) \|", page, re.MULTILINE)))
    )
    files = [*PAGES, *(ROOT / "digiclay_paper").glob("*.py"), ROOT / "digiclay_paper" / "paper.md"]
    unknown = [
        f"{path.relative_to(ROOT)}:{number}: {symbol}"
        for path in files
        for number, line in enumerate(read_prose(path).splitlines(), 1)
        for symbol in re.sub(r"[{}]", "", " ".join(SYMBOL.findall(line))).split()
        if symbol not in declared | variables | set(LOCAL.split())
    ]
    assert unknown == [], (
        "symbols of no parameter: write the present one, or add it to LOCAL in tests/form/test_pages.py"
    )


def _targets(entry: Any) -> Iterator[str]:
    if isinstance(entry, str):
        yield entry
    for inner in (
        entry.values() if isinstance(entry, dict) else entry if isinstance(entry, list) else ()
    ):
        yield from _targets(inner)


def test_the_navigation_names_each_page_once_and_none_that_is_missing() -> None:
    listed = list(_targets(yaml.safe_load(read_text(ROOT / "mkdocs.yml"))["nav"]))
    written = [name for name in listed if name not in MADE and not name.startswith("reference/")]
    pages = {path.relative_to(ROOT / "docs").as_posix() for path in (ROOT / "docs").rglob("*.md")}
    assert sorted(written) == sorted(pages), "each page needs one line under nav in mkdocs.yml"
    assert {*listed} >= MADE


def test_every_picture_is_shown_and_has_a_row_of_the_table() -> None:
    folder = ROOT / "docs" / "pictures"
    targets = [(page, found) for page in PAGES for found in SHOWN.findall(read_text(page))]
    shown = {(page.parent / target).resolve() for page, target in targets}
    # The page of the sample scenes is made at the build.
    shown |= {folder / "samples" / f"{name}.jpg" for name in list_samples()}
    lacking = [path.stem for path in shown if not path.exists()]
    assert lacking == [], "draw each by 'python tools/doc_pictures.py samples/NAME.jpg'"
    # The table in CONTRIBUTING.md has the command of each.
    table = ROW.findall(read_text(ROOT / "CONTRIBUTING.md"))
    patterns = [name for names, _ in table for name in re.findall(r"`([^`]+)`", names)]
    inside = (
        path.relative_to(folder).as_posix() if folder in path.parents else path.name
        for path in shown
    )
    rows = {name: [row for row in patterns if fnmatch(name, row)] for name in inside}
    assert {name: found for name, found in rows.items() if len(found) != 1} == {}
    assert set(patterns) == {row for found in rows.values() for row in found}
    assert sorted(set(folder.rglob("*.*")) - shown) == []
