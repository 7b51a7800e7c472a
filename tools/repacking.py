"""Archives that are equal byte by byte whenever their contents are: names in order, one time, fixed modes."""

from __future__ import annotations

import gzip
import io
import tarfile
import time
import zipfile
from pathlib import Path

#: The times that a zip can state, from 1980 to 2107, s since 1970.
EARLIEST, LATEST = 315532800, 4354819200
FILE, PROGRAM, FOLDER = 0o644, 0o755, 0o755
#: The same as a zip has them: kind and mode of Unix, and the mark of a folder.
ZIPPED_FILE, ZIPPED_FOLDER = (0o100000 | FILE) << 16, (0o040000 | FOLDER) << 16 | 0x10


def repack_zip(archive: Path, instant: int) -> None:
    """Write a zip or a wheel again, the same files in a fixed form.

    `archive`: replaced when all is written; `instant`: time of every file, s since 1970 UTC, below `LATEST`;
    before 1980 it counts as 1980.
    """
    when = time.gmtime(max(instant, EARLIEST))[:6]
    made = archive.with_name(f"{archive.name}.new")
    with zipfile.ZipFile(archive) as old, zipfile.ZipFile(made, "w") as new:
        # The metadata of a wheel stand last, as its specification recommends.
        for one in sorted(old.infolist(), key=lambda one: (".dist-info/" in one.filename, one.filename)):
            entry = zipfile.ZipInfo(one.filename, when)
            entry.compress_type = one.compress_type
            entry.create_system = 3  # Unix, wherever it is built: the modes are Unix's
            entry.external_attr = ZIPPED_FOLDER if one.is_dir() else ZIPPED_FILE
            new.writestr(entry, old.read(one), compresslevel=9)
    made.replace(archive)


def repack_tar(archive: Path, instant: int) -> None:
    """Write a .tar.gz again, the same files in a fixed form, owned by root.

    `archive`: replaced when all is written; `instant`: time of every file, s since 1970 UTC.
    """
    packed = io.BytesIO()
    with (
        tarfile.open(archive) as old,
        tarfile.open(fileobj=packed, mode="w", format=tarfile.PAX_FORMAT) as new,
    ):
        for one in sorted(old.getmembers(), key=lambda one: one.name):
            entry = tarfile.TarInfo(one.name)
            entry.type, entry.size, entry.mtime = one.type, one.size, instant
            entry.mode = FOLDER if one.isdir() else PROGRAM if one.mode & 0o100 else FILE
            new.addfile(entry, old.extractfile(one) if one.isfile() else None)
    made = archive.with_name(f"{archive.name}.new")
    # Without name and time of the tar: gzip would write both into its header.
    with made.open("wb") as file, gzip.GzipFile("", "wb", 9, file, mtime=instant) as squeezed:
        squeezed.write(packed.getvalue())
    made.replace(archive)
