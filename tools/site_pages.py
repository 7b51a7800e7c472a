"""Hook of MkDocs (`mkdocs.yml`): pages made at each build, anchors and links as in the repository.

The pages are the command line, the parameters, Python, and files from elsewhere.
"""

import argparse
import html
import os
import posixpath
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "addon"), str(ROOT / "tools")]

import digiclay  # noqa: E402
from digiclay.commands.describe import describe_meaning, write_range, write_value  # noqa: E402
from digiclay.commands.parser import parser  # noqa: E402
from digiclay.core.base.modes import MEANINGS  # noqa: E402
from digiclay.core.base.quantity import EXTENTS, Parameters, list_quantities  # noqa: E402
from digiclay.core.control.methods import METHODS  # noqa: E402
from digiclay.core.scene.scene_source import find, list_samples, load  # noqa: E402
from digiclay.core.scene.schema import SECTIONS, import_parameters  # noqa: E402
from digiclay.core.session.finished_run import HISTORY_ARRAYS, KINDS  # noqa: E402
from digiclay.core.studies.evaluation import FIGURES  # noqa: E402
from digiclay.core.studies.job_table import PICTURES  # noqa: E402
from digiclay.core.studies.speed_limits import Stroke  # noqa: E402
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
"""
#: The page of what `digiclay` offers in Python, by subject; its tables are made of the
#: declarations.
PYTHON = """\
# Python

