"""A live session on a bed with a matrix drive: pins wait, the overlay tells, and a take is replayed."""

import numpy as np
from digiclay.core.base.modes import COLORS
from digiclay.core.session import snapshot
from digiclay.core.session.take import replay
from digiclay.live import beds
from digiclay.overlay import views
from digiclay.overlay.picture import choose_colors
from digiclay.overlay.sections import lay_out
from digiclay.recorded import takes
from digiclay.sessions import running, sculpting

from tests.blender.session.live import exact, move, press, started


def test_a_session_serves_lines_says_how_many_wait_and_its_take_is_replayed_bit_for_bit(bed, clock):
    settings = bed.digiclay
    settings.use_drive, settings.drive.sections, settings.drive.slot = True, 2, 20.0
    started(bed)
    running.put(sculpting.set_recording(running.find(bed), True))
    assert move(bed, clock, [(0.0, z) for z in np.linspace(46, 37, 8)]) == []
    session = running.find(bed)
    now = session.state.addressing
    assert now.waiting.size
    told = views.read_session(bed, session, COLORS)
    assert told.drive == (2, 13, now.waiting.size)
    chosen = choose_colors((0.1, 0.1, 0.1), (0.9, 0.9, 0.9))
    written = [words.text for words in lay_out(told, chosen, (0.0, 0.0, 900.0, 900.0), 1.0).words]
    assert {"2 of 13 lines addressed", f"{now.waiting.size} pins wait"} <= set(written)
    press(bed, clock)
    take = takes.read_recording(running.find(bed))
    *_, state = replay(take)
    assert snapshot.dump(session.system, state) == take.end == beds.read_snapshot(bed)
    np.testing.assert_array_equal(state.row(0), exact(bed))
