"""The pages made at the build have every command, parameter, public name, sample, array and metric."""

import argparse
import ast
import html
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import digiclay
import griffe
import pytest
from digiclay.commands.parser import parser
from digiclay.core.base.quantity import list_quantities
from digiclay.core.control.methods import METHODS
from digiclay.core.scene.scene_source import list_samples
from digiclay.core.scene.schema import SECTIONS, import_parameters
from digiclay.core.session.finished_run import HISTORY_ARRAYS
from digiclay.core.studies.evaluation import FIGURES

from benchmarks.kinds import parser as benchmarks_parser
from tests.form.test_pages import COMMAND, is_refused
from tests.scene_files import read_text

ROOT = Path(__file__).parents[2]
PACKAGES = ("digiclay", "digiclay_paper", "digiclay_serve", "digiclay_study")


def commands() -> Iterator[argparse.ArgumentParser]:
    for top in (parser(), benchmarks_parser()):
        for action in top._actions:
            if isinstance(action, argparse._SubParsersAction):
                yield from action.choices.values()


def text_of(page: Path) -> str:
    return html.unescape(re.sub(r"<[^>]+>", "", read_text(page)))


def test_every_command_is_on_the_page_of_the_command_line(site: Path) -> None:
    text = text_of(site / "reference" / "commands.html")
    assert [command.prog for command in commands() if f"usage: {command.prog} " not in text] == []


def test_every_example_of_the_command_line_is_one_that_its_program_takes() -> None:
    epilogs = [
        *(command.epilog or "" for command in commands()),
        parser().epilog,
        benchmarks_parser().epilog,
    ]
    joined = [" ".join((epilog or "").split("\\\n")) for epilog in epilogs]
    found = [COMMAND.match(line.strip()) for epilog in joined for line in epilog.splitlines()]
    # Two blanks begin the remark beside a command.
    examples = [
        (match[1], re.split(r"(?<! )\s{2,}(?=[^-\s])| > ", match[2])[0]) for match in found if match
    ]
    assert len(examples) > 40
    assert [example for example in examples if is_refused(*example)] == []


def test_every_parameter_is_on_its_page_with_its_unit(site: Path) -> None:
    text = read_text(site / "reference" / "parameters.html")
    lacking = []
    for name in SECTIONS:
        for method in METHODS if name == "control" else ("virtual_master",):
            for field, known in list_quantities(import_parameters(name, method)).items():
                cells = f"<td><code>{name}.{field}</code></td>\n<td>{known.unit}</td>"
                lacking += [] if cells in text else [f"{name}.{field}"]
    assert lacking == []


def test_every_name_that_python_offers_has_its_entry_by_subject(site: Path) -> None:
    text = read_text(site / "reference" / "python.html")
    headings = " ".join(re.findall(r"<h3 .*?</h3>", text, re.DOTALL))
    entries = set(re.findall(r">\s*digiclay\.(\w+)\s*<", headings))
    tree = ast.parse(read_text(Path(digiclay.__file__)))
    functions = [
        node.name for node in tree.body if isinstance(node, ast.FunctionDef) and node.name[0] != "_"
    ]
    offered = {*functions, *digiclay.__all__}
    assert offered - entries == set(), "PYTHON in tools/site_pages.py needs a ':::' entry of each"


def list_public(module: griffe.Object) -> Iterator[str]:
    for name, member in module.members.items():
        hidden = (
            module.exports and name not in module.exports and isinstance(member, griffe.Attribute)
        )
        if name[0] != "_" and not hidden and not isinstance(member, griffe.Alias):
            yield member.path
            if isinstance(member, griffe.Module | griffe.Class):
                yield from list_public(member)


@pytest.mark.parametrize("package", PACKAGES)
def test_everything_public_is_in_the_reference(site: Path, package: str) -> None:
    pages = [read_text(page) for page in (site / "reference").rglob("*.html")]
    anchors = {anchor for text in pages for anchor in re.findall(r'id="([\w.]+)"', text)}
    public = [*list_public(griffe.load(package, search_paths=[ROOT / "addon", ROOT]))]
    assert len(public) > 100
    assert [path for path in public if path not in anchors] == []


def rows_of(page: Path) -> list[str]:
    return re.findall(r"<tr>.*?</tr>", read_text(page), re.DOTALL)


def test_every_sample_scene_has_its_row_with_a_picture(site: Path) -> None:
    pictures = {
        name: picture
        for row in rows_of(site / "reference" / "samples.html")
        for picture in re.findall(r'<img[^>]* src="([^"]+)"', row)
        for name in re.findall(r"<code>(\w+)</code><br", row)
    }
    assert pictures.keys() == {*list_samples()}
    lacking = [
        name for name, picture in pictures.items() if not (site / "reference" / picture).is_file()
    ]
    assert lacking == [], "draw each by 'python tools/doc_pictures.py samples/NAME.jpg'"


@pytest.mark.parametrize("table", [HISTORY_ARRAYS, FIGURES], ids=["arrays of a history", "metrics"])
def test_every_declared_name_has_its_row_with_its_unit(site: Path, table: dict[str, Any]) -> None:
    rows = rows_of(site / "reference" / "python.html")
    lacking = [
        name
        for name, declared in table.items()
        if not any(
            f"<code>{name}</code>" in row and f"<td>{declared.unit}</td>" in row for row in rows
        )
    ]
    assert lacking == []
