"""Bands of the largest tracking speeds over an uncertain valve, beside what its members give alone."""

import digiclay
import numpy as np
from digiclay.core.studies.speed_limits import measure_speeds

from tests.scene_files import call, read_json, scene_text, write_text

#: An orifice known to 5 %: flow, and so the free speed of a pin, to 10 %.
FITTED = """
[valve]
orifice_diameter = 0.0005
[uncertainty]
keys = ["valve.orifice_diameter"]
logarithms = [true]
covariance = [[0.0025]]
"""
#: Resolution of the search, m/s.
RESOLUTION = 0.5e-3


def test_bands_of_speeds_are_those_of_members_and_no_lift_is_faster_than_its_pins(tmp_path, capsys):
    scene = scene_text(9, 15, (0.0, 0.041), (0.05, 0.038), (0.1, 0.038))
    write_text(tmp_path / "my.toml", scene)
    write_text(tmp_path / "fitted.toml", FITTED)
    run = tmp_path / "o"
    line = f"run {tmp_path / 'my.toml'} --uncertain {tmp_path / 'fitted.toml'} --members 40"
    assert call(f"{line} --speed --out {run}") == 0
    content = read_json(run / "uncertainty.json")
    members = [each["figures"] for each in content["members"]]
    for number in (0, 39):
        scene = digiclay.scene(run, content["members"][number]["values"])
        assert measure_speeds(scene)["figures"].items() <= members[number].items()
    for name in ("largest_drag_speed", "largest_lift_speed"):
        values = [figures[name] for figures in members]
        ends = np.quantile(values, (0.025, 0.975), method="weibull")
        np.testing.assert_allclose(content["bands"][name]["ends"], ends)
    lifts, free = (
        np.array([figures[name] for figures in members])
        for name in ("largest_lift_speed", "free_rise")
    )
    assert (lifts <= free + RESOLUTION).all()
    # The faster the pins, the faster the lift: but for the search's resolution in one line.
    assert np.corrcoef(lifts, free)[0, 1] > 0.95
    assert np.ptp(lifts) > 4.0 * RESOLUTION
    assert "largest speed of drags (mm/s)" in capsys.readouterr().out
