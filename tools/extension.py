"""Build the extension's zip with Blender's own tool, and have that tool validate it, tags included.

usage: python tools/extension.py [--out FOLDER]

The Python must have Blender's module, which brings the tool along, and pip. The folder
addon/digiclay is copied as git knows it; the wheels of requirements/extension.txt are fetched once,
put beside it and listed in the copy's manifest. The zip stands in the folder only when it is valid.
Its bytes depend on the files alone, and on the time in SOURCE_DATE_EPOCH or else of the last
commit.
"""

import argparse
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import zipfile
from pathlib import Path
from typing import NoReturn

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "addon" / "digiclay"
PINS = ROOT / "requirements" / "extension.txt"
#: Wheels fetched before, for all builds to come.
FETCHED = ROOT / "build" / "wheels"
TOOL = "addons_core/bl_pkg/cli/blender_ext.py"
TAGS = "modules/_bpy_internal/extensions/tags.py"
LIMIT = 300
#: The times that a zip can state, from 1980 to 2107, s since 1970.
EARLIEST, LATEST = 315532800, 4354819200
#: Kind and mode of Unix of a file and a folder in a zip, and the mark of a folder.
ZIPPED_FILE, ZIPPED_FOLDER = 0o100644 << 16, 0o040755 << 16 | 0x10
#: Git, also in a checkout of another user.
GIT = ("git", "-c", "safe.directory=*")


def stop(reason: str) -> NoReturn:
    """End with the reason, in one line, why there is no zip."""
    sys.exit(f"The extension is not built: {reason}")


def carry_out(command: list[str | Path], what: str) -> str:
    """Run a command; return what it printed, or stop with the last of it."""
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT, cwd=ROOT)
    output = f"{done.stdout}\n{done.stderr}".strip()
    if done.returncode:
        print(output, file=sys.stderr)
        stop(f"{what} failed with status {done.returncode}.")
    return output


def blender_scripts() -> Path:
    """Return the folder of scripts of this Python's Blender module."""
    spec = importlib.util.find_spec("bpy")
    places = [Path(folder) for folder in (spec.submodule_search_locations or [])] if spec else []
    scripts = [tool.parents[3] for folder in places for tool in folder.glob(f"*/scripts/{TOOL}")]
    if not scripts:
        stop(f"{sys.executable} has no Blender module with its tool {TOOL}.")
    return scripts[0]


def wheels() -> list[Path]:
    """Return the wheels of the pins; what is not there yet is fetched."""
    pins = re.findall(r"^([\w.-]+)==([\w.]+)$", PINS.read_text(encoding="utf-8"), re.MULTILINE)
    names = {f"{name.replace('-', '_')}-{version}-py3-none-any.whl" for name, version in pins}
    FETCHED.mkdir(parents=True, exist_ok=True)
    if any(not (FETCHED / name).is_file() for name in names):
        with tempfile.TemporaryDirectory(dir=FETCHED.parent) as folder:
            pip = "-m pip --disable-pip-version-check download --quiet --retries 5 --no-deps"
            what = ["--only-binary=:all:", "--dest", folder, "-r", PINS]
            carry_out([sys.executable, *pip.split(), *what], "Fetching the wheels")
            for wheel in Path(folder).glob("*.whl"):
                wheel.replace(FETCHED / wheel.name)
    missing = sorted(name for name in names if not (FETCHED / name).is_file())
    if missing:
        stop(f"{missing[0]} cannot be had: only wheels for every platform can be bundled.")
    return sorted(FETCHED / name for name in names)


