"""OpenCue's cuecmd: lists of commands, one a line.

The commands of a list run in any order and at the same time, so there is a list for each stage.
"""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Sequence

from ..core.base.errors import OutputError
from .series_plan import Task, split_frames


def format_lists(tasks: Sequence[Task], program: Sequence[str], series: str) -> dict[str, str]:
    """Return the lists by their names, in the order in which they are to be submitted.

    `tasks`: each after those it needs; `program`: path of the program, and its arguments before those of
    digiclay; `series`: folder of the series. Raises OutputError when a path cannot stand in a line.
    """
    depth: dict[str, int] = {}
    lists: dict[tuple[int, str], list[str]] = {}
    for task in split_frames(tuple(tasks)):
        depth[task.name] = 1 + max((depth[need] for need in task.needs), default=0)
        line = join_words([*program, *task.list_arguments(series)], windows=os.name == "nt")
        lists.setdefault((depth[task.name], task.stage), []).append(line)
    return {
        f"{number}-{stage}.txt": "\n".join(lines) + "\n" for (number, stage), lines in sorted(lists.items())
    }


def join_words(words: Sequence[str], *, windows: bool) -> str:
    """Return a command as one line of a shell.

    `windows`: for cmd.exe, where double quotes protect all but themselves and percent signs. Raises
    OutputError when a word cannot stand in a line.
    """
    for word in words:
        if re.search(r"[\x00-\x1f\x7f]", word) or (windows and re.search('[%"]', word)):
            raise OutputError(
                f"{word!r} cannot stand in a line of a command list: choose another folder with --out."
            )
    if not windows:
        return shlex.join(words)
    quoted = (re.sub(r"(\\+)$", r"\1\1", word) for word in words)
    return " ".join(word if re.fullmatch(r"[\w.:\\/+-]+", word) else f'"{word}"' for word in quoted)
