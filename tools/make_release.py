"""A release: conditions, two builds that must be equal, the files with checksums and notes, the tag.

usage: python tools/make_release.py VERSION

Leaves dist/digiclay-VERSION with the extension's zip, the wheel, the source archive, SHA256SUMS and
release-notes.md, and the tag vVERSION of the current commit. A failure at any point leaves neither.
"""

import argparse
import gzip
import hashlib
import io
import os
import shutil
import signal
import subprocess
import sys
import tarfile
import tempfile
import time
import zipfile
from contextlib import suppress
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "tools")]

import extension  # noqa: E402
from release_rules import find_obstacles, git, read_notes, tag_of  # noqa: E402

LIMIT = 300
#: Time between two looks whether a signal has come, s.
LOOK = 0.05
#: Largest zip, bytes.
LARGEST = 2_000_000
#: Differences between the two builds: modes and time of the sources, language, time zone, order of
#: sets.
BUILDS = (
    ("first", 0o022, 1e9, {"LC_ALL": "C", "TZ": "UTC", "PYTHONHASHSEED": "1"}),
    (
        "the second build",
        0o077,
        1.6e9,
        {"LC_ALL": "C.UTF-8", "TZ": "NPT-5:45", "PYTHONHASHSEED": "2"},
    ),
)
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
#: Signals that have come. A handler that raised would be lost where Python ignores errors, as in
#: `__del__`.
SIGNALED: list[int] = []


class ReleaseError(Exception):
    """Reason, in one line, why there is no release."""


def refuse_stopped() -> None:
    """Raise ReleaseError when a signal has come."""
    if SIGNALED:
        raise ReleaseError(f"stopped by {signal.Signals(SIGNALED[0]).name}.")


def carry_out(
    command: list[str | Path], folder: Path, added: dict[str, str], umask: int = 0o022
) -> None:
    """Run a command in a folder, with an addition to the environment; end all that it has started."""
    refuse_stopped()
    name = " ".join(map(str, command[1:4]))
    with tempfile.TemporaryFile() as output:
        process = subprocess.Popen(
            command,
            cwd=folder,
            env=os.environ | added,
            umask=umask,
            start_new_session=True,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
        )
        try:
            status, started = None, time.monotonic()
            while status is None:
                with suppress(subprocess.TimeoutExpired):
                    status = process.wait(LOOK)
                refuse_stopped()
                if status is None and time.monotonic() - started > LIMIT:
                    raise ReleaseError(f"'{name}' takes more than {LIMIT} s.")
        finally:
            # Also when the release is stopped: nothing goes on writing into a folder that is being
            # removed.
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
            raise ReleaseError(f"'{name}' failed with status {status}.")


def repack_tar(archive: Path, instant: int) -> None:
    """Write a .tar.gz again in a fixed form: order, modes, owner and one time, s since 1970 UTC."""
    packed = io.BytesIO()
    with (
        tarfile.open(archive) as old,
        tarfile.open(fileobj=packed, mode="w", format=tarfile.PAX_FORMAT) as new,
    ):
        for member in sorted(old.getmembers(), key=lambda member: member.name):
            entry = tarfile.TarInfo(member.name)
            entry.type, entry.size, entry.mtime = member.type, member.size, instant
            entry.mode = 0o755 if member.isdir() or member.mode & 0o100 else 0o644
            new.addfile(entry, old.extractfile(member) if member.isfile() else None)
    # Without name and time of the tar: gzip would write both into its header.
    with archive.open("wb") as file, gzip.GzipFile("", "wb", 9, file, mtime=instant) as compressed:
        compressed.write(packed.getvalue())


def build(source: Path, out: Path, instant: int, added: dict[str, str], umask: int) -> None:
    """Build zip, wheel and source archive of a checkout; `instant`: time of their files, s since 1970."""
    added = {**added, "SOURCE_DATE_EPOCH": str(instant), "PYTHONPATH": ""}
    carry_out([sys.executable, source / "tools/extension.py", "--out", out], source, added, umask)
    words = ["-m", "build", "--no-isolation", "--outdir", out, "."]
    carry_out([sys.executable, *words], source, added, umask)
    for wheel in out.glob("*.whl"):
        extension.repack_zip(wheel, instant)
    for archive in out.glob("*.tar.gz"):
        repack_tar(archive, instant)


