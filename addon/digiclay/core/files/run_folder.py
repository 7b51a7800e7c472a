"""Folders and files: safe names, locked at the start of a run, complete under their name or absent."""

import hashlib
import json
import os
import re
import shutil
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from ..base.errors import VALUE, OutputError, SceneError, explain_os_error, one_line
from ..base.quantity import find_nearest_name
from .file_lock import find_host, hold_lock, may_have_made

#: Bytes of a name in UTF-8; file systems take 255, of which what is unfinished needs some.
LONGEST = 120
#: Names that stand for devices in Windows, whatever follows behind a full stop.
DEVICES = r"(?i)(con|prn|aux|nul|com[0-9¹²³]|lpt[0-9¹²³]|conin\$|conout\$)"


def make_safe_name(text: str) -> str:
    """Return a text as a folder's name: short, of letters, digits and ``. _ + -``, no device of Windows."""
    name = re.sub(r"[^\w.+-]", "_", unicodedata.normalize("NFC", text))
    name = name.lstrip(".-").rstrip(".") or "scene"
    if re.fullmatch(DEVICES, name.partition(".")[0]):
        name = f"_{name}"
    if len(name.encode(errors="replace")) <= LONGEST:
        return name
    digest = hashlib.sha256(name.encode(errors="replace")).hexdigest()[:8]
    kept = name.encode(errors="replace")[: LONGEST - 9].decode(errors="ignore")
    return f"{kept}-{digest}"


def find_name(path: Path, general: str = "scene.toml") -> str:
    """Return the name of a file's content: its stem, or its folder's name where the file's is `general`."""
    full = Path(os.path.abspath(path))
    name = full.parent.name if full.name == general else full.stem
    return name if name.strip(". ") else "scene"


def fold_name(name: str) -> str:
    """Return what names have in common that some file systems take for one: ``a`` and ``A``."""
    return unicodedata.normalize("NFC", unicodedata.normalize("NFC", name).casefold())


def make_unique_names(texts: Sequence[str]) -> list[str]:
    """Return safe names of texts, in their order; where several would be alike, the later get numbers."""
    names = [make_safe_name(text) for text in texts]
    taken = {fold_name(name) for name in names}
    given: set[str] = set()
    for place, name in enumerate(names):
        number, chosen = 1, name
        while fold_name(chosen) in given or (number > 1 and fold_name(chosen) in taken):
            number += 1
            chosen = make_safe_name(f"{name[:LONGEST]}-{number}")
        names[place] = chosen
        given.add(fold_name(chosen))
    return names


#: ``.NAME.PID@HOST.KIND``: what becomes NAME, what NAME was, a film's frames. Older versions name no host.
UNFINISHED = r"\.(?P<name>.+)\.(?P<pid>\d{1,10})(?:@(?P<host>[\w-]+))?\.(?P<kind>part|old|frames)"


def name_unfinished(target: Path, kind: str = "part") -> Path:
    """Return the name under which this process prepares a file or folder, beside it; see `UNFINISHED`."""
    return target.with_name(f".{target.name}.{os.getpid()}@{find_host()}.{kind}")


def is_unfinished(path: Path) -> bool:
    """Return whether a name is that of an unfinished file or folder."""
    return re.fullmatch(UNFINISHED, path.name) is not None


def remove_abandoned(folder: Path, name: str = "") -> None:
    """Remove what ended processes of this machine left unfinished of a name, or of any."""
    try:
        paths = sorted(folder.iterdir())
    except OSError:
        return
    for path in paths:
        match = re.fullmatch(UNFINISHED, path.name)
        # Nothing here tells whether other machines are still at what they prepare on a shared drive.
        if match is None or (name and match["name"] != name) or match["host"] not in (None, find_host()):
            continue
        with suppress(OSError):
            if may_have_made(int(match["pid"]), path.lstat().st_mtime):
                continue
            target = path.with_name(match["name"])
            if match["kind"] == "old" and not os.path.lexists(target):
                path.rename(target)
            elif path.is_dir() and not path.is_symlink():
                shutil.rmtree(path, ignore_errors=True)
            else:
                path.unlink()


