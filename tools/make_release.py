"""A release: conditions, two builds that must be equal, the files with checksums and notes, the tag.

usage: python tools/make_release.py VERSION

Leaves dist/digiclay-VERSION with the extension's zip, the wheel, the source archive, SHA256SUMS and
release-notes.md, and the tag vVERSION of the current commit. A failure at any point leaves neither.
"""

from __future__ import annotations

import argparse
import hashlib
import shutil
import signal
import sys
import tempfile
from pathlib import Path
from types import FrameType

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "tools")]

from release_build import (  # noqa: E402
    SIGNALED,
    ReleaseError,
    build_twice,
    check_files,
    refuse_stopped,
)
from release_rules import find_obstacles, git, read_notes, tag_of  # noqa: E402

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def write_texts(folder: Path, version: str) -> None:
    """Write the notes, and the checksums of all files, as `sha256sum --check` reads them."""
    notes = f"# digiclay {version}\n\n{read_notes(ROOT)}\n"
    (folder / "release-notes.md").write_text(notes, encoding="utf-8")
    files = {path.name: path.read_bytes() for path in sorted(folder.iterdir())}
    sums = [f"{hashlib.sha256(content).hexdigest()}  {name}\n" for name, content in files.items()]
    (folder / "SHA256SUMS").write_text("".join(sums), encoding="utf-8")
    folder.chmod(0o755)
    for path in folder.iterdir():
        path.chmod(0o644)


def publish(made: Path, folder: Path, version: str, commit: str) -> None:
    """Put the files in place and tag the commit, both or neither.

    `made`: folder of the files, which is moved; `folder`: where they are to be; `version`, `commit`: of the
    release. Raises ReleaseError when the tag cannot be made, or a signal has come before. Raises OSError when
    the folder cannot be moved.
    """
    for number in SIGNALS:  # it takes an instant, and is not to be stopped between the two
        signal.signal(number, signal.SIG_IGN)
    refuse_stopped()
    folder.parent.mkdir(exist_ok=True)
    made.rename(folder)
    notes = str(folder / "release-notes.md")
    done = git(ROOT, "tag", "--annotate", "--cleanup=verbatim", "--file", notes, tag_of(version), commit)
    if done.returncode:
        shutil.rmtree(folder)
        raise ReleaseError(f"the tag {tag_of(version)} cannot be made: {done.stderr.strip()}")


def _head() -> str:
    return git(ROOT, "rev-parse", "HEAD").stdout.strip()


def release(version: str) -> Path:
    """Make a release of the current commit; return the folder of its files.

    Raises ReleaseError when there is none; then there is neither a tag nor a folder.
    """
    folder = ROOT / "dist" / f"digiclay-{version}"
    obstacles = find_obstacles(ROOT, version, folder)
    if obstacles:
        raise ReleaseError("\n".join(obstacles))
    commit = _head()
    instant = int(git(ROOT, "log", "-1", "--format=%ct").stdout)
    scratch = ROOT / "build"
    scratch.mkdir(exist_ok=True)
    print(f"building {version} of commit {commit[:7]} twice ...", flush=True)
    with tempfile.TemporaryDirectory(prefix="release-", dir=scratch, ignore_cleanup_errors=True) as temporary:
        made = build_twice(Path(temporary), commit, instant)
        check_files(made, version)
        write_texts(made, version)
        if _head() != commit or git(ROOT, "status", "--porcelain").stdout:
            raise ReleaseError("the checkout was changed during the build.")
        publish(made, folder, version, commit)
    return folder


def _note(number: int, frame: FrameType | None) -> None:
    SIGNALED.append(number)


def main() -> None:
    """Make the release that the command line names."""
    parser = argparse.ArgumentParser(description="Check, build twice, and tag a release.")
    parser.add_argument("version", help="such as 0.1.0")
    version = parser.parse_args().version
    for number in SIGNALS:
        signal.signal(number, _note)
    try:
        folder = release(version)
    except (ReleaseError, OSError) as error:
        sys.exit("\n".join(f"Nothing is released: {line}" for line in str(error).splitlines()))
    print((folder / "SHA256SUMS").read_text(encoding="utf-8"), end="")
    print(f"released: {folder.relative_to(ROOT)}, tag {tag_of(version)}; what remains is in docs/release.md")


if __name__ == "__main__":
    main()
