"""The pages made at the build have every command, parameter and module."""

import argparse
import ast
import html
import re
from collections.abc import Iterator
from pathlib import Path

from digiclay.commands.parser import parser
from digiclay.core.base.quantity import list_quantities
from digiclay.core.control.methods import METHODS
from digiclay.core.scene.schema import SECTIONS, import_parameters

from benchmarks.kinds import parser as benchmarks_parser
from tests.form.test_pages import COMMAND, is_refused

ROOT = Path(__file__).parents[2]
PACKAGES = {
    "digiclay": ROOT / "addon" / "digiclay",
    **{n: ROOT / n for n in ("digiclay_paper", "digiclay_study")},
}


def commands() -> Iterator[argparse.ArgumentParser]:
    for top in (parser(), benchmarks_parser()):
        for action in top._actions:
            if isinstance(action, argparse._SubParsersAction):
                yield from action.choices.values()


def text_of(page: Path) -> str:
    return html.unescape(re.sub(r"<[^>]+>", "", page.read_text(encoding="utf-8")))


def test_every_command_is_on_the_page_of_the_command_line(site: Path) -> None:
    text = text_of(site / "reference" / "commands.html")
    assert [command.prog for command in commands() if f"usage: {command.prog} " not in text] == []


def test_every_example_of_the_command_line_is_one_that_its_program_takes() -> None:
    epilogs = [*(command.epilog or "" for command in commands()), parser().epilog, benchmarks_parser().epilog]
    joined = [" ".join((epilog or "").split("\\\n")) for epilog in epilogs]
    found = [COMMAND.match(line.strip()) for epilog in joined for line in epilog.splitlines()]
    # Two blanks begin the remark beside a command.
    examples = [(match[1], re.split(r"(?<! )\s{2,}(?=[^-\s])| > ", match[2])[0]) for match in found if match]
    assert len(examples) > 40
    assert [example for example in examples if is_refused(*example)] == []


def test_every_parameter_is_on_its_page_with_its_unit(site: Path) -> None:
    text = (site / "reference" / "parameters.html").read_text(encoding="utf-8")
    lacking = []
    for name in SECTIONS:
        for method in METHODS if name == "control" else ("virtual_master",):
            for field, known in list_quantities(import_parameters(name, method)).items():
                cells = f"<td><code>{name}.{field}</code></td>\n<td>{known.unit}</td>"
                lacking += [] if cells in text else [f"{name}.{field}"]
    assert lacking == []


def test_every_module_of_the_code_is_on_the_page_of_its_package(site: Path) -> None:
    lacking = []
    for name, folder in PACKAGES.items():
        for path in folder.rglob("*.py"):
            parts = path.relative_to(folder).with_suffix("").parts
            tree = ast.parse(path.read_text(encoding="utf-8"))
            if parts[-1] in ("__init__", "__main__") or not (path.parent / "__init__.py").exists():
                continue
            page = site / "reference" / "python" / f"{'.'.join((name, *parts[:-1]))}.html"
            text = page.read_text(encoding="utf-8") if page.exists() else ""
            module = ".".join((name, *parts))
            classes = [one.name for one in tree.body if isinstance(one, ast.ClassDef) and one.name[0] != "_"]
            wanted = [module, *(f"{module}.{one}" for one in classes if "__all__" not in path.read_text())]
            lacking += [one for one in wanted if f'id="{one}"' not in text]
    assert lacking == []
