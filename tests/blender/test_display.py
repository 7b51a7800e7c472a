"""What is shown of a bed is a setting of the bed; what is off is not there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import bpy
import numpy as np
import pytest
from digiclay import bridge
from digiclay.core.base.errors import DigiclayError
from digiclay.core.base.modes import Mode
from digiclay.core.session.accuracy import Errors
from digiclay.device import palettes, view
from digiclay.device.node_tree import ARROW_LENGTH, ARROWS, TOP_FORCE
from digiclay.live import beds
from digiclay.operators.pin_view import pick_pins
from digiclay.overlay import views
from digiclay.overlay.picture import choose_colors
from digiclay.overlay.sections import lay_out
from digiclay.panels import display
from digiclay.panels.session import error_line
from digiclay.roles import fingertip_of
from digiclay.sessions import running, sculpting
from digiclay.settings import properties

from tests.blender.at_hand import new_bed

pytestmark = pytest.mark.usefixtures("extension")


@pytest.fixture
def bed() -> Any:
    """A bed of 20 x 20 pins as the Add menu makes it."""
    made = new_bed(rows=20, columns=20)
    bpy.context.view_layer.update()
    return made


@pytest.fixture
def session(bed: Any) -> Iterator[running.Running]:
    """A running session whose finger has pressed the middle of the bed for a third of a second."""
    scene = properties.scene_of(bed)
    above = bridge.pose(fingertip_of(bed))
    begun, _ = sculpting.begin_session(bed.session_uid, bed.name, scene, above)
    pressed = above.copy()
    pressed[2] = 0.037
    begun = sculpting.advance(begun, above, 0.0, 100)
    for tick in range(1, 11):
        begun = sculpting.advance(begun, pressed, tick / 30, 100, pins=view.picked_pins(bed))
    # The trace keeps every other period: it ends with this state.
    while begun.state.period % begun.trace.every:
        begun = sculpting.advance(sculpting.request_step(begun), pressed, 1.0, 100)
    begun = replace(begun, paused=False)
    running.put(begun)
    yield begun
    running.drop(begun.uid)
    views.follow()


def forces(bed: Any) -> np.ndarray:
    """Return the forces written into a bed's mesh, N."""
    return bridge.read_cells(bed.data)["force"]


def test_the_properties_are_the_settings_of_the_geometry_nodes(bed: Any) -> None:
    shown = bed.digiclay_display
    shown.color, shown.arrows, shown.top_force, shown.arrow_length = "force", True, 0.5, 250.0
    assert (view.shows_force(bed), view.read_setting(bed, ARROWS, False)) == (True, True)
    assert view.read_setting(bed, TOP_FORCE, 0.0) == 0.5
    assert view.read_setting(bed, ARROW_LENGTH, 0.0) == 250.0
    view.color_by(bed, "mode")
    assert shown.color == "mode"


def test_a_bed_without_its_nodes_has_nothing_to_set_and_says_nothing(bed: Any) -> None:
    bed.modifiers.clear()
    shown = bed.digiclay_display
    shown.color, shown.arrows, shown.top_force, shown.arrow_length = "force", True, 0.5, 250.0
    assert (shown.color, shown.arrows) == ("mode", False)


def test_turning_the_heat_map_on_shows_the_forces_of_now(bed: Any, session: running.Running) -> None:
    view.show_state(bed, session.system, session.state)
    assert not forces(bed).any()
    bed.digiclay_display.color = "force"
    felt = session.state.row(session.system.rows.force)
    assert felt.max() > 0.01
    np.testing.assert_allclose(forces(bed), felt, rtol=2.0**-23)


def test_arrows_after_a_session_show_the_forces_it_ended_with(bed: Any, session: running.Running) -> None:
    beds.write(bed, session)
    running.drop(session.uid)
    bed.digiclay_display.arrows = True
    np.testing.assert_allclose(forces(bed), session.state.row(session.system.rows.force), rtol=2.0**-23)


def test_the_overlay_and_its_timer_are_there_only_while_wanted_and_go_with_the_extension(
    bed: Any, session: running.Running
) -> None:
    def is_there() -> bool:
        assert bpy.app.timers.is_registered(views._again) is views.shown()
        return views.shown()

    assert not is_there()
    views.follow()
    assert is_there()
    for wanted in (False, True):
        bed.digiclay_display.overlay = wanted
        assert is_there() is wanted
    display.unregister()
    try:
        assert not views.shown()
    finally:
        display.register()
    views.follow()
    assert is_there()
    running.drop(session.uid)
    views.follow()
    assert not is_there()


def test_the_overlay_tells_what_the_session_is(bed: Any, session: running.Running) -> None:
    told = views.read_session(bed, session, palettes.PALETTES["okabe_ito"])
    assert (told.name, told.method, told.set_point) == (bed.name, "virtual_master", 0.4)
    assert told.modes.sum() == 400
    assert np.count_nonzero(told.modes) > 1
    total = session.state.row(session.system.rows.force).sum()
    assert told.force[-1] == pytest.approx(total, rel=1e-12)
    stopped = views.read_session(bed, replace(session, paused=True), palettes.PALETTES["okabe_ito"])
    assert stopped.paused
    assert told.colors[Mode.HOLD] == palettes.PALETTES["okabe_ito"][Mode.HOLD]


@pytest.mark.parametrize("errors", [None, Errors(2.1e-6, 4.6e-4, 9e-4), Errors(9e-12, 0.0, 0.0)])
def test_panel_and_overlay_name_the_same_error(
    bed: Any, session: running.Running, errors: Errors | None
) -> None:
    known = replace(session, errors=errors)
    told = views.read_session(bed, known, palettes.PALETTES["okabe_ito"])
    chosen = choose_colors((0.1, 0.1, 0.1), (0.9, 0.9, 0.9))
    written = [words.text for words in lay_out(told, chosen, (0.0, 0.0, 900.0, 700.0), 1.0).words]
    assert error_line(known) in written


def test_picked_pins_are_kept_with_the_bed_in_the_order_they_were_picked(bed: Any) -> None:
    pick_pins(bed, (7, 399, 0))
    assert view.picked_pins(bed) == (7, 399, 0)
    assert view.picked_pins(bed.copy()) == (7, 399, 0)
    assert bpy.ops.digiclay.clear_pins() == {"FINISHED"}
    assert view.picked_pins(bed) == ()
    assert not bpy.ops.digiclay.clear_pins.poll()


@pytest.mark.parametrize(
    ("pins", "said"),
    [((1, 1), "6 different pins"), (range(7), "6 different pins"), ((400,), "0 to 399"), ((-1,), "0 to 399")],
)
def test_pins_that_cannot_be_picked_are_refused(bed: Any, pins: tuple[int, ...], said: str) -> None:
    with pytest.raises(DigiclayError, match=said):
        pick_pins(bed, pins)
    assert view.picked_pins(bed) == ()
