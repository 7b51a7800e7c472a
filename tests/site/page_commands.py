"""Commands of the pages, and the files that the pages give for them."""

from __future__ import annotations

import re
from typing import NamedTuple

#: Programs whose lines are commands; a number behind a name is a version.
PROGRAM = re.compile(
    r"(?:\$ )?(python (?:tools|docs/examples)/\w+\.py(?: .*)?"
    r"|(?:digiclay|python -m (?:benchmarks|digiclay)|make|pip install"
    r"|blender (?:--command|--background|-b)|dask|\.venv/bin/\w+) (?!\d).*)"
)
#: Word in place of which a reader writes something: DIR, RUN, SCENE.
PLACEHOLDER = re.compile(r"(?<![\w./-])[A-Z]{3,}[0-9]?(?![\w./])(?!=)|\.\.\.|…|/path/to")
#: Command without arguments: within a sentence it is the name of the command.
NAME = re.compile(r"(?:blender --command digiclay|digiclay [\w-]+)")
#: First line of a block that is a file, with the name of the file.
TITLE = re.compile(r'```\w+ title="([^"]+)"')


class Command(NamedTuple):
    """One command of a page, and whether it stands in a block of code; else within a sentence or a table."""

    text: str
    block: bool


class Given(NamedTuple):
    """A file that a page gives: name and content."""

    name: str
    content: str


def _complete(text: str) -> str:
    """Return a command without the remark beside it, which begins at two blanks or a #."""
    return re.split(r"\s{2,}|\s#\s", text.strip())[0].strip()


def find_commands(text: str) -> list[Command]:
    """Return the commands of a page: lines of its blocks, and complete ones in its sentences, in order.

    One of a sentence with a placeholder is a form, and one without arguments a name.
    """
    found, fenced = [], False
    for line in text.splitlines():
        fence = line.lstrip().startswith("```")
        fenced ^= fence
        if fenced or line.startswith("    "):
            match = PROGRAM.fullmatch(line.strip())
            found += [Command(_complete(match[1]), True)] if match else []
            continue
        for inside in re.findall(r"`([^`]+)`", line):
            match = PROGRAM.fullmatch(inside)
            if match and not PLACEHOLDER.search(inside) and not NAME.fullmatch(inside):
                found.append(Command(_complete(match[1]), False))
    return found


def find_files(text: str) -> list[Given]:
    """Return the files of a page: its blocks with a title."""
    found: list[Given] = []
    lines = iter(text.splitlines())
    for line in lines:
        title = TITLE.match(line)
        if title:
            content = []
            for inside in lines:
                if inside.startswith("```"):
                    break
                content.append(inside)
            found.append(Given(title[1], "\n".join(content) + "\n"))
    return found
