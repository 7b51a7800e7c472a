"""No operator ends in its start with its handler registered, which would abort Blender."""

import pytest

PLAYED = {"script": "start_modal.py", "size": (800, 560)}
#: Started by a script too: they become modal as the last step of what they do.
OTHERS = {"digiclay.session", "digiclay.session_go_on"}


def test_every_modal_operator_prepares_before_it_becomes_modal(seen):
    started = {
        name: found
        for name, found in seen.items()
        if name.startswith(("digiclay.", "export_anim."))
    }
    assert {name for name, found in started.items() if not found["modal"]} == OTHERS
    failing = [found for found in started.values() if found["modal"]]
    assert len(failing) >= 9
    assert {tuple(found["left"]) for found in failing} == {()}
    assert all("Something fails." in found["said"][0] for found in failing)


@pytest.mark.parametrize("stamp, modal, sessions", [("FILE", False, 0), ("heart", True, 1)])
def test_a_stamp_of_a_file_that_is_not_there_is_refused_and_the_next_one_is_formed(
    seen, stamp, modal, sessions
):
    assert ("DIGICLAY_OT_press_shape" in seen[f"stamp {stamp}"]) == modal
    assert seen[f"stamp {stamp}, sessions"] == sessions
