"""Scene files: found, read, overridden, and told of when they are wrong."""

from __future__ import annotations

from pathlib import Path

import pytest
from digiclay.core.base.errors import SceneError
from digiclay.core.scene.scene_source import SAMPLES, Setting, find, list_samples, load
from digiclay.core.scene.schema import Scene


def scene(folder: Path, text: str, **settings: str) -> Scene:
    """Write a scene file and read it; settings have a double underscore for the dot."""
    path = folder / "my.toml"
    path.write_text(text, encoding="utf-8")
    return load(path, [Setting(key.replace("__", "."), value) for key, value in settings.items()])


def refused(folder: Path, text: str, **settings: str) -> str:
    """Return what is said of a scene file that is wrong, without its folder."""
    with pytest.raises(SceneError) as caught:
        scene(folder, text, **settings)
    return str(caught.value).replace(f"{folder}/", "")


def test_a_setting_may_leave_a_part_out_and_a_scene_is_called_like_its_file(tmp_path: Path) -> None:
    made = scene(tmp_path, "[conduit]\nlength = 0.02", conduit="absent")
    assert (made.name, made.conduit) == ("my", None)


@pytest.mark.parametrize(
    ("text", "setting", "said"),
    [
        (
            "[valve]\norifice_diameter = -0.0003", {},
            "my.toml: valve.orifice_diameter must be above 0 m (got -0.0003 m).",
        ),
        (
            "", {"valve__orifice_diameter": "-0.0003"},
            "--set: valve.orifice_diameter must be above 0 m (got -0.0003 m).",
        ),
        # A mistake in the file is not blamed on a setting; what both break together is.
        (
            "[valve]\nstroke = 0.0", {"layout__rows": "3"},
            "my.toml: valve.stroke must be above 0 m (got 0 m).",
        ),
        (
            "[actuator]\nrest_height = 0.05", {"actuator__stroke": "0.01"},
            "--set: actuator.rest_height must be at most the stroke, 0.01 m (got 0.05 m).",
        ),
        # A setting cannot smuggle in a second key.
        ("", {"layout__rows": "3\nx = 4"}, "--set: layout.rows must be a whole number (got '3\\nx = 4')."),
    ],
)  # fmt: skip
def test_a_mistake_is_told_with_the_file_or_the_option(tmp_path, text, setting, said):
    assert refused(tmp_path, text, **setting) == said


@pytest.mark.parametrize(
    ("text", "settings", "part", "key", "value"),
    [
        pytest.param("[valve]\nstroke = 0.0", {"valve__stroke": "3e-5"}, "valve", "stroke", 3e-5, id="mends"),
        pytest.param("", {"layout__pitch": "4 mm"}, "layout", "pitch", 4e-3, id="quantity without quotes"),
        pytest.param(
            "", {"layout__arrangement": "hexagonal"}, "layout", "arrangement", "hexagonal", id="text"
        ),
        pytest.param(
            "", {"relaxation__times": "[1.0]", "relaxation__weights": "[1, 1]"}, "relaxation", "times",
            (1.0,), id="list",
        ),
        pytest.param(
            'conduit = "absent"', {"conduit__length": "0.02"}, "conduit", "length", 0.02, id="part put back"
        ),
    ],
)  # fmt: skip
def test_a_setting_is_a_value_of_the_scene(tmp_path, text, settings, part, key, value):
    assert getattr(scene(tmp_path, text, **settings).section(part), key) == value


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[valve\nstroke = 1", "my.toml, line 1: Expected ']' at the end of a table declaration."),
        ("a = 1\nb 2\n", "my.toml, line 2: Expected '=' after a key in a key/value pair."),
        ("name = 'x'\nname = 'y'\n", "my.toml, line 2: Cannot overwrite a value."),
        ('name = """\n\n', "my.toml, line 2: Unterminated string."),
        ("a = " + "[" * 100_000, "my.toml: lists or tables are nested too deeply."),
    ],
)
def test_text_that_is_no_toml_is_told_with_its_line(tmp_path: Path, text: str, said: str) -> None:
    assert refused(tmp_path, text) == said


def test_a_file_that_is_no_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "my.toml"
    path.write_bytes(b"name = '\xff'")
    with pytest.raises(SceneError, match=r"my\.toml must be UTF-8 text \(byte 8 is not\)\."):
        load(path)


def test_a_sample_is_found_although_a_run_of_it_lies_here_which_stands_for_its_scene(here: Path) -> None:
    (here / "tap").mkdir()
    (here / "tap" / "scene.toml").touch()
    assert find("tap") == SAMPLES / "tap.toml"
    assert find(str(here / "tap")) == here / "tap" / "scene.toml"


@pytest.mark.parametrize("word", ["nowhere.toml", "a\0b", 300 * "a", "", 300 * "a" + "/b"])
def test_a_word_no_file_can_be_called_is_told_as_any_other(word: str) -> None:
    with pytest.raises(SceneError, match=r"neither a file nor a sample|there is no such file"):
        find(word)


def test_every_sample_is_a_scene_called_like_its_file_and_a_misspelt_one_is_told_with_all_names() -> None:
    assert [name for name in list_samples() if load(find(name)).name != name] == []
    names = ", ".join(list_samples())
    with pytest.raises(SceneError) as caught:
        find("ridge_mund_valley")
    said = f"ridge_mund_valley is neither a file nor a sample ({names}). Did you mean ridge_mound_valley?"
    assert str(caught.value) == said
