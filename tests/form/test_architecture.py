"""Rules of the layout: packages and their imports, file sizes, no hosts, no machine's paths."""

import ast
import functools
import re
import sys
import tomllib
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

from tests.other_process import carry_out
from tests.scene_files import command, read_text

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "addon" / "digiclay"
CORE = PACKAGE / "core"

#: Packages beside the extension: they import it, and it never imports them.
BESIDE = {path.name: path for path in (ROOT / "benchmarks", *sorted(ROOT.glob("digiclay_*")))}
PACKAGES = pytest.mark.parametrize(
    "package", [PACKAGE, *BESIDE.values()], ids=lambda path: path.name
)
#: The one file of the extension that looks for the others by their names, to hand them the command
#: line.
DOOR = PACKAGE / "commands" / "outside.py"

#: The packages of the core, and which of the packages above its row each imports from.
ROOMS = {
    "base": "",
    "files": "base",
    "model": "base",
    "steppers": "base model",
    "engine": "base model",
    "surface": "base model",
    "mesh_io": "base files model surface",
    "shapes": "base files model surface mesh_io",
    "control": "base files model shapes",
    "metrics": "base model",
    "scene": "base files model engine shapes control",
    "session": "base files model engine shapes control metrics scene",
    "batch": "base model steppers engine control metrics scene session",
    "studies": "base files model engine mesh_io shapes control metrics scene session batch",
}
#: Packages and top modules of the extension: each row imports from those above it only.
LEVELS = (
    "core ui_text presets",
    "compat plugins roles",
    "bridge",
    "settings",
    "device",
    "preferences strokes",
    "sessions",
    "recorded overlay",
    "live",
    "press exchange",
    "panels",
    "operators",
    "pictures plots farms",
    "front_door",
    "commands",
    "cli",
    "command_line manual_map translations __main__",
    "registration",
    "__init__",
)
#: Blender's own modules, which the core never imports, not even inside a function.
BLENDER = {"bpy", "bmesh", "bpy_extras", "gpu", "mathutils"}
MAX_LINES = 500

# Written with commas, because this file is searched as well.
HOSTS = "pypi,org pythonhosted,org conda,anaconda,org download,blender,org debian,org ubuntu,com"
HOSTS += " npmjs,org docker,io ghcr,io"
MACHINE_PATH = re.compile(
    r"(?<![\w.~/}-])/(?:root|home|Users|work|mnt|tmp|var/tmp|private)/\w|\b[A-Z]:\\+Users\b"
)


def core_modules() -> dict[str, Path]:
    """Return the core's modules by their name below it; a package has its folder's name."""
    modules = {}
    for path in sorted(CORE.rglob("*.py")):
        parts = path.relative_to(CORE).with_suffix("").parts
        modules[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return modules


@functools.cache
def parse(path: Path) -> ast.Module:
    return ast.parse(read_text(path))


@functools.cache
def imports(path: Path, *, inside_functions: bool = True) -> list[tuple[int, str, list[str]]]:
    """Return (line, module, names) of each import in a file; relative ones keep their dots."""
    waiting: list[ast.AST] = [parse(path)]
    found: list[tuple[int, str, list[str]]] = []
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Import):
            found += [(node.lineno, alias.name, []) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [alias.name for alias in node.names]
            found.append((node.lineno, "." * node.level + (node.module or ""), names))
        function = isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda))
        type_checking = isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
        if (inside_functions or not (function or type_checking)) and not isinstance(node, ast.expr):
            waiting.extend(ast.iter_child_nodes(node))
    return found


def package_imports(package: Path) -> dict[str, set[str]]:
    parts = {
        path: path.relative_to(package).with_suffix("").parts for path in package.rglob("*.py")
    }
    names = {".".join(own).removesuffix(".__init__"): path for path, own in parts.items()}
    found: dict[str, set[str]] = {}
    for name, path in names.items():
        found[name] = set()
        for _, target, imported in imports(path):
            dots = len(target) - len(target.lstrip("."))
            if dots:
                base = [
                    *parts[path][: len(parts[path]) - dots],
                    *filter(None, target[dots:].split(".")),
                ]
                known = [".".join([*base, one]) for one in imported]
                found[name] |= {
                    one if one in names else ".".join(base) for one in known
                } & names.keys()
    return found


def tracked(*patterns: str) -> list[Path]:
    git = command("git -c safe.directory=* ls-files -co --exclude-standard -z --")
    found = [ROOT / name for name in carry_out(*git, *patterns, cwd=ROOT).split("\0") if name]
    assert found, f"git lists no file for {patterns}"
    return [path for path in found if path.is_file()]


def lines_with(pattern: re.Pattern[str]) -> list[str]:
    hits = []
    for path in tracked():
        data = path.read_bytes()
        if b"\0" in data:
            continue
        for number, text in enumerate(data.decode("utf-8", errors="replace").splitlines(), 1):
            if pattern.search(text):
                hits.append(f"{path.relative_to(ROOT)}:{number}: {text.strip()[:100]}")
    return hits


def test_every_module_of_the_core_is_in_a_package_of_the_table() -> None:
    assert {name.split(".")[0] for name in core_modules() if name} == {*ROOMS, "version"}
    assert sorted(path.name for path in CORE.glob("*.py")) == ["__init__.py", "version.py"]