`import digiclay` needs numpy alone. All quantities are in SI units; a wrong value is refused with a
`DigiclayError` of one line. [Tasks](../tasks.md#python) has a first program.

## Scenes

::: digiclay.scene

::: digiclay.samples

::: digiclay.Scene

[Sample scenes](samples.md) and [parameters](parameters.md) have tables of their own.

## Runs

::: digiclay.run

::: digiclay.load

::: digiclay.Result

### History

`Result.history` and `history.npz` have the same arrays, by name, with t rows, n pins and f fingers; with a
single finger the axis f is missing. Pin `i` is in row `i // columns` and column `i % columns`: the pins of a
row follow each other along x, the rows along y, both upwards. The last row begins no control period: its
commands are 0, its modes those of the period before.
{arrays}
The codes of `mode` are those of the class `Mode`:
{modes}
::: digiclay.Mode

## Sweeps and metrics

::: digiclay.sweep

::: digiclay.METRICS

### Table of metrics

[Metrics](../metrics.md) has the formulas.
{metrics}
## Control methods

[Write your own control method](../own-methods.md) shows how.

::: digiclay.methods

::: digiclay.Method

::: digiclay.quantity

::: digiclay.Orders

::: digiclay.SetPoint

## Control periods and the device

::: digiclay.steps

::: digiclay.force

::: digiclay.plate_force

::: digiclay.free_speed

::: digiclay.step_response

## Errors

::: digiclay.DigiclayError

## Extension of Blender

::: digiclay.register

::: digiclay.unregister

## Packages

[Architecture](../architecture.md) says what each is for. Their pages follow: those of the core first, then
those beside the extension, last the extension's own.
"""
#: Entry of that page: a line ``::: digiclay.NAME``; more options of some.
ENTRY = re.compile(r"^::: digiclay\.(\w+)$", re.MULTILINE)
MORE_OPTIONS = {
    "Scene": ["show_if_no_docstring: false"],
    "Mode": ["show_if_no_docstring: false"],
    "Result": ["inherited_members: true"],
    "Method": ["inherited_members: true"],
}
SAMPLES = """\
---
hide: [toc]
---
# Sample scenes

`digiclay run NAME` simulates a sample, `digiclay.scene("NAME")` is its scene in Python, and *Add > Mesh >
Digital Clay Samples* adds those without bodies in Blender. Each picture shows the last touch, the
middle of a press, or what a body has left.
"""
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
        (listed,) = [
            action for action in top._actions if isinstance(action, argparse._SubParsersAction)
        ]
        summaries = {entry.dest: entry.help or "" for entry in listed._choices_actions}
        for name, command in listed.choices.items():
            summary = "" if command.description else write_cell(summaries.get(name, ""))
            help_text = command.format_help().strip()
            lines += [f"### {top.prog} {name}", "", summary, "", "```text", help_text, "```", ""]
    return "\n".join(lines) + "\n"


def write_table(*rows: Sequence[str]) -> str:
    """Return a table of cells; the first row is its head."""
    head, *body = ("| " + " | ".join(row) + " |" for row in rows)
    return "\n".join(("", head, "|---" * len(rows[0]) + "|", *body, ""))


def _section(name: str, kind: type[Parameters], which: str = "") -> list[str]:
    """Return the heading and the table of one section of a file."""
    title = f"## [{name}]{which}"
    rows: list[Sequence[str]] = [
        ("Symbol", "Name", "Unit", "Meaning", "Range", "Default", "Source")
    ]
    for field, declared in list_quantities(kind).items():
        default, meaning = write_value(getattr(kind(), field)), describe_meaning(declared)
        cells = (
            f"`{name}.{field}`",
            declared.unit,
            meaning,
            write_range(declared),
            default,
            declared.source,
        )
        rows.append((declared.symbol, *cells))
    return ["", title, "", write_cell((kind.__doc__ or "").split("\n\n")[0]), write_table(*rows)]


def make_parameters_page() -> str:
    """Return the page of all parameters of a scene, from their declarations."""
    extents = [(unit or "1", f"{least:g}", f"{most:g}") for unit, (least, most) in EXTENTS.items()]
    lines = [AHEAD + PARAMETERS, write_table(("Unit", "Least above 0", "Most"), *extents)]
    for name in (*SECTIONS, "body"):
        if name != "control":
            lines += _section(name, import_parameters(name, ""))
            continue
        for method in METHODS:
            lines += _section(name, import_parameters(name, method), f' with method = "{method}"')
    lines += ["", "Sections of [JOBS](../job-series.md) and [STUDY](../valves.md) files:"]
    for name, kind in {**PICTURES, "stroke": Stroke}.items():
        lines += _section(name, kind)
    return "\n".join(lines) + "\n"


def make_samples_page() -> str:
    """Return the page of all sample scenes."""
    rows = [("", "Scene", "Control method", "Fingers", "Bodies", "Duration, s")]
    for name in list_samples():
        scene = load(find(name))
        picture = f'![{name}](../pictures/samples/{name}.jpg){{ style="min-width: 195px; max-width: 195px" }}'
        words = f"`{name}`<br>{write_cell(scene.description)}"
        duration = f"{scene.periods * scene.simulation.control_period:.3g}"
        fingers = sum(finger.fingertip is not None for finger in scene.fingers)
        counts = str(fingers), str(len(scene.bodies))
        rows.append((picture, words, f"`{scene.method}`", *counts, duration))
    return SAMPLES + write_table(*rows)


def list_packages() -> dict[str, list[str]]:
    """Return the modules of each package by its dotted name: the core's first, the extension's last."""
    packages: dict[str, list[str]] = {}
    for name, folder in CODE.items():
        for path in sorted(folder.rglob("__init__.py")):
            package = ".".join((name, *path.parent.relative_to(folder).parts))
            modules = [
                f"{package}.{module.stem}" for module in sorted(path.parent.glob("[!_]*.py"))
            ]
            # The names of the extension itself stand by subject on the page before.
            packages[package] = modules if package == "digiclay" else [package, *modules]
    return dict(
        sorted(
            packages.items(),
            key=lambda row: (".core" not in row[0], "digiclay" in row[0].split(".")),
        )
    )


def write_entry(entry: re.Match[str]) -> str:
    """Return an entry of the page of Python for mkdocstrings, with the place where its name is defined."""
    name = entry[1]
    module, attribute = digiclay.LATER.get(name, ("", name))
    path = ".".join(filter(None, ("digiclay", module, attribute)))
    options = [f"heading: digiclay.{name}", f"toc_label: {name}", "heading_level: 3"]
    lines = (f"      {option}" for option in options + MORE_OPTIONS.get(name, []))
    return "\n".join((f"::: {path}", "    options:", *lines))


def make_python_page() -> str:
    """Return the page of what `digiclay` offers in Python."""
    arrays = [
        (f"`{name}`", f"({array.axes})", KINDS[array.kinds], array.unit, array.meaning)
        for name, array in HISTORY_ARRAYS.items()
    ]
    modes = [(str(int(mode)), mode.name.lower(), meaning) for mode, meaning in MEANINGS.items()]
    metrics = [
        (f"`{name}`", metric.unit, metric.worse, metric.doc) for name, metric in FIGURES.items()
    ]
    return ENTRY.sub(write_entry, PYTHON).format(
        arrays=write_table(("Name", "Shape", "Type", "Unit", "Meaning"), *arrays),
        modes=write_table(("Code", "Mode", "Meaning"), *modes),
        metrics=write_table(("Name", "Unit", "Worse if", "Meaning"), *metrics),
    )


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
    reference = next(entry["Reference"] for entry in config.nav if "Reference" in entry)
    next(entry["Python"] for entry in reference if "Python" in entry).extend(pages)


def on_files(files: Any, config: Any) -> None:
    """Add the pages that are made from the code, those from outside docs/, and the measured results."""
    made: dict[str, str | bytes] = {
        "reference/commands.md": make_commands_page(),
        "reference/parameters.md": make_parameters_page(),
        "reference/samples.md": make_samples_page(),
        "reference/python.md": make_python_page(),
    }
    for name, modules in list_packages().items():
        made[f"reference/python/{name}.md"] = BEHIND + "\n".join(
            f"::: {module}\n" for module in modules
        )
    for page, source in ELSEWHERE.items():
        made[page] = (ROOT / source).read_text(encoding="utf-8")
    for path in (ROOT / "benchmarks" / "results").iterdir():
        address = find_place(path.relative_to(ROOT).as_posix())
        if address:
            made[address] = path.read_bytes()
    for address, content in made.items():
        files.append(File.generated(config, address, content=content))


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """Return the text of a page with the links of the site."""
    place = page.file.src_uri
    if place.startswith("reference/"):
        return markdown
    source = ELSEWHERE.get(place, f"docs/{place}")
    return relink(markdown, source, place)
