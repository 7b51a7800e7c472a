"""Check of docstrings: every public function of two or more parameters describes them.

usage: python tools/docstrings.py

Its docstring needs numpydoc's section *Parameters*, with its parameters and no others.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("addon/digiclay", "benchmarks", "digiclay_paper", "digiclay_serve", "digiclay_study")
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


def main(root: Path = ROOT) -> int:
    """Print a line for each function that is wrong; return the exit code, 1 if there is one."""
    found = sorted(lacking(root))
    for file, name in found:
        print(f"{file}: {name}: its docstring has no section Parameters with all of its parameters.")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