def test_a_package_of_the_core_imports_from_those_above_it_that_its_row_names() -> None:
    found: dict[str, set[str]] = {name: set() for name in ROOMS}
    for module, targets in package_imports(CORE).items():
        if module not in ("__init__", "version"):
            found[module.split(".")[0]] |= {target.split(".")[0] for target in targets} - {
                "version"
            }
    above: list[str] = []
    for name, row in ROOMS.items():
        assert found[name] - {name} == set(row.split()), f"core/{name} has another row"
        assert set(row.split()) <= set(above), f"core/{name} imports from below"
        above.append(name)


def test_packages_of_the_extension_import_from_those_above_their_row_of_the_table() -> None:
    level = {name: number for number, row in enumerate(LEVELS) for name in row.split()}
    found = package_imports(PACKAGE)
    assert {module.split(".")[0] for module in found} == set(level)
    pairs = [(module, target) for module, targets in found.items() for target in targets]
    tops = {pair: [name.split(".")[0] for name in pair] for pair in pairs}
    upward = [
        pair for pair, (own, other) in tops.items() if own != other and level[own] <= level[other]
    ]
    assert upward == []


@PACKAGES
def test_no_module_imports_itself_by_way_of_others(package: Path) -> None:
    left = package_imports(package)
    assert left
    while free := {name for name, others in left.items() if not others & left.keys() - {name}}:
        left = {name: others for name, others in left.items() if name not in free}
    assert sorted(left) == []


def find_imports(
    files: Iterable[Path], wrong: Callable[[str], bool], *, inside_functions: bool = True
) -> list[str]:
    return [
        f"{path.relative_to(ROOT)}:{line}: {target}"
        for path in files
        for line, target, _ in imports(path, inside_functions=inside_functions)
        if wrong(target.split(".")[0])
    ]


@PACKAGES
def test_package_imports_itself_relatively_and_every_module_has_a_docstring(package: Path) -> None:
    files = list(package.rglob("*.py"))
    assert find_imports(files, lambda name: name == package.name) == []
    modules = [path for path in files if (path.parent / "__init__.py").exists()]  # presets are data
    assert [str(path) for path in modules if not ast.get_docstring(parse(path))] == []


def test_core_needs_numpy_alone_at_import_and_never_names_blender() -> None:
    allowed = {"", *sys.stdlib_module_names, "numpy"}
    files = core_modules().values()
    assert find_imports(files, lambda name: name not in allowed, inside_functions=False) == []
    assert find_imports(files, BLENDER.__contains__) == []


def test_the_extension_never_imports_what_stands_beside_it() -> None:
    files = [path for path in PACKAGE.rglob("*.py") if path != DOOR]
    assert find_imports(files, BESIDE.__contains__) == []
    installed = BESIDE.keys() - {"benchmarks"}
    texts = {path.name: read_text(path) for path in files}
    assert [
        name for name, text in texts.items() if any(package in text for package in installed)
    ] == []
    assert all(package in read_text(DOOR) for package in installed)


@pytest.mark.parametrize("name", BESIDE)
def test_what_stands_beside_the_extension_imports_no_part_of_its_neighbor(name: str) -> None:
    # benchmarks are in a checkout alone, where the suite's trials and the fit are beside them
    allowed = ["digiclay_study", "digiclay_fit"] if name == "benchmarks" else []
    others = BESIDE.keys() - {name, *allowed}
    assert find_imports(BESIDE[name].rglob("*.py"), others.__contains__) == []


def test_a_constant_of_a_module_is_bound_once() -> None:
    twice = []
    for path in tracked("*.py"):
        assigned = [node for node in parse(path).body if isinstance(node, ast.Assign)]
        targets = [target for node in assigned for target in node.targets]
        names = Counter(target.id for target in targets if isinstance(target, ast.Name))
        twice += [f"{path.relative_to(ROOT)}: {name}" for name, times in names.items() if times > 1]
    assert twice == []


def test_no_python_file_is_over_the_limit() -> None:
    sizes = {path: len(read_text(path).splitlines()) for path in tracked("*.py")}
    assert {
        str(path.relative_to(ROOT)): size for path, size in sizes.items() if size > MAX_LINES
    } == {}


def test_no_package_registry_and_no_path_of_one_machine_is_named() -> None:
    pattern = HOSTS.replace(",", r"\.").replace(" ", "|")
    assert lines_with(re.compile(pattern, re.IGNORECASE)) == []
    assert lines_with(MACHINE_PATH) == []


def test_requirements_are_exact_pins_without_a_place_to_get_them() -> None:
    pin = re.compile(r"#.*|-r [\w.-]+\.txt|[\w.-]+==[\w.]+|")
    files = tracked("requirements/*.txt")
    lines = [(path.name, line) for path in files for line in read_text(path).splitlines()]
    assert [pair for pair in lines if not pin.fullmatch(pair[1])] == []


def test_the_extension_and_the_package_have_one_version() -> None:
    import digiclay

    manifest = tomllib.loads(read_text(PACKAGE / "blender_manifest.toml"))
    assert manifest["version"] == digiclay.__version__