def write_whole(path: Path, content: bytes) -> None:
    """Write a file whole or not at all, under a temporary name first; OutputError when it cannot be."""
    with open_whole(path) as file:
        file.write(content)


@contextmanager
def open_whole(path: Path) -> Iterator[BinaryIO]:
    """Open a file that becomes `path` when the block ends without error; OutputError if it cannot be made."""
    part = name_unfinished(path)
    try:
        with part.open("wb") as file:
            yield file
        part.replace(path)
    except BaseException as error:
        with suppress(OSError):  # what went wrong first is what the user has to hear
            part.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise OutputError(f"Cannot write {path}: {error.strerror or error}.") from error
        raise


def read_json(path: Path) -> dict[str, Any] | None:
    """Return the content of a small JSON file; None where it cannot be read."""
    try:
        read = json.loads(path.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError):
        return None
    return read if isinstance(read, dict) else None


def format_json(value: object) -> bytes:
    """Return a value as JSON with a line's end."""
    return (json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode()


#: The file by which a folder is known as a run's.
MARK = "metrics.json"


class Content(NamedTuple):
    """What a folder holds that may be replaced: its name, and patterns of files by which it is known."""

    name: str
    marks: tuple[str, ...]

    def find(self, folder: Path) -> list[Path]:
        """Return the files by which it is known; none where a folder holds something else."""
        return [path for mark in self.marks for path in folder.glob(mark) if path.is_file()]


RUN = Content("run", (MARK,))


def check_folder(out: Path, *, overwrite: bool, content: Content = RUN) -> None:
    """Refuse an output folder that is neither empty nor, with `overwrite`, known by its content."""
    with explain_os_error(f"{out} cannot be read"):
        filled = out.exists() and (not out.is_dir() or any(out.iterdir()))
    if filled and not out.is_dir():
        raise OutputError(f"{out} is a file: choose another folder with --out.")
    if filled and not content.find(out):
        what = f"holds other things than a {content.name}"
        raise OutputError(f"{out} {what}: choose another folder with --out.")
    if filled and not overwrite:
        other = f"replace the {content.name} in it with --overwrite"
        raise OutputError(f"{out} is not empty: choose another folder with --out, or {other}.")
    above = out.resolve().parent
    while not above.exists():
        above = above.parent
    as_who_we_act = os.access in os.supports_effective_ids
    if not above.is_dir() or not os.access(above, os.W_OK | os.X_OK, effective_ids=as_who_we_act):
        raise OutputError(f"{out} cannot be made: {above} cannot be written to.")


def resolve_inside(folder: Path, *parts: str) -> Path:
    """Return a path in a folder; OutputError for one that leads out of it, by its name or by a link."""
    path = folder.joinpath(*parts)
    end = path.resolve()
    if folder.resolve() not in end.parents:
        raise OutputError(f"{path} leads out of {folder}, to {end}: nothing is written there.")
    return path


def make_folder(path: Path) -> Path:
    """Make a folder and those above it, where there are none; OutputError if it cannot be made."""
    with explain_os_error(f"{path} cannot be made"):
        path.mkdir(parents=True, exist_ok=True)
    return path


def find_lock(path: Path) -> Path:
    """Return the lock file for making a file or folder of this name."""
    target = path.resolve()
    return target.with_name(f".{target.name}.lock")


def lock_name(path: Path, patience: float = 0.0) -> AbstractContextManager[None]:
    """Hold the lock for making a file or folder of this name; waits `patience` s."""
    return hold_lock(find_lock(path), describe_claim(path, "being written"), patience)


def describe_claim(path: Path, how: str) -> str:
    """Return the error for a path that another process has locked; `how`: what that does, *being written*."""
    return f"{path} is {how} by another digiclay: choose another place with --out, or wait."


class Claim(NamedTuple):
    """Lock of a folder for writing, for the block of `claim_folder`."""

    out: Path
    overwrite: bool

    @contextmanager
    def write(self) -> Iterator[Path]:
        """Give a folder to write into; on leaving without error it becomes `out`, else all is as before."""
        target = self.out.resolve()
        staged, former = name_unfinished(target), name_unfinished(target, "old")
        try:
            staged.mkdir(parents=True)
            yield staged
            check_folder(self.out, overwrite=self.overwrite)
            if target.exists():
                target.rename(former)
            staged.rename(target)
        except OSError as error:
            raise OutputError(f"{self.out} cannot be written: {error.strerror or error}.") from None
        finally:
            if former.exists() and not target.exists():
                former.rename(target)
            shutil.rmtree(former, ignore_errors=True)
            shutil.rmtree(staged, ignore_errors=True)


@contextmanager
def claim_folder(
    out: Path, *, overwrite: bool, patience: float = 0.0, content: Content = RUN
) -> Iterator[Claim]:
    """Claim a folder before any work, or refuse it: no other process may write it until the block ends."""
    check_folder(out, overwrite=overwrite, content=content)
    target = out.resolve()
    with ExitStack() as until_the_end:
        until_the_end.enter_context(remove_if_empty(target))
        with explain_os_error(f"{out} cannot be made"):
            until_the_end.enter_context(lock_name(out, patience))
        remove_abandoned(target.parent, target.name)
        check_folder(out, overwrite=overwrite, content=content)  # another process may just have ended
        yield Claim(out, overwrite)


@contextmanager
def remove_if_empty(target: Path) -> Iterator[None]:
    """Take away in the end those folders above a path that were not there, unless there is something in."""
    made = [folder for folder in target.parents if not folder.exists()]
    try:
        yield
    finally:
        for folder in made:
            with suppress(OSError):  # not made after all, or not empty
                folder.rmdir()


@contextmanager
def claim_files(files: Sequence[Path], patience: float = 0.0) -> Iterator[None]:
    """Claim files in folders that exist, such as a run's, waiting `patience` s; OutputError if taken."""
    with ExitStack() as until_the_end:
        try:
            for folder in dict.fromkeys(file.parent for file in files):
                if folder.exists() and os.access(folder.resolve().parent, os.W_OK):
                    with lock_name(folder, patience):
                        pass
                until_the_end.enter_context(remove_if_empty(folder.resolve() / "file"))
            for file in files:
                until_the_end.enter_context(lock_name(file))
                remove_abandoned(file.parent, file.name)
        except OSError as error:
            folder = files[0].parent
            raise OutputError(f"{folder} cannot be written to: {error.strerror or error}.") from None
        yield


@contextmanager
def write_folder(out: Path, *, overwrite: bool) -> Iterator[Path]:
    """Claim a folder and give one to write into, which becomes it: see `claim_folder` and `Claim.write`."""
    with claim_folder(out, overwrite=overwrite) as claim, claim.write() as folder:
        yield folder


def list_files(folder: Path, *kinds: str) -> dict[str, Path]:
    """Return the files of a folder that end with one of `kinds`, by their stems."""
    return {path.stem: path for path in sorted(folder.iterdir()) if path.suffix in kinds}


def find_file(word: str, samples: Mapping[str, Path], kind: str) -> Path:
    """Return the file of a sample's name or a path; SceneError when there is no such file, or sample."""
    if word in samples:
        return samples[word]
    if os.path.isfile(word):  # unlike Path.is_file it takes any text, however odd or long
        return Path(word)
    shown = one_line(word, VALUE)
    if os.path.isdir(word):
        raise SceneError(f"{shown} is a folder, not a file.")
    if Path(word).suffix or Path(word).name != word:
        raise SceneError(f"{shown}: there is no such file.")
    close = find_nearest_name(word, list(samples))
    asked = f" Did you mean {close}?" if close else ""
    raise SceneError(f"{shown or repr(word)} is neither a file nor a {kind} ({', '.join(samples)}).{asked}")
