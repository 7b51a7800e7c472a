"""Folders and files: safe names, locks from the start of a run, complete under their names or absent."""

import hashlib
import json
import os
import re
import shutil
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from pathlib import Path
from typing import BinaryIO, NamedTuple

from ..base.errors import VALUE, OutputError, SceneError, explain_os_error, one_line
from ..base.quantity import find_nearest_name
from .file_lock import find_host, hold_lock, may_have_made
from .tables import Record

#: Most bytes of a name in UTF-8; file systems permit 255, of which unfinished files need some.
LONGEST = 120
#: Names of devices in Windows, with any extension.
DEVICES = r"(?i)(con|prn|aux|nul|com[0-9¹²³]|lpt[0-9¹²³]|conin\$|conout\$)"


def make_safe_name(text: str) -> str:
    """Return a text as a folder's name: short, of letters, digits and ``. _ + -``, no device of Windows."""
    name = re.sub(r"[^\w.+-]", "_", unicodedata.normalize("NFC", text))
    name = name.lstrip(".-").rstrip(".") or "scene"
    if re.fullmatch(DEVICES, name.partition(".")[0]):
        name = f"_{name}"
    encoded = name.encode(errors="replace")
    if len(encoded) <= LONGEST:
        return name
    beginning = encoded[: LONGEST - 9].decode(errors="ignore")
    return f"{beginning}-{hashlib.sha256(encoded).hexdigest()[:8]}"


def find_name(path: Path, general: str = "scene.toml") -> str:
    """Return the name of a file's content: its stem, or its folder's name if the file's is `general`."""
    full = Path(os.path.abspath(path))
    name = full.parent.name if full.name == general else full.stem
    return name if name.strip(". ") else "scene"


def fold_name(name: str) -> str:
    """Return a form that is equal for names that some file systems do not distinguish: ``a`` and ``A``."""
    return unicodedata.normalize("NFC", unicodedata.normalize("NFC", name).casefold())


def make_unique_names(texts: Sequence[str]) -> list[str]:
    """Return safe names of texts, in their order; the later ones of equal names get numbers."""
    names = [make_safe_name(text) for text in texts]
    taken = {fold_name(name) for name in names}
    given: set[str] = set()
    for index, name in enumerate(names):
        number, chosen = 1, name
        while fold_name(chosen) in given or (number > 1 and fold_name(chosen) in taken):
            number += 1
            chosen = make_safe_name(f"{name[:LONGEST]}-{number}")
        names[index] = chosen
        given.add(fold_name(chosen))
    return names


#: ``.NAME.PID@HOST.KIND``: the new NAME, the former NAME, frames of a film. Older versions name no
#: host.
UNFINISHED = r"\.(?P<name>.+)\.(?P<pid>\d{1,10})(?:@(?P<host>[\w-]+))?\.(?P<kind>part|old|frames)"


def name_unfinished(target: Path, kind: str = "part") -> Path:
    """Return the name under which this process prepares a file or folder, beside it; see `UNFINISHED`."""
    return target.with_name(f".{target.name}.{os.getpid()}@{find_host()}.{kind}")


def is_unfinished(path: Path) -> bool:
    """Return whether a name is that of an unfinished file or folder."""
    return re.fullmatch(UNFINISHED, path.name) is not None


def remove_abandoned(folder: Path, name: str = "") -> None:
    """Remove unfinished files and folders of ended processes of this machine, of a name or of any."""
    try:
        paths = sorted(folder.iterdir())
    except OSError:
        return
    for path in paths:
        match = re.fullmatch(UNFINISHED, path.name)
        if match is None or (name and match["name"] != name):
            continue
        # Whether processes of other machines still run, on a shared drive, cannot be known here.
        if match["host"] not in (None, find_host()):
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
    """Write a file completely or not at all, under a temporary name first; OutputError on failure."""
    with open_whole(path) as file:
        file.write(content)


@contextmanager
def open_whole(path: Path) -> Iterator[BinaryIO]:
    """Open a file that becomes `path` if the block ends without error; OutputError on failure."""
    part = name_unfinished(path)
    try:
        with part.open("wb") as file:
            yield file
        part.replace(path)
    except BaseException as error:
        with suppress(OSError):  # the first error is the one to report
            part.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise OutputError(f"Cannot write {path}: {error.strerror or error}.") from error
        raise


def read_json(path: Path) -> Record | None:
    """Return the table in a small JSON file; None if it cannot be read."""
    try:
        content = json.loads(path.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError):
        return None
    return content if isinstance(content, dict) else None


