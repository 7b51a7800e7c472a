"""Hook of MkDocs (`mkdocs.yml`): pages made at each build, anchors and links as in the repository.

The pages are the command line, the parameters, Python, and files from elsewhere.
"""

import argparse
import ast
import html
import os
import posixpath
import re
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "addon"), str(ROOT / "tools")]

from digiclay.commands.describe import describe_meaning, write_range, write_value  # noqa: E402
from digiclay.commands.parser import parser  # noqa: E402
from digiclay.core.base.quantity import EXTENTS, Parameters, list_quantities  # noqa: E402
from digiclay.core.control.methods import METHODS  # noqa: E402
from digiclay.core.scene.schema import SECTIONS, import_parameters  # noqa: E402
from manual import make_anchor  # noqa: E402
from mkdocs.structure.files import File  # noqa: E402

from benchmarks.kinds import parser as benchmarks_parser  # noqa: E402

#: Pages of the site that stand elsewhere in the repository: their file.
ELSEWHERE = {
    "contributing.md": "CONTRIBUTING.md",
    "changes.md": "CHANGELOG.md",
    "benchmarks.md": "benchmarks/README.md",
}
#: Folders of code with pages of their own, and the prefix of their import.
CODE = {
    "digiclay": ROOT / "addon" / "digiclay",
    "digiclay_paper": ROOT / "digiclay_paper",
    "digiclay_serve": ROOT / "digiclay_serve",
    "digiclay_study": ROOT / "digiclay_study",
}
COMMANDS = """\
# Command line

`--help` prints the same.
"""
PARAMETERS = """\
# Parameters

Made from the declarations of the parameters in the core. A key of a scene file, `pitch = "2.5 mm"` in its
section `[layout]`, is `--set "layout.pitch=2.5 mm"` on the command line. In Blender the panels *Device*,
*Finger* and *Control* have the same parameters. The source is P (the paper), D (derived), C (chosen), or a
[reference](../nomenclature.md#references). A default in brackets is a sequence of values. A range is in the
unit of the parameter. It does not contain rules that join several parameters. A range without an end has the
limits of its unit:

| Unit | Least above 0 | Most |
|---|---|---|
"""
PYTHON = """\
# Python

Made from the docstrings of the code. [Architecture](../architecture.md) describes how the packages work
together; [tasks](../tasks.md#python) has a first program.

| package | content |
|---|---|
"""
#: Page that lists the packages of the code; their pages follow it in the navigation, *Reference > Python*.
PACKAGES_PAGE = "reference/python.md"
#: Head of a page whose results of a search come after those of the pages for readers.
BEHIND = "---\nsearch:\n  boost: 0.0005\n---\n"
#: Head of a page whose results come before those of the others.
AHEAD = "---\nsearch:\n  boost: 20\n---\n"
#: The help of commands has one width wherever the site is built, characters.
os.environ["COLUMNS"] = "98"
LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)\s]+)\)")


def write_cell(text: str) -> str:
    """Return a text for a cell of a table, where nothing in it is markup."""
    return re.sub(r"([*_|\[\]`\\])", r"\\\1", html.escape(" ".join(text.split()), quote=False))


def make_commands_page() -> str:
    """Return the page of the command line: the help of every command."""
    lines = [COMMANDS]
    for top, where in ((parser(), ""), (benchmarks_parser(), " In a checkout alone.")):
        lines += [f"## {top.prog}", "", write_cell(top.description or "") + where, ""]
        (listed,) = [action for action in top._actions if isinstance(action, argparse._SubParsersAction)]
        summaries = {entry.dest: entry.help or "" for entry in listed._choices_actions}
        for name, command in listed.choices.items():
            summary = "" if command.description else write_cell(summaries.get(name, ""))
            help_text = command.format_help().strip()
            lines += [f"### {top.prog} {name}", "", summary, "", "```text", help_text, "```", ""]
    return "\n".join(lines) + "\n"


def _section(name: str, method: str) -> list[str]:
    """Return the heading and the table of one section of a scene file."""
    kind: type[Parameters] = import_parameters(name, method)
    title = f"## [{name}]" + (f' with method = "{method}"' if name == "control" else "")
    lines = ["", title, "", write_cell((kind.__doc__ or "").split("\n\n")[0]), ""]
    lines += [
        "| Symbol | Name | Unit | Meaning | Range | Default | Source |",
        "|---|---|---|---|---|---|---|",
    ]
    for field, declared in list_quantities(kind).items():
        default, meaning = write_value(getattr(kind(), field)), describe_meaning(declared)
        cells = (f"`{name}.{field}`", declared.unit, meaning, write_range(declared), default, declared.source)
        lines.append("| " + " | ".join((declared.symbol, *cells)) + " |")
    return lines


