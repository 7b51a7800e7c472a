"""The fit of finger and cell to synthetic measurements that another code makes: truth, verdicts, files."""

import tomllib

import digiclay
import numpy as np
import pytest
from digiclay.cli import main
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

from benchmarks.fit_coverage import (
    FORCE_NOISE,
    HEIGHT_NOISE,
    HEIGHT_RATE,
    KINDS,
    UNKNOWABLE,
    find_inside,
    fit_measured,
    list_unnamed,
    measure_cell,
    measure_finger,
)
from benchmarks.synthetic_devices import Cell, Finger
from digiclay_fit.cell import DELAY, LAG
from digiclay_fit.estimation import SEEN, find_rms
from digiclay_fit.fit_command import list_rows
from digiclay_fit.records import Trial, find_records, read_records
from digiclay_fit.verdicts import fit, make_model

TAP = digiclay.scene("tap")
BOTH = ("contact", "relaxation")


def draw(seed):
    return np.random.default_rng(seed)


def test_the_synthetic_finger_obeys_equation_13_and_the_form_on_a_plate():
    finger = Finger(touch=1e-4)
    path = [(0.0, 0.0), (0.05, 1.2e-3), (0.1, 0.8e-3)]
    time, position, force = finger.measure(path, 500.0)
    plate = digiclay.plate_force(TAP, np.maximum(position - 1e-4, 0.0))
    np.testing.assert_allclose(finger.press(position - 1e-4), plate, rtol=1e-12, atol=1e-15)

    def relax(t, z):
        depth = np.interp(t, *np.array(path).T) - 1e-4
        return (finger.press(depth) - z) / np.array(finger.times)

    exact = solve_ivp(relax, (0.0, 0.1), np.zeros(3), t_eval=time[:51], rtol=1e-9, max_step=1e-3)
    wanted = np.maximum(plate - np.array(finger.weights[1:]) @ exact.y, 0.0)
    np.testing.assert_allclose(force, wanted, atol=2e-5)  # N: the trapezoids of the generator


def test_the_synthetic_cell_moves_as_a_free_pin_does():
    cell, count = Cell(), 60
    height = cell.measure(np.ones(count), 1000.0)
    speed = (height[-1] - height[-11]) / 0.01
    assert speed == pytest.approx(digiclay.free_speed(TAP).rise, rel=1e-4)
    time, wanted = digiclay.step_response(TAP, command=1.0, duration=0.04)
    ours = np.interp(time, np.arange(count) * 1e-3, height) - height[0]
    np.testing.assert_allclose(ours, wanted - wanted[0], atol=2e-6)  # between samples of 1 ms


@pytest.mark.parametrize("part, groups, stroke, off", [
    ("pulp", ("contact", "relaxation", "lag", "drift", "compliance"), 30e-6, 2e-3),
    ("cell", ("supply", "lag", "delay"), 30e-6, 2e-3),
    # Where the flow becomes turbulent the derivative by time jumps within a sample.
    ("cell", ("supply", "lag", "delay"), 4e-6, 0.25),
    ("cell", ("stroke", "supply", "lag", "delay"), 4e-6, 0.25),
])  # fmt: skip
def test_the_jacobian_is_that_of_differences(part, groups, stroke, off):
    measured = measure_finger(draw(1)) if part == "pulp" else measure_cell(draw(1), loaded=True)
    scene = digiclay.scene(TAP, {"valve.stroke": stroke})
    model = make_model(part, scene, measured.trials[-1:], groups)
    free = np.array([each.start for each in model.parameters])
    if part == "cell":
        free[list(model.defaults)] = list(model.defaults.values())
        free[model.index["delay.dead_time"]] = 1.23e-3  # no kink at a sample
    else:
        free[model.index["lag"]] = 0.3e-3
    _, jacobian = model.predict(free)
    for number, (each, value) in enumerate(zip(model.parameters, free, strict=True)):
        step = np.zeros(free.size)
        step[number] = 1e-5 if each.log else 1e-4 * max(abs(value), 1e-4)
        ends = [model.predict(free + sign * step)[0] for sign in (1.0, -1.0)]
        slope = (ends[0] - ends[1]) / (2.0 * step[number])
        most = off * np.abs(jacobian[:, number]).max()
        np.testing.assert_allclose(jacobian[:, number], slope, atol=most, err_msg=each.key)


