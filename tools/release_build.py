"""Builds of a release: the extension's zip, the wheel and the source archive, twice and equal."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tarfile
import tempfile
import time
import zipfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "tools")]

import extension  # noqa: E402
from repacking import repack_tar, repack_zip  # noqa: E402

LIMIT = 300
#: Time between two looks whether a signal has come, s.
LOOK = 0.05
#: Largest zip, bytes.
LARGEST = 2_000_000
#: Differences between the two builds: time and mode of the sources, language, time zone, order of sets.
BUILDS = (
    ("first", 0o022, 1e9, {"LC_ALL": "C", "TZ": "UTC", "PYTHONHASHSEED": "1"}),
    ("the second build", 0o077, 1.6e9, {"LC_ALL": "C.UTF-8", "TZ": "NPT-5:45", "PYTHONHASHSEED": "2"}),
)


#: Signals that have come. A handler that raised would be lost where Python ignores errors, as in `__del__`.
SIGNALED: list[int] = []


class ReleaseError(Exception):
    """Reason, in one line, why there is no release."""


def refuse_stopped() -> None:
    """Raise ReleaseError when a signal has come."""
    if SIGNALED:
        raise ReleaseError(f"stopped by {signal.Signals(SIGNALED[0]).name}.")


def carry_out(command: Sequence[str | Path], folder: Path, added: dict[str, str], umask: int) -> None:
    """Run a command and whatever it starts to its end.

    `folder`: where it works; `added`: to the environment; `umask`: modes that new files do not get. Raises
    ReleaseError when it fails; what it printed goes to standard error. When a signal comes.
    """
    refuse_stopped()
    with tempfile.TemporaryFile() as output:
        process = subprocess.Popen(
            command, cwd=folder, env=os.environ | added, umask=umask, start_new_session=True,
            stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT,
        )  # fmt: skip
        try:
            status, started = None, time.monotonic()
            while status is None:
                with suppress(subprocess.TimeoutExpired):
                    status = process.wait(LOOK)
                refuse_stopped()
                if status is None and time.monotonic() - started > LIMIT:
                    raise ReleaseError(f"'{' '.join(map(str, command[1:4]))}' takes more than {LIMIT} s.")
        finally:
            # Also when the release is stopped: nothing goes on writing into a folder that is being removed.
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
                for _ in range(200):  # its own children end an instant later
                    os.killpg(process.pid, 0)
                    time.sleep(LOOK)
            process.wait()
        if status:
            output.seek(0)
            sys.stderr.write(output.read().decode(errors="replace")[-4000:])
            raise ReleaseError(f"'{' '.join(map(str, command[1:4]))}' failed with status {status}.")


def build(source: Path, out: Path, instant: int, added: dict[str, str], umask: int) -> None:
    """Build zip, wheel and source archive of a checkout.

    `source`: the checkout; changed by the build; `out`: folder of the three files; `instant`: time of all
    files in them, s since 1970 UTC; `added`: to the environment; `umask`: of the build.
    """
    added = {**added, "SOURCE_DATE_EPOCH": str(instant), "PYTHONPATH": ""}
    carry_out([sys.executable, source / "tools/extension.py", "--out", out], source, added, umask)
    words = ["-m", "build", "--no-isolation", "--outdir", str(out), "."]
    carry_out([sys.executable, *words], source, added, umask)
    for wheel in out.glob("*.whl"):
        repack_zip(wheel, instant)
    for archive in out.glob("*.tar.gz"):
        repack_tar(archive, instant)


def build_twice(scratch: Path, commit: str, instant: int) -> Path:
    """Build a commit in two folders and under different circumstances; return the first folder of files.

    `scratch`: folder for all of it; `commit`: of this repository; `instant`: time of the commit, s since 1970
    UTC. Raises ReleaseError when a build fails, or the files of the two are not equal byte by byte.
    """
    made = []
    extension.wheels()  # fetched once
    for name, umask, touched, added in BUILDS:
        source, out = scratch / name, scratch / f"files of {name}"
        clone = ["git", "-c", "safe.directory=*", "clone", "-q", "--no-tags", "--no-checkout", "--shared"]
        carry_out([*clone, ROOT, source], scratch, {}, umask)
        carry_out(["git", "checkout", "-q", "--detach", commit], source, {}, umask)
        for path in source.rglob("*"):
            if ".git" not in path.parts:
                os.utime(path, (touched, touched))
        shutil.copytree(extension.FETCHED, source / extension.FETCHED.relative_to(ROOT))
        build(source, out, instant, added, umask)
        made.append(out)
    first, second = ({path.name: path.read_bytes() for path in out.iterdir()} for out in made)
    differing = sorted(name for name in first.keys() | second.keys() if first.get(name) != second.get(name))
    if differing:
        raise ReleaseError(f"two builds of the same commit differ in {', '.join(differing)}.")
    return made[0]


def check_files(folder: Path, version: str) -> None:
    """Check names, versions and size of the files, and how a package index would show them.

    `folder`: of the three files; `version`: that they must have. Raises ReleaseError for the first file that
    is wrong.
    """
    wheel, source = f"digiclay-{version}-py3-none-any.whl", f"digiclay-{version}.tar.gz"
    wanted = {f"digiclay-{version}.zip", wheel, source}
    found = {path.name for path in folder.iterdir()}
    if found != wanted:
        raise ReleaseError(f"the files are {sorted(found)}, and {sorted(wanted)} was to be built.")
    size = (folder / f"digiclay-{version}.zip").stat().st_size
    if size > LARGEST:
        raise ReleaseError(f"the zip has {size / 1e6:.2f} MB, and {LARGEST / 1e6:g} MB is the most.")
    with zipfile.ZipFile(folder / wheel) as archive:
        metadata = archive.read(f"digiclay-{version}.dist-info/METADATA").decode()
    with tarfile.open(folder / source) as archive:
        inner = archive.extractfile(f"digiclay-{version}/PKG-INFO")
        metadata_too = inner.read().decode() if inner else ""
    if any(f"\nVersion: {version}\n" not in text for text in (metadata, metadata_too)):
        raise ReleaseError(f"wheel or source archive have another version than {version}.")
    twine = [sys.executable, "-m", "twine", "check", "--strict", folder / wheel, folder / source]
    carry_out(twine, folder, {}, 0o022)
