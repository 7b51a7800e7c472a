"""How far apart pins can be that a fingertip forms."""

import digiclay
import pytest
from digiclay.core.session.plate import list_cautions

#: A finger starts a blister, lifts it by 7 mm and draws a ridge at 10 mm/s.
RIDGE = [
    (0.0, -0.02, 0.044), (0.3, -0.02, 0.041), (1.2, -0.02, 0.036), (1.4, -0.02, 0.036), (1.8, -0.02, 0.037),
    (3.8, -0.02, 0.047), (4.1, -0.02, 0.047), (8.1, 0.02, 0.047), (8.4, 0.02, 0.047),
]  # fmt: skip


@pytest.mark.parametrize(
    "pitch, count, rfd",
    [(3e-3, 31, 0.023), (5.08e-3, 19, 0.046), (7e-3, 13, 0.223), (12.7e-3, 7, 0.275)],
)
def test_a_ridge_is_drawn_on_beds_that_do_not_say_they_cannot_be_sculpted(pitch, count, rfd):
    points = [{"time": time, "position": [x, 0.0, z]} for time, x, z in RIDGE]
    changes = {
        "layout": {"rows": count, "columns": count, "pitch": pitch},
        "control": {"method": "hybrid"},
        "trajectory": {"waypoints": points},
    }
    done = digiclay.run(digiclay.scene(changes))
    # Figures of docs/displays.md; the last bit moves the second in the last two.
    assert done.metrics["rfd"] == pytest.approx(rfd, rel=0.1)
    said = any("cannot be sculpted" in line for line in list_cautions(done.scene))
    # The set point is 400 mN.
    assert said == (rfd > 0.1) == (pitch > 6e-3)
    assert (done.metrics["losses"] > 0) == (pitch > 10e-3)