def stage(folder: Path) -> None:
    """Copy the package as git knows it, with the wheels and a manifest that lists them."""
    git = [*GIT, "ls-files", "-co", "--exclude-standard", "-z", "--", SOURCE]
    for name in filter(None, carry_out(git, "Listing the files").split("\0")):
        file = ROOT / name.strip()
        if file.is_file():
            copy = folder / file.relative_to(SOURCE)
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, copy)
    shutil.copyfile(ROOT / "LICENSE", folder / "LICENSE")
    shutil.copytree(ROOT / "LICENSES", folder / "LICENSES")
    bundled = folder / "wheels"
    bundled.mkdir()
    for wheel in wheels():
        shutil.copyfile(wheel, bundled / wheel.name)
    manifest = folder / "blender_manifest.toml"
    words = manifest.read_text(encoding="utf-8")
    listed = ", ".join(f'"./wheels/{wheel.name}"' for wheel in wheels())
    # A key of the whole manifest: it must stand before the first table.
    before, table, after = words.partition("\n[")
    manifest.write_text(f"{before}\nwheels = [{listed}]\n{table}{after}", encoding="utf-8")


def read_instant() -> int:
    """Return the time that the files of the zip have, s since 1970 UTC."""
    named = os.environ.get("SOURCE_DATE_EPOCH", "")
    if named and not (named.isdecimal() and int(named) < LATEST):
        stop(
            f"SOURCE_DATE_EPOCH must be a number of seconds from 1970 to 2107 (got {named[:40]!r})."
        )
    if named:
        return int(named)
    done = subprocess.run(
        [*GIT, "log", "-1", "--format=%ct"], capture_output=True, text=True, timeout=LIMIT, cwd=ROOT
    )
    # Without a commit there is no time of one.
    return int(done.stdout) if done.returncode == 0 and done.stdout.strip() else EARLIEST


def repack_zip(archive: Path, instant: int) -> None:
    """Write a zip or a wheel again in a fixed form: order, modes and one time, s since 1970 UTC."""
    when = time.gmtime(max(instant, EARLIEST))[:6]
    packed = archive.with_name(f"{archive.name}.new")
    with zipfile.ZipFile(archive) as old, zipfile.ZipFile(packed, "w") as new:
        # The metadata of a wheel stand last, as its specification recommends.
        for part in sorted(
            old.infolist(), key=lambda part: (".dist-info/" in part.filename, part.filename)
        ):
            entry = zipfile.ZipInfo(part.filename, when)
            entry.compress_type = part.compress_type
            entry.create_system = 3  # Unix, wherever it is built: the modes are Unix's
            entry.external_attr = ZIPPED_FOLDER if part.is_dir() else ZIPPED_FILE
            new.writestr(entry, old.read(part), compresslevel=9)
    packed.replace(archive)


def build(out: Path) -> Path:
    """Build the zip, validate it, and put it into a folder; return where it is."""
    scripts = blender_scripts()
    tool: list[str | Path] = [sys.executable, scripts / TOOL]
    tags = ["--valid-tags", scripts / TAGS]
    (ROOT / "build").mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory(dir=ROOT / "build") as scratch:
        staged, built = Path(scratch) / "digiclay", Path(scratch) / "made"
        staged.mkdir()
        built.mkdir()
        stage(staged)
        carry_out(
            [*tool, "build", "--source-dir", staged, "--output-dir", built, *tags],
            "Blender's tool for building",
        )
        (archive,) = built.glob("*.zip")
        repack_zip(archive, read_instant())
        output = carry_out([*tool, "validate", *tags, archive], "Blender's tool for validating")
        if re.search(r"\b(warning|error)\b", output, re.IGNORECASE):
            stop(f"Blender's tool does not find it valid: {output}")
        out.mkdir(parents=True, exist_ok=True)
        return Path(shutil.move(archive, out / archive.name))


def main() -> None:
    """Build what the arguments ask for."""
    parser = argparse.ArgumentParser(description="Build and validate the extension's zip.")
    parser.add_argument(
        "--out", type=Path, default=ROOT / "dist", help="folder of the zip, default dist"
    )
    archive = build(parser.parse_args().out.resolve())
    print(f"{archive} ({archive.stat().st_size / 1e6:.1f} MB), valid, tags included")


if __name__ == "__main__":
    main()
