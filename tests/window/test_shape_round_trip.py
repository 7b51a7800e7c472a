"""A shape in, clay, the finger, a shape kept, in a real Blender window."""

from __future__ import annotations

from typing import Any

import pytest

from tests.window.blender_window import played


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Play the script once; return what stood in the scene after each of its steps."""
    return played("shape_round_trip.py", tmp_path_factory.mktemp("shapes"))


def test_the_shape_comes_up_and_the_finger_waits_above_it(seen: dict[str, Any]) -> None:
    assert seen["added"]["heights"] == pytest.approx([0.04, 0.04], abs=1e-7)
    # The dead band of the height control, 10 µm.
    assert seen["displayed"]["heights"] == pytest.approx([0.04, 0.052], abs=1.1e-5)
    assert seen["displayed"]["pose"][2] > 0.052


def test_a_session_goes_on_from_the_shape(seen: dict[str, Any]) -> None:
    assert seen["started"]["sessions"] == 1
    assert seen["started"]["heights"] == pytest.approx(seen["displayed"]["heights"], abs=1e-7)


def test_the_finger_forms_the_shape(seen: dict[str, Any]) -> None:
    forces = [seen[name]["force"] for name in seen if name.startswith("pressing")]
    assert max(forces) > 0.1
    assert seen["formed"]["sessions"] == 0
    assert seen["formed"]["heights"] != pytest.approx(seen["displayed"]["heights"], abs=1e-4)


def test_what_was_formed_is_kept_and_keeping_is_one_undo_step(seen: dict[str, Any]) -> None:
    assert seen["kept"] > 100
    assert seen["keeping undone"] == "ripple"


def test_what_was_formed_is_made_a_mesh(seen: dict[str, Any]) -> None:
    assert seen["mesh"] == pytest.approx(seen["formed"]["heights"][1], abs=1e-7)


def test_a_sample_is_added_and_taken_back_as_one_step(seen: dict[str, Any]) -> None:
    assert (seen["beds"], seen["beds after undo"]) == (2, 1)


def test_the_pictures_show_more_than_an_empty_window(seen: dict[str, Any]) -> None:
    # Shaded pins have hundreds of colors, a blank screen has one.
    assert min(seen["colors"].values()) > 200