def format_json(value: object) -> bytes:
    """Return a value as JSON with a final line feed."""
    return (json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode()


#: The file that identifies a run's folder.
MARK = "metrics.json"


class Content(NamedTuple):
    """Replaceable content of a folder: its name, and patterns of files that identify it."""

    name: str
    marks: tuple[str, ...]

    def find(self, folder: Path) -> list[Path]:
        """Return the files that identify it in a folder, or none."""
        return [path for mark in self.marks for path in folder.glob(mark) if path.is_file()]


RUN = Content("run", (MARK,))


#: Patterns of what commands write into a run's folder.
WRITTEN = (
    "*.toml", "*.npz", "*.json", "*.py", "*.csv", "study.md", "*.html", "*.png", "*.jpg", "*.svg", "*.mp4",
    "*.stl", "*.obj", "*.ply", "*.glb", "*.3mf", "*.usd", "*.usda", "*.abc", "displayed", "frames-*",
    ".*.lock", ".*.part", ".*.old", ".*.frames",
)  # fmt: skip


def find_others(folder: Path) -> list[Path]:
    """Return the files and folders in a run's folder that no command has written: notes, a .blend."""
    return [path for path in folder.iterdir() if not any(map(path.match, WRITTEN))]


def check_folder(out: Path, *, overwrite: bool, content: Content = RUN) -> None:
    """Refuse an output folder that is neither empty nor, with `overwrite`, of the given content."""
    with explain_os_error(f"{out} cannot be read"):
        filled = out.exists() and (not out.is_dir() or any(out.iterdir()))
    if filled and not out.is_dir():
        raise OutputError(f"{out} is a file: choose another folder with --out.")
    if filled and not content.find(out):
        what = f"contains something other than a {content.name}"
        raise OutputError(f"{out} {what}: choose another folder with --out.")
    if filled and not overwrite:
        other = f"replace the {content.name} in it with --overwrite (in Python overwrite=True)"
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
    target = path.resolve()
    if folder.resolve() not in target.parents:
        raise OutputError(f"{path} leads out of {folder}, to {target}: nothing is written there.")
    return path


def make_folder(path: Path) -> Path:
    """Make a folder and those above it, if they do not exist; OutputError on failure."""
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
    """Return the error for a path that another process has locked; `how`: its use, *being written*."""
    return f"{path} is {how} by another digiclay: choose another place with --out, or wait."


def _copy(path: Path, to: Path) -> None:
    """Copy a file, a folder or a link."""
    if path.is_dir() and not path.is_symlink():
        shutil.copytree(path, to, symlinks=True)
    else:
        shutil.copy2(path, to, follow_symlinks=False)


class Claim(NamedTuple):
    """Lock of a folder for writing, for the block of `claim_folder`."""

    out: Path
    overwrite: bool

    @contextmanager
    def write(self) -> Iterator[Path]:
        """Yield a folder to write into; it becomes `out` at the end, unless there was an error.

        What no command has written into `out` stays there.
        """
        target = self.out.resolve()
        staged, former = name_unfinished(target), name_unfinished(target, "old")
        try:
            staged.mkdir(parents=True)
            yield staged
            check_folder(self.out, overwrite=self.overwrite)
            if target.exists():
                for other in find_others(target):
                    if not (staged / other.name).exists():
                        _copy(other, staged / other.name)
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
    """Lock a folder before any work, or refuse it: no other process may write it until the block ends."""
    check_folder(out, overwrite=overwrite, content=content)
    target = out.resolve()
    with ExitStack() as until_the_end:
        until_the_end.enter_context(remove_if_empty(target))
        with explain_os_error(f"{out} cannot be made"):
            until_the_end.enter_context(lock_name(out, patience))
        remove_abandoned(target.parent, target.name)
        # Another process may just have ended.
        check_folder(out, overwrite=overwrite, content=content)
        yield Claim(out, overwrite)


@contextmanager
def remove_if_empty(target: Path) -> Iterator[None]:
    """Remove at the end the folders above a path that did not exist before, if they are empty."""
    new = [folder for folder in target.parents if not folder.exists()]
    try:
        yield
    finally:
        for folder in new:
            with suppress(OSError):  # missing, or not empty
                folder.rmdir()


@contextmanager
def claim_files(files: Sequence[Path], patience: float = 0.0) -> Iterator[None]:
    """Lock files in existing folders, such as a run's, waiting `patience` s; OutputError on failure."""
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
            raise OutputError(
                f"{folder} cannot be written to: {error.strerror or error}."
            ) from None
        yield


@contextmanager
def write_folder(out: Path, *, overwrite: bool) -> Iterator[Path]:
    """Claim a folder and yield one to write into, which becomes it: see `claim_folder` and `Claim.write`."""
    with claim_folder(out, overwrite=overwrite) as claim, claim.write() as folder:
        yield folder


def list_files(folder: Path, *kinds: str) -> dict[str, Path]:
    """Return the files of a folder, if there is one, with the extensions `kinds`, by their stems."""
    return {path.stem: path for path in sorted(folder.glob("*")) if path.suffix in kinds}


def find_file(word: str, samples: Mapping[str, Path], kind: str) -> Path:
    """Return the file of a sample's name or a path; SceneError if there is no such file or sample."""
    if word in samples:
        return samples[word]
    if os.path.isfile(word):  # unlike Path.is_file it accepts any text, however odd or long
        return Path(word)
    shown = one_line(word, VALUE)
    if os.path.isdir(word):
        raise SceneError(f"{shown} is a folder, not a file.")
    if Path(word).suffix or Path(word).name != word:
        raise SceneError(f"{shown}: there is no such file.")
    close = find_nearest_name(word, list(samples))
    hint = f". Did you mean {close}?" if close else f" ({', '.join(samples)})."
    raise SceneError(f"{shown or repr(word)} is neither a file nor a {kind}{hint}")
