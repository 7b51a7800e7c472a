"""Mutation test: cosmic-ray changes the core's physics, engine, control and metrics, one change at a time.

Without modules named, a sample is judged: the mutants whose lines have the smallest hashes. It is
the same in every run, and an edit changes only what it touches. Each mutant is written into its
file while the tests run.
"""

import argparse
import ast
import hashlib
import os
import re
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_and_test
from cosmic_ray.plugins import get_operator, operator_names
from cosmic_ray.testing import run_tests
from cosmic_ray.work_item import MutationSpec, TestOutcome

ROOT = Path(__file__).parents[1]
CORE = Path("addon", "digiclay", "core")
#: Packages of the core that are changed, but modules that only declare or list.
PACKAGES = ("model", "steppers", "engine", "control", "metrics")
DECLARING = ("methods", "interfaces")
#: Operators of cosmic-ray whose mutants mean something in numerical code.
OPERATORS = re.compile(
    r"""core/(AddNot|NumberReplacer|ZeroIterationForLoop|Replace(AndWithOr|OrWithAnd|TrueWithFalse|FalseWithTrue
    |BreakWithContinue|ContinueWithBreak|UnaryOperator_Delete_(Not|USub)
    |ComparisonOperator_(Lt_(LtE|Gt)|LtE_(Lt|Gt)|Gt_(GtE|Lt)|GtE_(Gt|Lt)|Eq_NotEq|NotEq_Eq|Is_IsNot|IsNot_Is)
    |BinaryOperator_(Add_Sub|Sub_Add|Mul_Div|Div_Mul|Pow_Mul|Mod_Mul|FloorDiv_Mul|BitOr_BitAnd|BitAnd_BitOr)))""",
    re.VERBOSE,
)
#: Tests that judge: the golden runs first.
FIRST = ("tests/regression/test_golden_run.py", "tests/regression/test_old_formats.py")
FOLDERS = ("unit", "property", "scenes", "regression", "convergence")
#: Longest that they may take with a mutant, s.
LONGEST = 1800.0


def list_modules() -> dict[str, Path]:
    """Return the files of the core that are changed, by package and module."""
    files = (path for package in PACKAGES for path in sorted((CORE / package).glob("*.py")))
    return {
        f"{path.parent.name}.{path.stem}": path
        for path in files
        if path.stem not in ("__init__", *DECLARING)
    }


def find_silent(source: str) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Return from where to where (line, column) a mutant says nothing: annotations, decorators, messages."""
    nodes: list[ast.AST] = []
    for node in ast.walk(ast.parse(source)):
        nodes += getattr(node, "decorator_list", [])
        nodes += filter(None, (getattr(node, "returns", None), getattr(node, "annotation", None)))
        nodes += [node] if isinstance(node, ast.Raise) else []
    return [((n.lineno, n.col_offset), (n.end_lineno, n.end_col_offset)) for n in nodes]  # type: ignore[attr-defined]


def list_mutants(path: Path) -> Iterator[tuple[str, MutationSpec]]:
    """Yield all mutants of a file, each with a hash of operator and line."""
    source, seen = path.read_text(encoding="utf-8"), Counter[str]()
    tree, silent, lines = get_ast(source), find_silent(source), source.splitlines()
    for name in filter(OPERATORS.fullmatch, operator_names()):
        operator = get_operator(name)()
        places = (
            position for node in ast_nodes(tree) for position in operator.mutation_positions(node)
        )
        for occurrence, (start, end) in enumerate(places):
            if any(first <= start and end <= last for first, last in silent):
                continue
            text = f"{path.name} {name} {lines[start[0] - 1].strip()}"
            seen[text] += 1
            rank = hashlib.sha256(f"{text} {seen[text]}".encode()).hexdigest()
            yield rank, MutationSpec(path, name, occurrence, start, end)


def main() -> int:
    """Judge what the command line asks for; the exit code is 1 where more survive than may."""
    os.chdir(ROOT)
    modules = list_modules()
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "modules", nargs="*", help="modules of the core, all of whose mutants are judged"
    )
    parser.add_argument("--count", type=int, default=100, help="mutants of the sample")
    parser.add_argument("--most", type=float, default=1.0, help="share that may survive")
    arguments, started = parser.parse_args(), time.monotonic()
    if unknown := set(arguments.modules) - set(modules):
        raise SystemExit(f"MODULES must be of {', '.join(modules)} (got {', '.join(unknown)})")
    os.environ["DIGICLAY_HYPOTHESIS"] = "first_failure"
    tests = " ".join([*FIRST, *(f"tests/{folder}" for folder in FOLDERS)])
    command = (
        f"{sys.executable} -m pytest -q -x -n auto --dist loadfile -p no:cacheprovider {tests}"
    )
    outcome, output = run_tests(command, LONGEST)
    if outcome != TestOutcome.SURVIVED:
        raise SystemExit(f"{output[-4000:]}\nmutants: FAILED (the tests fail without a mutation)")
    mutants = sorted(
        (mutant for name in arguments.modules or modules for mutant in list_mutants(modules[name])),
        key=lambda mutant: mutant[0],
    )
    chosen = mutants if arguments.modules else mutants[: arguments.count]
    survivors = 0
    for _, mutant in chosen:
        result = mutate_and_test([mutant], command, LONGEST)
        if result.test_outcome == TestOutcome.SURVIVED:
            survivors += 1
            print(f"survived: {result.diff}", flush=True)
    share = survivors / len(chosen)
    print(
        f"mutants: {'FAILED' if share > arguments.most else 'passed'}: {len(chosen)} of {len(mutants)}, "
        f"{survivors} survived ({share:.0%}; {arguments.most:.0%} may), in {time.monotonic() - started:.0f} s"
    )
    return int(share > arguments.most)


if __name__ == "__main__":
    sys.exit(main())
