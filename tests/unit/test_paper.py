"""The paper's claims on results made by hand: what holds, what does not, and that it says why."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from digiclay.core.base.modes import MEANINGS
from digiclay.core.control.cell_states import BY_FORCE, BY_PLACE
from digiclay.core.scene.scene_source import find, load
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session.run_scene import Result
from digiclay.core.studies.method_trials import find_free_speed, find_unintended_losses
from digiclay.core.studies.speed_limits import Follows

from digiclay_paper import scenes
from digiclay_paper.claim import Claim, largest_speed, tracking, verdict
from digiclay_paper.claims import carried_out
from digiclay_paper.claims_force import DEVIATIONS, WINDOWED, deviations, onset, trade
from digiclay_paper.figures_session import details, heights_and_force
from digiclay_paper.page import page
from digiclay_paper.results import SESSION, WAYS, Results, Session, Swing
from digiclay_paper.simulations import sessions
from digiclay_paper.windows import WINDOWS

GOOD = Follows(speed=15e-3, losses=0, loss_share=0.0, lag=1e-3, rfd=0.02)


def results(*swings: Swing, **bad: Follows) -> Results:
    """Return results that follow everything but what is bad, by method."""
    simple = {(method, name): bad.get(method, GOOD) for method in scenes.METHODS for name in WAYS}
    session = Session(resolve({}), {}, {}, {}, [], 0.0, {})
    return Results(simple=simple, swings=list(swings), printed={scenes.METHODS[0]: session})


def swing(gain: float, amplitude: float, settling: float | None, position_gain: float = 500.0) -> Swing:
    """Return one point of the sweep; it swings where it does not settle."""
    return Swing(gain, position_gain, amplitude, None if settling else 10.0, settling)


CALM_THEN_WILD = (swing(2.0, 0.001, 1.0), swing(5.0, 0.001, 0.2), swing(50.0, 0.2, None))


@pytest.mark.parametrize(
    ("holds", "said"),
    [([True, True], "holds"), ([True, False], "holds in part"), ([False, False], "differs")],
)
def test_a_verdict_tells_all_from_some_from_none(holds: list[bool], said: str) -> None:
    assert verdict(holds) == said


def test_a_finger_that_is_followed_everywhere_holds_the_claim() -> None:
    assert tracking(results()).verdict == "holds"


def test_a_finger_one_method_loses_is_told_with_the_method() -> None:
    lost = replace(GOOD, losses=1, loss_share=0.4)
    claim = tracking(results(cell_states=lost))
    assert claim.verdict == "holds in part"
    assert "Not followed: Method II" in claim.why
    assert "Method I," not in claim.why
    assert "lost 1 times, 40% of the time without contact" in claim.measured
    late = tracking(results(cell_states=replace(GOOD, lag=3.1e-3)))  # a pitch is 3 mm
    assert (late.verdict, late.why[:24]) == ("holds in part", claim.why[:24])


def test_the_onset_lies_between_the_last_calm_gain_and_the_first_that_swings() -> None:
    assert results(*CALM_THEN_WILD).onset(500.0) == (5.0, 50.0)
    assert results(*CALM_THEN_WILD[:2]).onset(500.0) == (5.0, None)
    assert results(*CALM_THEN_WILD[2:]).onset(500.0) == (None, 50.0)


def test_a_slow_drift_is_no_oscillation() -> None:
    assert not Swing(2.0, 500.0, 0.5, None, None).sustained


def test_a_loop_that_never_oscillates_differs_from_the_paper() -> None:
    claim = onset(results(*CALM_THEN_WILD[:2]))
    assert claim.verdict == "differs"
    assert "none up to K_f = 5 1/N" in claim.measured


def test_a_loop_that_oscillates_only_beyond_the_gain_of_the_session_is_not_all_of_the_papers() -> None:
    found = results(*CALM_THEN_WILD)
    claim = onset(found)
    assert claim.verdict == "holds in part"
    assert "at 50 1/N (amplitude 0.200 N, 10 Hz)" in claim.measured
    assert "are below the onset, 10 times this K_f" in claim.why  # the scene's own K_f is 5 1/N
    scene = resolve({"control": {"method": "virtual_master", "force_gain": 60.0}})
    found.printed[scenes.METHODS[0]] = found.printed[scenes.METHODS[0]]._replace(scene=scene)
    assert onset(found).verdict == "holds"


def test_speed_counts_along_every_way_and_not_along_the_ridge_alone() -> None:
    found, (one, two) = results(), scenes.METHODS
    found.printed[two], found.lifting = found.printed[one], {one: 20e-3, two: 20e-3}
    found.fastest = {(method, way): 20e-3 for method in scenes.METHODS for way in WAYS}
    assert largest_speed(found).verdict == "holds"
    slow = replace(found, fastest=found.fastest | {(two, "a valley"): 14e-3})
    still = replace(found, lifting={one: 20e-3, two: None})
    assert [largest_speed(some).verdict for some in (slow, still)] == ["holds in part"] * 2


@pytest.mark.parametrize(
    ("height", "said"), [(1.6, "holds"), (1.4, "holds in part"), (None, "holds in part")]
)
def test_deviations_count_in_each_of_the_papers_windows(height: float | None, said: str) -> None:
    once, twice = (dict.fromkeys((*DEVIATIONS, *WINDOWED, "set_point"), value) for value in (1.0, 2.0))
    known = results().printed[scenes.METHODS[0]]
    one, two = (known._replace(metrics=each, windows=dict.fromkeys(WINDOWS, each)) for each in (once, twice))
    two.windows["valley alone"] = twice | {"height_deviation": height}
    found = dict(zip(scenes.METHODS, (one, two), strict=True))
    assert deviations(replace(results(), printed=found, session=found)).verdict == said


def test_the_trade_needs_a_response_that_gets_quicker_and_an_oscillation() -> None:
    assert trade(results(*CALM_THEN_WILD)).verdict == "holds"
    slower = (swing(2.0, 0.001, 0.2), swing(5.0, 0.001, 0.3), swing(50.0, 0.2, None))
    assert trade(results(*slower)).verdict == "holds in part"


def test_a_gain_that_never_settles_is_told() -> None:
    assert "never settles" in trade(results(CALM_THEN_WILD[2])).measured


def test_a_slowed_session_takes_as_many_times_as_long() -> None:
    session = load(find(SESSION))
    slow = scenes.slowed(session, 1.5)
    assert slow.simulation.duration == pytest.approx(1.5 * session.simulation.duration)
    assert (
        slow.section("trajectory").waypoints[3].position
        == session.section("trajectory").waypoints[3].position
    )


def test_the_fastest_lift_of_a_slowed_session_is_as_many_times_slower() -> None:
    session = load(find(SESSION))
    assert scenes.fastest_lift(scenes.slowed(session, 2.0)) == pytest.approx(
        0.5 * scenes.fastest_lift(session), rel=1e-6
    )


def test_the_fastest_lift_leaves_out_what_no_pin_could_follow() -> None:
    session = load(find(SESSION))
    assert 0.0 < scenes.fastest_lift(session) < find_free_speed(session)


@pytest.mark.parametrize(("speed", "times"), [(0.2, []), (5e-3, [0.5, 0.8])])
def test_only_a_finger_a_pin_could_follow_is_lost_without_intention(speed: float, times: list[float]) -> None:
    time = np.linspace(0.0, 1.0, 201)
    tip = np.zeros((201, 7))
    tip[:, 2] = speed * time
    force = np.ones(201)
    force[100:120] = force[160:] = 0.0
    done = Result(resolve({}), {"time": time, "fingertip": tip, "total_force": force}, 200, 1.0, {})
    assert find_unintended_losses(done) == pytest.approx(times)


def test_every_arrow_of_the_controller_is_a_row_of_the_page() -> None:
    text = page(results(), [], {}, 1.0, "0")
    rows = [line for line in text.splitlines() if line.startswith("| ") and " own force |" in line]
    places = [line for line in text.splitlines() if line.endswith("nearest cell under the finger |")]
    assert (len(rows), len(places)) == (len(BY_FORCE), len(BY_PLACE))
    conditions = [arrow.condition.replace("_", " ") for arrow in (*BY_FORCE, *BY_PLACE)]
    assert [
        said for said, row in zip(conditions, rows + places, strict=True) if f"| {said} |" not in row
    ] == []


def test_the_page_explains_the_modes_of_the_virtual_spring() -> None:
    text = page(results(), [], {}, 1.0, "0")
    assert [mode for mode in MEANINGS if mode.name in ("REST", "HOLD") and MEANINGS[mode] not in text] == []


def test_a_claim_is_a_row_of_the_page_with_its_verdict() -> None:
    text = page(results(), [Claim("said", "one; two", "differs", "because")], {"a": "caption"}, 1.0, "0")
    assert "| said | one;<br>two | **differs** | because |" in text
    assert "![caption](a.svg)" in text
    assert "[Data](a.csv)" in text


#: A lift of 10 mm/s at its fastest: Method I follows it, Method II's cells rise at 8.7 mm/s at the most.
LIFTED = """\
[layout]
rows = 13
columns = 13