def test_predictions_at_the_truth_are_those_of_the_other_code():
    time, position, force = Finger().measure(
        [(0.0, -3e-4), (0.1, -3e-4), (0.2, 1.5e-3), (0.4, 1.5e-3)], 500.0
    )
    model = make_model("pulp", TAP, [Trial("1", time, position, force, 0.0 * time)], BOTH)
    free = np.array([each.start for each in model.parameters])
    free[[model.index["zero of position"], model.index["zero of force"]]] = 0.0
    # N: what the corner of the path is worth between two samples, of 1.6 N.
    np.testing.assert_allclose(model.predict(free)[0], force, atol=6e-3)
    commands = measure_cell(draw(2)).trials[0].drive
    height = Cell(delay=1.6e-3).measure(commands, 1000.0)
    time = np.arange(commands.size) * 1e-3
    model = make_model(
        "cell", TAP, [Trial("1", time, commands, height, 0.0 * time)], ("lag", "delay")
    )
    free = np.array([model.defaults.get(i, each.start) for i, each in enumerate(model.parameters)])
    free[model.index["delay.dead_time"]] = 1.6e-3
    # Rounding of sums of steps; with kinks inside pieces of time 0.3 um.
    np.testing.assert_allclose(model.predict(free)[0], height, atol=5e-8)


def test_a_finger_that_does_not_touch_is_predicted_without_force():
    model = make_model("pulp", TAP, measure_finger(draw(1)).trials, BOTH)
    free = np.array([each.start for each in model.parameters])
    free[model.index["zero of position"]] = 1.0
    force, jacobian = model.predict(free)
    assert (force == free[model.index["zero of force"]]).all()
    assert jacobian[:, model.index["zero of force"]].all()


#: Devices of each kind, and misses of 95 % intervals that are tolerated: with independent parameters
#: fewer than one in 300 suites has more.
NOISE = {"pulp": FORCE_NOISE, "cell": HEIGHT_NOISE}
#: Some of these cells end in another minimum unless knee, lag and dead time are held first.
SEEDS = (40, 41, 42, 43, 44, 158)
MOST = {
    "pulp, three ramps": 9,
    "cell, random commands": 4,
    "cell, random commands and a load": 6,
}


@pytest.mark.parametrize("name", KINDS)
def test_intervals_contain_the_truth(name):
    part, make = KINDS[name]
    missed = []
    for seed in SEEDS:
        measured = make(draw(seed))
        found = fit_measured(part, measured)
        assert found.made.noise == pytest.approx(NOISE[part], rel=0.1)  # of 2,000 samples: 1.6 %
        assert found.code in ("OK", "NOT_IDENTIFIABLE")
        inside = list(find_inside(found, measured.truth))
        missed += [key for key, within, _ in inside if not within]
        assert {key for key, _, _ in inside} == set(measured.truth)
    assert len(missed) <= MOST[name], missed


@pytest.mark.parametrize("number", range(len(UNKNOWABLE)))
def test_what_a_record_cannot_tell_is_refused_by_name(number):
    assert list_unnamed(number, 0) == []


def test_a_stroke_that_flow_does_not_feel_has_no_interval_and_the_knee_has_an_end():
    measured = measure_cell(draw(0))
    rows = list(list_rows(fit("cell", TAP, measured.trials, (), ("stroke", "lag", "delay"))))
    verdicts = {name: (interval, verdict) for name, _, interval, verdict, _ in rows}
    assert verdicts["valve.stroke"] == ("none", "one-sided")
    interval, verdict = verdicts["knee of the flow"]
    assert verdict == "one-sided"
    # Pa: the flow of a supply of 50 kPa is laminar.
    assert 4.5e4 < float(interval.split()[0]) < 6e4


def change(trials, answer):
    return [trial._replace(answer=answer(trial)) for trial in trials]


def press(**more):
    """Return the trials of a finger that differs from the default by a third, without its seed's luck."""
    measured = measure_finger(draw(5), **more)
    return measured.truth, measured.trials


def find_value(found, key):
    (each,) = [each for each in found.derived if each.key == key]
    return np.exp(each.value) if each.log else each.value


