"""Check of docstrings: every public function of two or more parameters describes them.

usage: python tools/docstrings.py [--write]

Its docstring needs numpydoc's section *Parameters*, with its parameters and no others. docstrings.txt beside
this file lists the functions that still lack it, a line a file. The list may only shrink: it is an error when
a function lacks the section and is not listed, and when a listed one lacks it no longer. --write takes the
latter out and follows functions whose file was renamed; it never adds one.
"""

from __future__ import annotations

import argparse
import ast
import re
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("addon/digiclay", "benchmarks", "digiclay_paper")
LIST = Path(__file__).with_suffix(".txt")
HEAD = "# Functions without a section Parameters, by file; kept by tools/docstrings.py --write."
#: Methods that Blender calls, with the parameters it gives them.
BLENDERS = dict.fromkeys(("invoke", "modal"), ("context", "event"))

Function = ast.FunctionDef | ast.AsyncFunctionDef


def public_functions(tree: ast.Module | ast.ClassDef, owner: str = "") -> Iterator[tuple[str, str, Function]]:
    """Give each public function with its class, empty where there is none, and its name.

    Parameters
    ----------
    tree : ast.Module or ast.ClassDef
    owner : str
        Its name where it is a class.
    """
    for node in tree.body:
        if isinstance(node, Function) and not node.name.startswith("_"):
            yield owner, node.name, node
        elif isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            yield from public_functions(node, node.name)


def parameters(function: Function) -> tuple[str, ...]:
    """Return a function's parameters, but `self` and `cls`."""
    given = function.args
    several = [one for one in (given.vararg, given.kwarg) if one]
    names = [one.arg for one in (*given.posonlyargs, *given.args, *given.kwonlyargs, *several)]
    return tuple(name for name in names if name not in ("self", "cls"))


def documented(function: Function) -> set[str]:
    """Return the parameters that the section of a function's docstring names."""
    text = ast.get_docstring(function) or ""
    section = re.search(r"^Parameters\n-+\n(.*?)(?:\n\n\w+\n-{3}|\Z)", text, re.MULTILINE | re.DOTALL)
    heads = re.findall(r"^(\S[^:\n]*?)(?: :.*)?$", section[1], re.MULTILINE) if section else []
    return {name.strip().strip("*\\`") for head in heads for name in head.split(",")}


def lacking(root: Path = ROOT) -> set[tuple[str, str]]:
    """Return file and name of each function without the section.

    A method that a base class or a Protocol declares is documented there: it needs no section of its own.
    """
    found: list[tuple[str, str, str, Function]] = []
    bases: set[str] = set()
    for package in PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            found += [(path.relative_to(root).as_posix(), *one) for one in public_functions(tree)]
            for node in ast.walk(tree):
                if isinstance(node, ast.ClassDef):
                    names = {ast.unparse(base).split("[")[0].split(".")[-1] for base in node.bases}
                    bases |= names | ({node.name} if "Protocol" in names else set())
    right = {one for one in found if documented(one[-1]) == set(parameters(one[-1]))}
    declared = {(name, parameters(function)) for _, owner, name, function in right if owner in bases}
    return {
        (file, f"{owner}.{name}" if owner else name)
        for file, owner, name, function in set(found) - right
        if len(own := parameters(function)) > 1
        and not (owner and (name, own) in declared)
        and BLENDERS.get(name) != own
    }


def read(listed: Path) -> set[tuple[str, str]]:
    """Return file and name of each listed function."""
    lines = [line.split() for line in listed.read_text(encoding="utf-8").splitlines() if line[:1] not in "#"]
    return {(file, name) for file, *names in lines for name in names}


def write(listed: Path, functions: set[tuple[str, str]]) -> None:
    """Write the list, a line a file.

    Parameters
    ----------
    listed : Path
    functions : set of (str, str)
        File and name of each.
    """
    files: dict[str, list[str]] = {}
    for file, name in sorted(functions):
        files.setdefault(file, []).append(name)
    lines = [" ".join([file, *names]) for file, names in files.items()]
    listed.write_text("\n".join([HEAD, *lines, ""]), encoding="utf-8")


def kept(found: set[tuple[str, str]], known: set[tuple[str, str]]) -> set[tuple[str, str]]:
    """Return what stays on the list: listed functions, also under the new name of their file.

    Parameters
    ----------
    found : set of (str, str)
        File and name of each function that lacks the section.
    known : set of (str, str)
        Those that are listed.
    """
    moved = Counter(name for _, name in known - found)
    stay = found & known
    for one in sorted(found - known):
        if moved[one[1]] > 0:
            moved[one[1]] -= 1
            stay.add(one)
    return stay


def main(argv: Sequence[str] | None = None, root: Path = ROOT, listed: Path = LIST) -> int:
    """Check, and print a line for each function that is wrong; the exit code is 1 if there is one.

    Parameters
    ----------
    argv : sequence of str, optional
        The arguments; by default those of the process.
    root : Path
        The checkout.
    listed : Path
        The list.
    """
    parser = argparse.ArgumentParser(description="Check that docstrings have their parameters.")
    parser.add_argument("--write", action="store_true", help="take out of the list what is documented now")
    found, known = lacking(root), read(listed)
    if parser.parse_args(argv).write:
        known = kept(found, known)
        write(listed, known)
    for file, name in sorted(found - known):
        print(f"{file}: {name}: its docstring has no section Parameters with all of its parameters.")
    for file, name in sorted(known - found):
        print(f"{file}: {name}: it is documented, or gone: run 'python tools/docstrings.py --write'.")
    print(f"{len(found)} public functions of two or more parameters have no section Parameters yet.")
    return int(found != known)


if __name__ == "__main__":
    sys.exit(main())