[trajectory]
waypoints = [
  { time = 0.0, position = [0, 0, 0.041] },
  { time = 0.8, position = [0, 0, 0.0355] },
  { time = 1.2, position = [0, 0, 0.0355] },
  { time = 3.9, position = [0, 0, 0.0535] },
  { time = 4.2, position = [0, 0, 0.0535] },
]
"""


@pytest.fixture(scope="module")
def lost(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """A session Method II loses the finger in, and what was made of it."""
    path = tmp_path_factory.mktemp("lost") / "lifted.toml"
    path.write_text(LIFTED, encoding="utf-8")
    found = Results(lifting={"virtual_master": 20e-3, "cell_states": 6e-3})
    sessions(found, lambda stage: None, str(path))
    return found


def test_a_session_a_method_loses_the_finger_in_is_run_again_slowly_enough(lost: Results) -> None:
    assert [bool(lost.printed[method].lost) for method in scenes.METHODS] == [False, True]
    # 10 mm/s over four fifths of 6 mm/s is 2.08; in steps of a tenth.
    assert lost.slow == pytest.approx(2.1)
    assert [lost.session[method].lost for method in scenes.METHODS] == [[], []]


def test_a_finger_lost_in_the_session_is_told_with_its_time_and_its_cause(lost: Results) -> None:
    claim = carried_out(lost)
    assert claim.verdict == "holds in part"
    assert f"Method II: finger lost at {lost.printed['cell_states'].lost[0]:.2f} s" in claim.measured
    assert "lifts at up to 10.0 mm/s, and Method II follows a lift of 6.0 mm/s" in claim.why
    assert "run again 2.1 times as long: Method I never lost, Method II never lost" in claim.why


def test_a_session_is_drawn_with_the_same_cells_and_scales_for_both_methods(lost: Results) -> None:
    figure = heights_and_force(lost.session, "title")
    one, two = (axes for axes in figure.axes if axes.get_label().endswith("heights"))
    assert len(one.get_lines()) == len(two.get_lines()) > 0
    assert one.get_ylim() == two.get_ylim()


def test_the_detail_of_the_session_shows_heights_of_cells_side_by_side_at_every_period(lost: Results) -> None:
    figure = details(lost, "title")
    press, lift = figure.axes[:2]
    session = lost.printed["virtual_master"]
    time, height = session.detail["time"], session.detail["height"]
    # The finger presses the middle of the bed, x = 0; the next cells are a pitch apart.
    assert [line.get_label() for line in press.get_lines()] == [f"x = {x} mm" for x in (0, 3, 6, 9, 12)]
    shown = press.get_lines()[0]
    within = (time >= 0.5 - 1e-9) & (time <= 1.5 + 1e-9)
    np.testing.assert_array_equal(shown.get_xdata(), time[within])
    np.testing.assert_array_equal(shown.get_ydata(), 1e3 * height[within, 84])
    assert np.diff(shown.get_xdata()).max() == pytest.approx(5e-3, rel=1e-9)
    # The lift's own course, of millimeters, is left out: what remains is in micrometers.
    rising = (time >= 2.4 - 1e-9) & (time <= 3.4 + 1e-9)
    assert np.ptp(height[rising, 84]) > 2e-3
    assert np.abs(lift.get_lines()[0].get_ydata()).max() < 100.0
    assert len(figure.axes) == 4


def test_method_three_is_beside_the_methods_of_the_paper_in_figures_and_in_no_claim() -> None:
    two = results(Swing(5.0, 500.0, 0.001, None, 0.3))
    three = Results(simple={(scenes.THIRD, name): GOOD for name in WAYS})
    both = replace(two, third=three).compared()
    assert {method for method, _ in both.simple} == set(scenes.COMPARED)
    assert two.compared() is two
    assert "Method III" not in tracking(replace(two, third=three)).measured
