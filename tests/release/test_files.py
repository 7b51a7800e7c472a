"""Files of a release: the zip is small and has nothing that is not needed; the wheel has no benchmark."""

import os
import re
import subprocess
import sys
import tomllib
import zipfile
from collections import Counter
from pathlib import Path

import pytest

from tests.timeouts import TIMEOUT

ROOT = Path(__file__).parents[2]
BESIDE = [path.name for path in ROOT.glob("digiclay_*")]
#: Endings of the files that the extension reads, and of texts for people.
KINDS = re.compile(
    r"LICENSE|LICENSES/[\w.-]+\.txt|blender_manifest\.toml|[\w/]+\.py|wheels/[\w.-]+-py3-none-any\.whl"
    r"|sample_shapes/(README\.md|methods/\w+\.txt|\w+/README\.md|batches/\w+\.toml|(sessions|displays)/\w+\.toml)"
    r"|sample_shapes/shapes/\w+\.(png|stl|obj|ply|npy)"
    r"|presets/[\w/]+\.toml|press/\w+\.dat|farms/\w+\.js|manual/\w+\.html|translations/\w+\.toml"
)


@pytest.fixture(scope="module")
def contents(extension_zip):
    with zipfile.ZipFile(extension_zip) as archive:
        return {name: archive.read(name) for name in archive.namelist() if not name.endswith("/")}


def test_the_zip_is_small_and_every_file_once_and_of_a_kind_that_is_needed(contents, extension_zip):
    assert extension_zip.stat().st_size < 2e6
    assert len(contents) > 200
    assert [name for name in contents if not KINDS.fullmatch(name)] == []
    counts = Counter(content for content in contents.values() if content)
    assert [name for name, content in contents.items() if counts[content] > 1] == []
    assert [name for name in contents if re.search(r"(^|/)\.", name)] == []


def test_what_the_manifest_leaves_out_is_not_there(contents):
    manifest = tomllib.loads(contents["blender_manifest.toml"].decode())
    named = [
        name[1:]
        for name in manifest["build"]["paths_exclude_pattern"]
        if name.startswith("/commands")
    ]
    assert named
    assert set(named) & set(contents) == set()
    assert [name for name in contents if name.startswith("sample_shapes/bodies")] == []


def test_samples_are_found_in_the_zip_which_has_none_with_bodies(extension_zip, tmp_path):
    zipfile.ZipFile(extension_zip).extractall(tmp_path / "digiclay")
    code = "import digiclay.core.scene.scene_source as s; print(*s.list_samples(), s.find('tap'))"
    done = subprocess.run(
        [sys.executable, "-P", "-c", code],
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        capture_output=True,
        encoding="utf-8",
        timeout=TIMEOUT,
    )
    *names, path = done.stdout.split()
    assert (len(names) > 20, "hand_print" in names) == (True, False), done.stderr
    assert Path(path).is_relative_to(tmp_path)


def test_the_bundled_wheels_are_those_of_the_manifest_with_their_license(
    contents, extension_zip, tmp_path
):
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


def test_the_wheel_has_the_package_and_those_beside_it_and_no_benchmark(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    assert {name.split("/")[0] for name in names if ".dist-info/" not in name} == {
        "digiclay",
        *BESIDE,
    }
    beside = {f"{name}/{path.name}" for name in BESIDE for path in (ROOT / name).glob("*.*")}
    samples = ("sessions/tap.toml", "measurements/valve.csv", "bodies/hand.ply")
    shipped = {
        "digiclay/manual/guide.html",
        *(f"digiclay/sample_shapes/{name}" for name in samples),
    }
    assert (beside | shipped) - names == set()
    assert len(beside) > 20


def test_the_paper_is_found_in_the_wheel(wheel, tmp_path):
    zipfile.ZipFile(wheel).extractall(tmp_path / "installed")
    # Without the checkout's path: all there is of digiclay is what the wheel brought.
    done = subprocess.run(
        [sys.executable, "-P", "-m", "digiclay", "paper", "--help"],
        env=os.environ | {"PYTHONPATH": str(tmp_path / "installed")},
        cwd=tmp_path,
        capture_output=True,
        encoding="utf-8",
        timeout=TIMEOUT,
    )
    assert (done.returncode, "reproduce the paper" in done.stdout.lower()) == (0, True), done.stderr