@pytest.mark.parametrize("group, size, error", [
    ("lag", 1e-3, lambda t: {"answer": np.interp(t.time - 1e-3, t.time, t.answer)}),
    ("drift", 30e-3, lambda t: {"answer": t.answer + 30e-3 * t.time}),
    ("compliance", 50e-6, lambda t: {"drive": t.drive + 50e-6 * t.answer}),
])  # fmt: skip
def test_a_late_or_drifting_force_or_a_frame_that_gives_is_fitted_on_request(group, size, error):
    truth, trials = press()
    wrong = [trial._replace(**error(trial)) for trial in trials]
    found = fit("pulp", TAP, wrong, (), (*BOTH, group))
    assert found.made.free[found.made.model.index[group]] == pytest.approx(size, rel=0.3)
    # Thrice half of its interval: so far is one of nine parameters less than once in 10,000.
    for each, half in zip(found.derived, found.half_widths, strict=True):
        true = np.log(truth[each.key]) if each.log else truth[each.key]
        assert each.value == pytest.approx(true, abs=3.0 * half), each.key


def test_outliers_count_little_and_correlated_noise_widens_intervals():
    _, trials = press()
    plain = fit("pulp", TAP, trials, (), BOTH)
    random = draw(9)

    def spoil(trial):
        spikes = random.random(trial.time.size) < 0.01
        return trial.answer + spikes * random.normal(0.0, 0.5, trial.time.size)

    found = fit("pulp", TAP, change(trials, spoil), (), BOTH)
    assert found.made.outliers > 10
    assert found.code == "OK"
    moved = np.abs([a.value - b.value for a, b in zip(found.derived, plain.derived, strict=True)])
    assert (moved < plain.half_widths).all()

    def remember(trial):
        noise = random.normal(0.0, 5e-3, trial.time.size)
        for number in range(1, noise.size):
            noise[number] += 0.9 * noise[number - 1]
        return trial.answer + noise

    found = fit("pulp", TAP, change(trials, remember), (), BOTH)
    assert found.made.correlated > 10.0
    assert (found.half_widths > 1.5 * plain.half_widths).all()


@pytest.mark.parametrize("sample, part, groups, noise", [
    ("fingertip", "pulp", BOTH, FORCE_NOISE), ("valve", "cell", ("lag", "delay"), HEIGHT_NOISE),
])  # fmt: skip
def test_each_held_out_trial_is_predicted_within_noise(sample, part, groups, noise):
    trials = read_records([find_records(sample)], part)
    assert len(trials) >= 2
    for held in trials:
        found = fit(part, TAP, [trial for trial in trials if trial is not held], [held], groups)
        fitted, plain = (find_rms(held.answer - each) for each in found.held_predictions)
        # Noise of 800 samples has 2.5 %; the fit does not have this speed, or these commands.
        assert fitted == pytest.approx(noise, rel=0.08), held.name
        assert plain > 1.15 * fitted


def thin(trial):
    """Return a trial with every fifth sample."""
    parts = {name: getattr(trial, name)[::5] for name in ("time", "drive", "answer", "load")}
    return trial._replace(**parts)


