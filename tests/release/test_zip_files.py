"""The extension's zip of a release: small, and nothing in it that is not needed."""

from __future__ import annotations

import re
import tomllib
import zipfile
from collections import Counter
from pathlib import Path

import pytest

#: Endings of the files that the extension reads, and of texts for people.
KINDS = re.compile(
    r"LICENSE|LICENSES/[\w.-]+\.txt|blender_manifest\.toml|[\w/]+\.py|wheels/[\w.-]+-py3-none-any\.whl"
    r"|sample_shapes/(README\.md|methods/\w+\.txt|\w+/README\.md|batches/\w+\.toml|sessions/\w+\.toml)"
    r"|sample_shapes/shapes/\w+\.(png|stl|obj|ply|npy)"
    r"|presets/[\w/]+\.toml|press/\w+\.dat|farms/\w+\.js|manual/\w+\.html|translations/\w+\.toml"
)


@pytest.fixture(scope="module")
def contents(extension_zip: Path) -> dict[str, bytes]:
    """The files of the zip by name."""
    with zipfile.ZipFile(extension_zip) as archive:
        return {name: archive.read(name) for name in archive.namelist() if not name.endswith("/")}


def test_the_zip_is_small(extension_zip: Path) -> None:
    assert extension_zip.stat().st_size < 2e6


def test_every_file_is_of_a_kind_that_is_needed(contents: dict[str, bytes]) -> None:
    assert len(contents) > 200
    assert [name for name in contents if not KINDS.fullmatch(name)] == []


def test_no_file_is_there_twice(contents: dict[str, bytes]) -> None:
    counts = Counter(content for content in contents.values() if content)
    assert [name for name, content in contents.items() if counts[content] > 1] == []


def test_what_the_manifest_leaves_out_is_not_there(contents: dict[str, bytes]) -> None:
    manifest = tomllib.loads(contents["blender_manifest.toml"].decode())
    named = [name[1:] for name in manifest["build"]["paths_exclude_pattern"] if name.startswith("/commands")]
    assert named
    assert set(named) & set(contents) == set()


def test_the_bundled_wheels_are_those_of_the_manifest_with_their_license(
    contents: dict[str, bytes], extension_zip: Path, tmp_path: Path
) -> None:
    manifest = tomllib.loads(contents["blender_manifest.toml"].decode())
    wheels = sorted(f"./{name}" for name in contents if name.startswith("wheels/"))
    assert wheels == sorted(manifest["wheels"])
    for name in wheels:
        (tmp_path / "one.whl").write_bytes(contents[name[2:]])
        with zipfile.ZipFile(tmp_path / "one.whl") as wheel:
            texts = [wheel.read(file).decode() for file in wheel.namelist() if "LICENSE" in file]
            assert [text for text in texts if "MIT" in text and "Michael Dawson-Haggerty" in text]
            assert not any(file.endswith((".so", ".pyd", ".dll")) for file in wheel.namelist())
    assert "SPDX:MIT" in manifest["license"]


def test_no_file_is_byte_code_or_starts_with_a_point(contents: dict[str, bytes]) -> None:
    assert [name for name in contents if name.endswith(".pyc") or re.search(r"(^|/)\.", name)] == []