def make_parameters_page() -> str:
    """Return the page of all parameters of a scene, from their declarations."""
    lines = [AHEAD + PARAMETERS.rstrip()]
    lines += [f"| {unit or 1} | {least:g} | {most:g} |" for unit, (least, most) in EXTENTS.items()]
    for name in SECTIONS:
        for method in METHODS if name == "control" else ("virtual_master",):
            lines += _section(name, method)
    return "\n".join(lines) + "\n"


def list_packages() -> dict[str, list[str]]:
    """Return the modules of each package of the code, by the dotted name of the package."""
    packages: dict[str, list[str]] = {}
    for name, folder in CODE.items():
        for path in sorted(folder.rglob("*.py")):
            *parts, last = path.relative_to(folder).with_suffix("").parts
            # A folder without this file holds data, such as Blender's presets.
            if last not in ("__init__", "__main__") and (path.parent / "__init__.py").exists():
                packages.setdefault(".".join((name, *parts)), []).append(last)
    return dict(sorted(packages.items()))


def _first_line(package: str) -> str:
    """Return the first line of a package's docstring."""
    name, *parts = package.split(".")
    text = CODE[name].joinpath(*parts, "__init__.py").read_text(encoding="utf-8")
    return (ast.get_docstring(ast.parse(text)) or "").partition("\n")[0]


def make_package_page(package: str, modules: list[str]) -> str:
    """Return the page of a package: its modules by their docstrings. `package`: dotted name."""
    lines = [BEHIND, f"# {package}", "", _first_line(package), ""]
    for module in modules:
        lines += [f"::: {package}.{module}", ""]
    return "\n".join(lines)


def make_packages_page(packages: dict[str, list[str]]) -> str:
    """Return the page that lists the packages."""
    return PYTHON + "".join(f"| [`{one}`](python/{one}.md) | {_first_line(one)} |\n" for one in packages)


def find_place(path: str) -> str:
    """Return the place in the site of a file of the repository, or "" if it has none."""
    moved = {file: page for page, file in ELSEWHERE.items()}
    picture = path if path.startswith("benchmarks/results/") and path.endswith(".png") else ""
    return path.removeprefix("docs/") if path.startswith("docs/") else moved.get(path, picture)


def relink(text: str, source: str, page: str) -> str:
    """Return Markdown whose links to files lead to their places in the site; without one they become text.

    `source`: file of the text in the repository; `page`: its place in the site.
    """

    def place(link: re.Match[str]) -> str:
        picture, label, target = link.groups()
        name, mark, anchor = target.partition("#")
        if not name or "://" in target or target.startswith("mailto:"):
            return link[0]
        file = posixpath.normpath(posixpath.join(posixpath.dirname(source), name))
        there = find_place(file)
        if not there:
            return label
        return f"{picture}[{label}]({posixpath.relpath(there, posixpath.dirname(page) or '.')}{mark}{anchor})"

    return LINK.sub(place, text)


def on_config(config: Any) -> None:
    """Set the form of the anchors, and add the packages to the navigation."""
    config.mdx_configs.setdefault("toc", {})["slugify"] = make_anchor
    pages = [{name: f"reference/python/{name}.md"} for name in list_packages()]
    sections = {title: entries for entry in config.nav for title, entries in entry.items()}
    reference = {title: entries for entry in sections["Reference"] for title, entries in entry.items()}
    reference["Python"].extend(pages)


def on_files(files: Any, config: Any) -> None:
    """Add the pages that are made from the code, those from outside docs/, and the measured results."""
    packages = list_packages()
    made: dict[str, str | bytes] = {
        "reference/commands.md": make_commands_page(),
        "reference/parameters.md": make_parameters_page(),
        PACKAGES_PAGE: make_packages_page(packages),
    }
    for name, modules in packages.items():
        made[f"reference/python/{name}.md"] = make_package_page(name, modules)
    for page, source in ELSEWHERE.items():
        made[page] = (ROOT / source).read_text(encoding="utf-8")
    for path in (ROOT / "benchmarks" / "results").iterdir():
        place = find_place(path.relative_to(ROOT).as_posix())
        if place:
            made[place] = path.read_bytes()
    for place, content in made.items():
        files.append(File.generated(config, place, content=content))


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """Return the text of a page with the links of the site."""
    place = page.file.src_uri
    if place.startswith("reference/"):
        return markdown
    source = ELSEWHERE.get(place, f"docs/{place}")
    return relink(markdown, source, place)