def build_twice(scratch: Path, commit: str, instant: int) -> Path:
    """Build a commit twice under different circumstances, compare the files; return their folder."""
    folders = []
    extension.wheels()  # fetched once
    for name, umask, touched, added in BUILDS:
        source, out = scratch / name, scratch / f"files of {name}"
        clone = ["clone", "-q", "--no-tags", "--no-checkout", "--shared"]
        carry_out([*extension.GIT, *clone, ROOT, source], scratch, {}, umask)
        carry_out(["git", "checkout", "-q", "--detach", commit], source, {}, umask)
        for path in source.rglob("*"):
            if ".git" not in path.parts:
                os.utime(path, (touched, touched))
        shutil.copytree(extension.FETCHED, source / extension.FETCHED.relative_to(ROOT))
        build(source, out, instant, added, umask)
        folders.append(out)
    first, second = ({path.name: path.read_bytes() for path in out.iterdir()} for out in folders)
    differing = sorted(
        name for name in first.keys() | second.keys() if first.get(name) != second.get(name)
    )
    if differing:
        raise ReleaseError(f"two builds of the same commit differ in {', '.join(differing)}.")
    return folders[0]


def check_files(folder: Path, version: str) -> None:
    """Check names, versions and size of the three files, and how a package index would show them."""
    wheel, source = f"digiclay-{version}-py3-none-any.whl", f"digiclay-{version}.tar.gz"
    wanted = {f"digiclay-{version}.zip", wheel, source}
    names = {path.name for path in folder.iterdir()}
    if names != wanted:
        raise ReleaseError(f"the files are {sorted(names)}, and {sorted(wanted)} was to be built.")
    size = (folder / f"digiclay-{version}.zip").stat().st_size
    if size > LARGEST:
        raise ReleaseError(
            f"the zip has {size / 1e6:.2f} MB, and {LARGEST / 1e6:g} MB is the most."
        )
    with zipfile.ZipFile(folder / wheel) as archive:
        metadata = archive.read(f"digiclay-{version}.dist-info/METADATA").decode()
    with tarfile.open(folder / source) as archive:
        inner = archive.extractfile(f"digiclay-{version}/PKG-INFO")
        metadata_too = inner.read().decode() if inner else ""
    if any(f"\nVersion: {version}\n" not in text for text in (metadata, metadata_too)):
        raise ReleaseError(f"wheel or source archive have another version than {version}.")
    twine = [sys.executable, "-m", "twine", "check", "--strict"]
    carry_out([*twine, folder / wheel, folder / source], folder, {})


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


def publish(built: Path, folder: Path, version: str, commit: str) -> None:
    """Move the files to their folder and tag the commit, both or neither."""
    for number in SIGNALS:  # it takes an instant, and is not to be stopped between the two
        signal.signal(number, signal.SIG_IGN)
    refuse_stopped()
    folder.parent.mkdir(exist_ok=True)
    built.rename(folder)
    notes = str(folder / "release-notes.md")
    done = git(
        ROOT, "tag", "--annotate", "--cleanup=verbatim", "--file", notes, tag_of(version), commit
    )
    if done.returncode:
        shutil.rmtree(folder)
        raise ReleaseError(f"the tag {tag_of(version)} cannot be made: {done.stderr.strip()}")


def _head() -> str:
    return git(ROOT, "rev-parse", "HEAD").stdout.strip()


def release(version: str) -> Path:
    """Make a release of the current commit, or leave neither tag nor folder; return the folder."""
    folder = ROOT / "dist" / f"digiclay-{version}"
    obstacles = find_obstacles(ROOT, version, folder)
    if obstacles:
        raise ReleaseError("\n".join(obstacles))
    commit = _head()
    instant = int(git(ROOT, "log", "-1", "--format=%ct").stdout)
    scratch = ROOT / "build"
    scratch.mkdir(exist_ok=True)
    print(f"building {version} of commit {commit[:7]} twice ...", flush=True)
    with tempfile.TemporaryDirectory(
        prefix="release-", dir=scratch, ignore_cleanup_errors=True
    ) as temporary:
        built = build_twice(Path(temporary), commit, instant)
        check_files(built, version)
        write_texts(built, version)
        if _head() != commit or git(ROOT, "status", "--porcelain").stdout:
            raise ReleaseError("the checkout was changed during the build.")
        publish(built, folder, version, commit)
    return folder


def main() -> None:
    """Make the release that the command line names."""
    parser = argparse.ArgumentParser(description="Check, build twice, and tag a release.")
    parser.add_argument("version", help="such as 0.1.0")
    version = parser.parse_args().version
    for number in SIGNALS:
        signal.signal(number, lambda number, _: SIGNALED.append(number))
    try:
        folder = release(version)
    except (ReleaseError, OSError) as error:
        sys.exit("\n".join(f"Nothing is released: {line}" for line in str(error).splitlines()))
    print((folder / "SHA256SUMS").read_text(encoding="utf-8"), end="")
    print(
        f"released: {folder.relative_to(ROOT)}, tag {tag_of(version)}; what remains is in docs/release.md"
    )


if __name__ == "__main__":
    main()
