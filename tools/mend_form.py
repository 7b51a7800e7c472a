"""Form of the repository: mend what can be mended, then judge the rest by `tests/form`; see `make form`.

usage: python tools/mend_form.py [--check]     --check: what had to be mended is a failure.
"""

import ast
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PYTHON = [sys.executable, "-m"]
#: Programs that mend, in this order.
MENDERS = (
    [*PYTHON, "ruff", "check", "--quiet", "--fix", "."],
    [*PYTHON, "ruff", "format", "--quiet", "."],
    [sys.executable, "tools/manual.py"],
)
#: Function shown on a page: file and name in a comment, before the block of code.
SHOWN = re.compile(r"(<!-- ([\w/]+\.py): (\w+) -->\n\n```python\n)(.*?)(```\n)", re.DOTALL)


def show_functions(text: str) -> str:
    """Return a page with the functions that it shows as they stand in the source, without decorators."""

    def source(match: re.Match[str]) -> str:
        code = (ROOT / match[2]).read_text(encoding="utf-8")
        (node,) = (
            n for n in ast.parse(code).body if isinstance(n, ast.FunctionDef) and n.name == match[3]
        )
        return f"{match[1]}{ast.get_source_segment(code, node)}\n{match[5]}"

    return SHOWN.sub(source, text)


def list_changes() -> dict[str, int]:
    """Return the files that differ from the last commit, each with the hash of its content."""
    listed = subprocess.run(
        ["git", "-c", "safe.directory=*", "ls-files", "-mo", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    paths = {name: ROOT / name for name in listed.stdout.splitlines()}
    return {name: hash(path.read_bytes()) for name, path in paths.items() if path.is_file()}


def main() -> int:
    """Mend, then judge."""
    before = list_changes()
    status = max(subprocess.run(command, cwd=ROOT).returncode for command in MENDERS)
    for page in (ROOT / "docs").rglob("*.md"):
        text = page.read_text(encoding="utf-8")
        if show_functions(text) != text:
            page.write_text(show_functions(text), encoding="utf-8")
    mended = [name for name, content in list_changes().items() if before.get(name) != content]
    if mended:
        print(f"mended: {', '.join(mended)}. Commit what has changed.", flush=True)
    status |= bool(mended) and "--check" in sys.argv
    return status | subprocess.run([*PYTHON, "mypy"], cwd=ROOT).returncode


if __name__ == "__main__":
    sys.exit(main())
