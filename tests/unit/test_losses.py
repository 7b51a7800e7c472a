"""Losses of a finger: when one is lost; wherever an RFD stands, losses and time without contact stand too."""

import numpy as np
import pytest
from digiclay.core.metrics.metric_table import describe_losses
from digiclay.core.metrics.summary import find_losses
from digiclay.core.session.finished_run import find_last_touch

from tests.assemble import table
from tests.scene_files import call, rows, scene_text

#: A lift at 24 mm/s, just as fast as a pin rises, and one at 5 mm/s, that Method I follows.
LIFTS = {"lost once": 24e-3, "": 5e-3}
FOUR = "--vary control.force_gain=2,2.1,2.2,2.3 --workers 1"
TIME = np.linspace(0.0, 10.0, 2001)
COMMANDS = {
    "run": ("run my.toml", ""),
    "batch": ("batch jobs.toml", "index.html"),
    "sweep of a batch": (f"sweep my.toml {FOUR}", "sweep.csv"),
    "sweep one by one": ("sweep my.toml --vary control.force_gain=2,2.1", "sweep.csv"),
}


@pytest.mark.parametrize("name, said", [*((name, "lost once") for name in COMMANDS), ("run", "")])
def test_losses_are_told_where_there_are_any(name, said, here, capsys):
    words, table = COMMANDS[name]
    points = [(0.0, 0.041), (0.2, 0.037), (0.5, 0.037), (1.5, 0.037 + LIFTS[said])]
    text = (
        scene_text(13, 13, *points)
        + 'interpolation = "linear"\n[control]\nmethod = "virtual_master"\n'
    )
    (here / "my.toml").write_text(text, encoding="utf-8")
    (here / "jobs.toml").write_text('scenes = ["my.toml"]\nerrors = false\n', encoding="utf-8")
    assert call(f"{words} --out out") == 0
    shown = (here / "out" / table).read_text(encoding="utf-8") if table else ""
    if table.endswith(".csv"):
        assert {row["lost"].partition(",")[0] for row in rows(here / "out" / table)} == {said}
    told = capsys.readouterr().out + (shown if table else "")
    assert ("lost once" in told, "s without contact" in told) == (bool(said), bool(said))


@table(
    "touching, quick, wanted",
    {
        "lost until the end": ([(0.0, 4.0)], 99.0, [(4.0, 6.0)]),
        "felt again, then lifted": ([(0.0, 4.0), (6.5, 9.0)], 8.9, [(4.0, 2.5)]),
        "lost, and lifted later": ([(0.0, 4.0)], 7.0, [(4.0, 3.0)]),
        "lifted": ([(0.0, 4.0)], 3.95, []),
        "lost twice": ([(0.0, 4.0), (4.5, 5.0)], 99.0, [(4.0, 0.5), (5.0, 5.0)]),
        "never felt": ([], 99.0, []),
    },
)
def test_a_finger_is_lost_where_contact_ends_though_it_rises_no_faster_than_a_pin(
    touching, quick, wanted
):
    """At 20 mm/s from the time `quick` on it is at 30 mm/s, where pins rise at 24."""
    felt = np.any([(start <= TIME) & (end >= TIME) for start, end in touching], axis=0) & (
        TIME >= 0.0
    )
    height = 20e-3 * TIME + 10e-3 * np.maximum(TIME - quick, 0.0)
    # A finger that touches as deep as its place is rounded is not felt.
    found = find_losses(TIME, np.where(felt, 0.4, 1e-16), height, 24e-3)
    # A row is 5 ms.
    assert [tuple(one) for one in found] == [pytest.approx(one, abs=11e-3) for one in wanted]


@pytest.mark.parametrize("rows", [1, 2])
def test_a_history_of_a_row_or_two_has_no_losses_unless_contact_ends(rows):
    """A single row has no gradient."""
    force, ends = np.array([0.4, 0.0])[:rows], rows - 1
    assert len(find_losses(TIME[:rows], force, np.zeros(rows), 24e-3)) == ends


@pytest.mark.parametrize(
    "lost, said",
    [
        ([(0, 0.0)], ""),
        ([(1, 2.71)], "lost once, 2.7 s without contact"),
        ([(0, 0.0), (2, 0.5)], "finger 2 lost 2 times, 0.5 s without contact"),
        (
            [(1, 1.0), (1, 3.0)],
            "finger 1 lost once, 1 s without contact; finger 2 lost once, 3 s without contact",
        ),
    ],
)
def test_losses_are_told_by_finger_where_there_are_any(lost, said):
    assert (
        describe_losses({"lost": [{"losses": count, "time": time} for count, time in lost]}) == said
    )


@pytest.mark.parametrize("after", [0.0, 1e-16])
def test_the_last_touch_is_of_more_than_rounding(after):
    assert (
        find_last_touch({"time": TIME[:4], "total_force": np.array([0.0, 0.4, after, after])}) == 1
    )