#: Errors of a measured finger or cell, and the caution that they give; "": they do no harm.
FINGER, CELL = lambda: measure_finger(draw(5)), lambda: measure_cell(draw(3))
TRAPS = {
    "noise of the position, 0.5 um": (
        FINGER, lambda t: t._replace(drive=t.drive + draw(7).normal(0.0, 0.5e-6, t.time.size)),
        "give the commanded position",
    ),
    "steps of the position, 5 um": (
        FINGER, lambda t: t._replace(drive=np.round(t.drive / 5e-6) * 5e-6),
        "give the commanded position",
    ),
    "100 samples per second": (FINGER, thin, "too coarse for a relaxation time"),
    "a leak of 50 um/s": (
        CELL, lambda t: t._replace(answer=t.answer - 50e-6 * t.time), "the law does not describe",
    ),
    "steps of the force, 20 mN": (
        FINGER, lambda t: t._replace(answer=np.round(t.answer / 20e-3) * 20e-3), "",
    ),
    "steps of the height, 20 um": (
        CELL, lambda t: t._replace(answer=np.round(t.answer / 20e-6) * 20e-6), "",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", TRAPS)
def test_a_trap_is_seen_or_does_no_harm(name):
    make, spoil, caution = TRAPS[name]
    part = "pulp" if make is FINGER else "cell"
    measured = make()
    found = fit(part, TAP, [spoil(trial) for trial in measured.trials], (), measured.groups)
    if caution:
        assert [line for line in found.cautions if caution in line], found.cautions
        return
    assert (found.code, found.cautions) == ("OK", [])
    for each, half in zip(found.derived, found.half_widths, strict=True):
        true = np.log(measured.truth[each.key]) if each.log else measured.truth[each.key]
        # By chance once in 10,000.
        assert each.value == pytest.approx(true, abs=2.0 * half), each.key


def lag_twice(trial):
    """Return the heights of the cell `CELL`, behind another lag of 1 ms."""
    truth, stay = CELL().truth, np.exp(-1.0)
    cell = Cell(truth["valve.orifice_diameter"], lag=truth[LAG], delay=truth[DELAY])
    height = cell.measure(trial.drive, HEIGHT_RATE) - cell.rest
    late = lfilter([stay, 1.0 - 2.0 * stay], [1.0, -stay], height)  # of straight lines
    return cell.rest + late + draw(4).normal(0.0, HEIGHT_NOISE, height.size)


def smooth(force):
    """Return a force whose noise is a third: a frame does not give by that of a sensor."""
    return np.convolve(np.pad(force, 4, "edge"), np.ones(9) / 9.0, "valid")


LOADED = lambda: measure_cell(draw(3), loaded=True)  # noqa: E731
SMALLER = {"fingertip.length": 9e-3, "fingertip.width": 7.2e-3, "fingertip.height": 7.2e-3}
#: Errors that residuals hardly show, and no verdict: what has it, what it is of them or of the scene, the
#: value that it changes, and by how much.
UNSEEN = {
    "late by 1 ms": (FINGER, lambda t: {"drive": np.interp(t.time + 1e-3, t.time, t.drive)}, "times.1", 0.46),
    "drift 2 mN/s": (FINGER, lambda t: {"answer": t.answer + 2e-3 * t.time}, "times.3", -0.17),
    "frame 20 N/mm": (FINGER, lambda t: {"drive": t.drive + 50e-6 * smooth(t.answer)}, "exponent", -0.07),
    "finger 10 % smaller": (FINGER, SMALLER, "contact.stiffness", 0.12),
    "viscosity by half": (CELL, {"fluid.viscosity": 2.4e-6}, "orifice_diameter", 0.11),
    "load by a tenth": (LOADED, lambda t: {"load": 1.1 * t.load}, "supply.high", 0.1),
    "a second lag": (CELL, lambda t: {"answer": lag_twice(t)}, "dead_time", 1.14),
}  # fmt: skip


@pytest.mark.parametrize("name", UNSEEN)
def test_an_error_that_residuals_may_not_show_changes_the_fit(name):
    make, error, key, share = UNSEEN[name]
    measured, scene, trials = make(), TAP, make().trials
    if callable(error):
        trials = [trial._replace(**error(trial)) for trial in trials]
    else:
        scene = digiclay.scene(TAP, error)
    found = fit("pulp" if make is FINGER else "cell", scene, trials, (), measured.groups)
    assert found.code == "OK"
    assert found.made.correlated < 4.0  # beyond 3 a caution tells
    pairs = zip(found.derived, found.half_widths, strict=True)
    ((each, half),) = [pair for pair in pairs if key in pair[0].key]
    true = measured.truth[each.key]
    # One and a half of its interval: the noise of this record.
    value, width = (np.exp(each.value), half) if each.log else (each.value, half / true)
    assert value / true - 1.0 == pytest.approx(share, abs=max(1.5 * width, 0.01))


def test_a_default_finger_is_no_improvement_and_a_hidden_knee_is_found():
    default = [
        Trial(str(number), *Finger().measure(path, 500.0), np.zeros(0))
        for number, path in enumerate([[(0.0, -3e-4), (0.2, 1.3e-3), (0.6, 1.3e-3)]])
    ]
    noisy = change(default, lambda t: t.answer + draw(3).normal(0.0, 10e-3, t.time.size))
    assert fit("pulp", TAP, noisy, (), BOTH).code == "NO_IMPROVEMENT"
    # This stroke has its knee below the supply: flow becomes turbulent.
    commands = measure_cell(draw(4)).trials[0].drive
    height = Cell(diameter=0.3e-3, stroke=2e-6).measure(commands, 1000.0)
    height += draw(4).normal(0.0, 1e-5, height.size)
    trial = Trial("1", np.arange(commands.size) * 1e-3, commands, height, np.zeros(height.size))
    found = fit("cell", TAP, [trial], (), ("stroke", "lag", "delay"))
    assert found.code == "OK"
    assert find_value(found, "valve.stroke") == pytest.approx(2e-6, rel=0.02)
    assert find_value(found, "valve.orifice_diameter") == pytest.approx(0.3e-3, rel=0.02)
    held = fit("cell", TAP, [trial], (), ("lag", "delay"))
    assert held.code == "NOT_IDENTIFIABLE"
    assert "by valve.stroke, which must be free" in held.message
    right = digiclay.scene(TAP, {"valve.stroke": 2e-6})
    held = fit("cell", right, [trial], (), ("lag", "delay"))
    assert held.code == "OK"
    assert find_value(held, "valve.orifice_diameter") == pytest.approx(0.3e-3, rel=2e-3)
    # The knee of a held stroke that does not exist is contradicted, too.
    trial = measure_cell(draw(4)).trials[0]
    short = digiclay.scene(TAP, {"valve.stroke": 0.5e-6})
    assert "by valve.stroke" in fit("cell", short, [trial], (), ("lag", "delay")).message


def test_the_law_of_a_pin_is_no_law_of_a_finger():
    _, trials = press()
    wrong = fit("pulp", TAP, trials, (), BOTH, "pin")
    right = fit("pulp", TAP, trials, (), BOTH)
    ratio = find_value(wrong, "contact.stiffness") / find_value(right, "contact.stiffness")
    assert ratio == pytest.approx(3.8, rel=0.05)  # of four fingers 3.7 to 4.0
    assert wrong.code == "OK"
    assert wrong.made.correlated < SEEN


def test_the_samples_are_fitted_and_run(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["fit", "fingertip", "--part", "pulp", "--holdout", "3", "--out", "finger"]) == 0
    out = capsys.readouterr().out
    assert "held out" in out
    assert sorted(path.name for path in (tmp_path / "finger").iterdir()) == [
        "fit.html",
        "fit.png",
        "fitted.toml",
    ]
    table = tomllib.loads((tmp_path / "finger/fitted.toml").read_text(encoding="utf-8"))
    scene = digiclay.scene("tap", with_="finger/fitted.toml")
    assert scene.section("contact").stiffness == table["contact"]["stiffness"] != 250.0
    assert scene.section("contact").share == TAP.section("contact").share
    assert scene.section("relaxation").times == tuple(table["relaxation"]["times"])
    spread = np.array(table["uncertainty"]["covariance"])
    assert spread.shape == (9, 9)
    np.testing.assert_allclose(spread, spread.T)

    again = ["fit", "valve", "--part", "cell", "--free", "supply,lag,delay", "--out", "finger"]
    assert main([*again, "--overwrite"]) == 1
    assert "supply.high" in capsys.readouterr().err
    assert not (tmp_path / "finger/fitted.toml").exists()
    assert main([*again[:4], "--holdout", "2", "--out", "cell"]) == 0
    assert digiclay.scene("tap", with_="cell/fitted.toml").delay.dead_time > 1.2e-3
    page = (tmp_path / "cell/fit.html").read_text(encoding="utf-8")
    assert "valve_lag.time_constant" in page
    assert "What residuals may not show" in page


def test_a_fit_is_cheap():
    trials = read_records([find_records("fingertip")], "pulp")
    model = make_model("pulp", TAP, trials, BOTH)
    calls, predict = [], model.predict
    model.predict = lambda free: calls.append(1) or predict(free)
    from digiclay_fit.estimation import estimate

    estimate(model)
    assert len(calls) < 120  # of 4 ms each
