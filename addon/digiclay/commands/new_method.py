"""``digiclay new-method``: the file of a control method of one's own, which runs as it is."""

import os
import re
from argparse import ArgumentTypeError, Namespace
from pathlib import Path
from string import Template

from ..core.base.errors import OutputError
from ..core.control.methods import METHODS
from ..core.files.run_folder import make_folder, write_whole
from ..plugins.method_loader import name_method
from .arguments import command, say
from .refusals import refuse_unwritable

EXAMPLES = """\
examples:
  digiclay new-method mine                            mine.py with the class Mine, in the working folder
  digiclay run slow_press --method mine.py:Mine       the paper's press with it

docs/own-methods.md explains the file.
"""
#: The file that is copied.
TEMPLATE = Path(__file__).parents[1] / "sample_shapes" / "methods" / "template.txt"


def _name(text: str) -> str:
    """Read the name of a method."""
    if not re.fullmatch(r"[a-z][a-z0-9]*(_[a-z0-9]+)*", text) or len(text) > 60:
        rule = "must be small letters and digits, joined by _, such as soft_pad"
        raise ArgumentTypeError(f"{rule} (got {text!r})")
    if text in METHODS:
        raise ArgumentTypeError(f"must not be that of a built-in method (got {text!r})")
    if name_method(name_class(text)) != text:
        raise ArgumentTypeError(f"must have no digit behind a _ (got {text!r})")
    return text


OPTIONS = {
    "name NAME": (_name, "such as mine or soft_pad"),
    "--out DIR": (Path, "default: the working folder", Path()),
    "--overwrite": "replace an older file",
    "--quiet": "print errors only",
}


def name_class(name: str) -> str:
    """Return the name of a method's class by that of the method: soft_pad is ``SoftPad``."""
    return "".join(part.capitalize() for part in name.split("_"))


@command("write the file of a control method of your own, which runs as it is", EXAMPLES, OPTIONS)
def carry_out(arguments: Namespace) -> int:
    """Write the file."""
    refuse_unwritable(arguments.out)
    path: Path = arguments.out / f"{arguments.name}.py"
    if os.path.lexists(path) and not (arguments.overwrite and path.is_file()):
        raise OutputError(f"{path} is there already: choose another name, or --overwrite.")
    name = name_class(arguments.name)
    text = Template(TEMPLATE.read_text(encoding="utf-8")).substitute(
        {"Class": name, "file": path.name}
    )
    make_folder(path.parent)
    write_whole(path, text.encode())
    say(arguments, f"written to {path}", f"try: digiclay run slow_press --method {path}:{name}")
    return 0
