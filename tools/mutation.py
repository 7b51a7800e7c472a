"""Mutants of a module of the core: one change each, by cosmic-ray's operators."""

import ast
import hashlib
import re
from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass
from pathlib import Path

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator

ROOT = Path(__file__).parents[1]
CORE = ROOT / "addon" / "digiclay" / "core"
#: File and line.
Place = tuple[str, int]
#: Operators of cosmic-ray whose mutants mean something in numerical code.
COMPARED = {"Lt": ("LtE", "Gt"), "LtE": ("Lt", "Gt"), "Gt": ("GtE", "Lt"), "GtE": ("Gt", "Lt")}
COMPARED |= {"Eq": ("NotEq",), "NotEq": ("Eq",), "Is": ("IsNot",), "IsNot": ("Is",)}
COMPUTED = {"Add": "Sub", "Sub": "Add", "Mul": "Div", "Div": "Mul", "Pow": "Mul", "Mod": "Mul"}
COMPUTED |= {"BitOr": "BitAnd", "BitAnd": "BitOr", "FloorDiv": "Mul"}
OTHERS = (
    "AddNot", "NumberReplacer", "ReplaceAndWithOr", "ReplaceOrWithAnd", "ReplaceTrueWithFalse",
    "ReplaceFalseWithTrue", "ReplaceBreakWithContinue", "ReplaceContinueWithBreak",
    "ReplaceUnaryOperator_Delete_Not", "ReplaceUnaryOperator_Delete_USub", "ZeroIterationForLoop",
)  # fmt: skip


@dataclass(frozen=True)
class Mutant:
    """A change of one place: a module of the core, which operator, and which of its places there."""

    module: str
    operator: str
    occurrence: int
    line: int
    column: int

    @property
    def path(self) -> Path:
        """The module's file."""
        return CORE.joinpath(*self.module.split(".")).with_suffix(".py")

    def source(self) -> str:
        """Return the module's source with the change."""
        text = mutate_code(
            self.path.read_text(encoding="utf-8"), get_operator(self.operator)(), self.occurrence
        )
        assert text is not None, f"no mutant: {self}"
        return text

    def describe(self) -> str:
        """Return file, line, and the line before and after."""
        before = self.path.read_text(encoding="utf-8").splitlines()
        after = self.source().splitlines()
        at = next(i for i, pair in enumerate(zip(before, after, strict=False)) if pair[0] != pair[1])
        return f"{self.path.relative_to(ROOT)}:{at + 1}: {before[at].strip()}  ->  {after[at].strip()}"


def operators() -> list[str]:
    """Return the names of the operators that are used."""
    wanted = {f"core/{name}" for name in OTHERS}
    wanted |= {f"core/ReplaceComparisonOperator_{a}_{b}" for a, names in COMPARED.items() for b in names}
    wanted |= {f"core/ReplaceBinaryOperator_{a}_{b}" for a, b in COMPUTED.items()}
    return sorted(wanted)


def idle(source: str) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Return from where to where (line, column) a mutant says nothing: annotations, decorators, messages."""
    nodes: list[ast.AST] = []
    for node in ast.walk(ast.parse(source)):
        nodes += getattr(node, "decorator_list", [])
        nodes += filter(None, (getattr(node, "returns", None), getattr(node, "annotation", None)))
        nodes += [node] if isinstance(node, ast.Raise) else []
    return [((n.lineno, n.col_offset), (n.end_lineno, n.end_col_offset)) for n in nodes]  # type: ignore[attr-defined]


def mutants(module: str) -> Iterator[Mutant]:
    """Yield all mutants of a module."""
    source = Mutant(module, "", 0, 0, 0).path.read_text(encoding="utf-8")
    tree, left_out = get_ast(source), idle(source)
    for name in operators():
        operator = get_operator(name)()
        places = (place for node in ast_nodes(tree) for place in operator.mutation_positions(node))
        for occurrence, (start, end) in enumerate(places):
            if not any(first <= start and end <= last for first, last in left_out):
                yield Mutant(module, name, occurrence, *start)


def find_places(mutant: Mutant, executed: Set[Place]) -> Set[Place]:
    """Return executed lines that show a mutant: its own; its statement's; uses of its name; or any."""
    path, text = str(mutant.path), mutant.path.read_text(encoding="utf-8")
    around = [
        node for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.stmt) and node.lineno <= mutant.line <= (node.end_lineno or 0)
    ][-1]  # fmt: skip
    names = {
        node.id for node in ast.walk(around) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
    }
    users = {
        (file, line)
        for file in {file for file, _ in executed}
        for line, used in enumerate(Path(file).read_text(encoding="utf-8").splitlines(), 1)
        if not names.isdisjoint(re.findall(r"\w+", used))
    }
    whole = {(path, line) for line in range(around.lineno, (around.end_lineno or 0) + 1)}
    own = {place for place in executed if place[0] == path}
    choices = ({(path, mutant.line)}, whole, users & own, users, own)
    return next((places & executed for places in choices if places & executed), set())


def sample(every: Sequence[Mutant], count: int) -> list[Mutant]:
    """Return `count` mutants: those whose module, operator and line of text hash smallest."""
    lines = {one.module: one.path.read_text(encoding="utf-8").splitlines() for one in every}
    seen: dict[str, int] = {}

    def key(one: Mutant) -> str:
        text = f"{one.module} {one.operator} {lines[one.module][one.line - 1].strip()}"
        seen[text] = seen.get(text, 0) + 1
        return hashlib.sha256(f"{text} {seen[text]}".encode()).hexdigest()

    return [one for _, one in sorted(((key(one), one) for one in every), key=lambda pair: pair[0])[:count]]
