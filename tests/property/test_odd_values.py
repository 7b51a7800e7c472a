"""Odd scenes, states, takes, runs and bytes are taken, or refused in one line.

`DIGICLAY_HYPOTHESIS=many` tries a hundred times as many odd inputs.
"""

import io
import itertools
import json
import tempfile
import zipfile
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from digiclay.core.base.errors import DigiclayError, SceneError, StateError
from digiclay.core.control.methods import METHODS
from digiclay.core.control.orders import Orders, Verb, place, repeat_order
from digiclay.core.engine.simulation import advance, begin, periods
from digiclay.core.files.tables import parse_tables
from digiclay.core.metrics.summary import compute_metrics
from digiclay.core.model.trajectory import interpolate_poses
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import Setting, find, load
from digiclay.core.scene.schema import FINGER_SECTIONS, OPTIONAL, SECTIONS, STEPPERS
from digiclay.core.scene.toml_table import ABSENT, FINGERS, PRESETS, format_scene, resolve
from digiclay.core.session import snapshot
from digiclay.core.session.finished_run import HISTORY_ARRAYS, read_run
from digiclay.core.session.run_scene import run
from digiclay.core.session.snapshot import FIRST, START
from digiclay.core.session.take import Take, from_bytes, replay, to_bytes
from digiclay.core.surface import features
from digiclay.core.surface.formed import make_formed
from digiclay.core.surface.skins import fit_skin
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tests.assemble import path

#: Numbers, those at the ends of what there is and beyond among them; and what is no number.
NUMBERS = st.one_of(
    st.floats(),
    st.integers(),
    st.sampled_from([1e-9, 1e-6, 1e-3, 0.5, 1e3, 10**309, -(10**400), True]),
)
OTHERS = st.one_of(
    st.text(max_size=3),
    st.lists(NUMBERS, max_size=4),
    st.dictionaries(st.just("a"), NUMBERS),
    st.none(),
    st.sampled_from(
        ["1e400 mm", "5e-324 mm", "-1 mm", "nan s", "inf Pa", "1 parsec", "absent", "é" * 50]
    ),
)
#: Types of arrays that no file of ours has.
TYPES = st.sampled_from(
    ["M8[s]", "m8[s]", "c16", "U3", "S2", "?", "i8", "u1", "f4", "f2", "f16", ">f8", "V8", "f4,i4"]
)
#: Most cells and control periods of a session that is begun, and numbers of a row that it
#: announces.
CELLS, PERIODS, RECORDED = 200, 3, 1_000_000
#: One of so many is true.
OFTEN, SELDOM, RARELY = (
    st.integers(0, last).map(lambda number: number == 0) for last in (1, 3, 19)
)
POSE = [0.0, 0.0, 37e-3, 1.0, 0.0, 0.0, 0.0]


def make_odd(draw, usual):
    """Return something in place of a usual value: a number, one near the usual one, or none at all."""
    if isinstance(usual, float) and draw(OFTEN):
        return usual * 10.0 ** draw(st.integers(-12, 12))
    if isinstance(usual, tuple) and draw(OFTEN):
        return [make_odd(draw, value) for value in usual]
    return draw(st.one_of(NUMBERS, NUMBERS, NUMBERS, OTHERS))


def spoil(draw, tree):
    """Put something odd in place of a value, or seldom of a whole part, of nested tables and lists."""
    while keys := list(tree) if isinstance(tree, dict) else list(range(len(tree))):
        key = draw(st.sampled_from(keys))
        if not isinstance(tree[key], dict | list) or draw(SELDOM):
            tree[key] = make_odd(draw, tree[key])
            return
        tree = tree[key]


@cache
def write_scene(method):
    """Return the text of a small scene under a method, with all of its sections."""
    sections = {"layout": {"rows": 3, "columns": 3}, "sensors": {}, "shape": {}}
    sections["control"] = method if method == ABSENT else {"method": method}
    if METHODS.get(method) and METHODS[method].blister is not None:
        sections["blister"] = {"radius": 1e-3, "edge_radius": 1.5e-3, "flat_radius": 5e-4}
    return format_scene(resolve(sections))


def make_tables(draw):
    """Return the tables of a scene, some of them left out, in which some values are odd."""
    method = draw(st.sampled_from([*METHODS, ABSENT]))
    tables = parse_tables(write_scene(method)) | {"preset": draw(st.sampled_from(list(PRESETS)))}
    given = sorted({*SECTIONS, "trajectory"} & tables.keys() - {"layout", "control", "blister"})
    for section in draw(st.sets(st.sampled_from(given), min_size=len(given) // 2)):
        del tables[section]
    for section in OPTIONAL:
        if section != "control" and draw(RARELY):
            tables[section] = ABSENT
    tables["layout"] |= {side: draw(st.integers(1, 5)) for side in ("rows", "columns")}
    tables.setdefault("simulation", {})["stepper"] = draw(st.sampled_from(list(STEPPERS)))
    for _ in range(draw(st.integers(1, 3))):
        spoil(draw, tables)
    if draw(SELDOM):
        # The same finger none, one or two times in a list.
        finger = {section: tables.pop(section) for section in FINGER_SECTIONS if section in tables}
        tables[FINGERS] = (
            make_odd(draw, [finger]) if draw(OFTEN) else [finger] * draw(st.integers(0, 2))
        )
    return tables


def spoil_text(draw):
    """Return the text of a scene with some letters, or a value, turned into others."""
    lines = write_scene("virtual_master").split("\n")
    for _ in range(draw(st.integers(1, 2))):
        number = draw(st.integers(0, len(lines) - 1))
        key, equals, _ = lines[number].partition(" = ")
        if equals and draw(OFTEN):
            lines[number] = f"{key} = {str(draw(NUMBERS)).lower()}"
        else:
            at = draw(st.integers(0, len(lines[number])))
            letter = draw(st.characters(max_codepoint=299))
            lines[number] = lines[number][:at] + letter + lines[number][at + 1 :]
    return "\n".join(lines)


def begin_scene(draw):
    """Take in a scene and begin its session."""
    if draw(SELDOM):
        try:
            tables = parse_tables(spoil_text(draw))
        except (ValueError, RecursionError):  # `scene_source.read_table` adds file and line
            return
    else:
        tables = make_tables(draw)
    scene = resolve(tables)
    assert resolve(parse_tables(format_scene(scene))) == scene
    if scene.cells > CELLS or scene.cells * scene.periods > RECORDED:
        return
    asked = itertools.count(1)
    json.dumps(run(scene, stopped=lambda: next(asked) >= PERIODS).metrics, allow_nan=False)


@cache
def press_half(method):
    """Return a small bed under a method, and its state in the middle of a press."""
    system = assemble(
        resolve({"layout": {"rows": 6, "columns": 10}, "control": {"method": method}})
    )
    *_, last = periods(system, [path((0, 0, 0, 42), (0.2, 0, 0, 37))], begin(system), 50)
    return system, snapshot.dump(system, last)


def spoil_state(draw, data):
    """Return a state with odd values in its header, in its arrays, or with other bytes."""
    first = len(START) + 4
    length = int.from_bytes(data[len(START) : first], "little")
    header, arrays = json.loads(data[first : first + length]), bytearray(data[first + length :])
    for _ in range(draw(st.integers(1, 3))):
        kind = draw(st.sampled_from(["header", "header", "header", "<f8", "<i8", "byte"]))
        if kind == "header":
            spoil(draw, header)
        elif kind == "byte":
            arrays[draw(st.integers(0, len(arrays) - 1))] = draw(st.integers(0, 255))
        else:
            at = 8 * draw(st.integers(0, len(arrays) // 8 - 1))
            arrays[at : at + 8] = round_to(draw(NUMBERS), np.dtype(kind)).tobytes()
    start = START
    if draw(SELDOM):
        start, gathered = FIRST, header.get("gathered")
        header["gathered"] = gathered | {"reach": None} if isinstance(gathered, dict) else gathered
    head = json.dumps(header).encode()
    return start + len(head).to_bytes(4, "little") + head + bytes(arrays)


def round_to(number, kind):
    """Return a number as one of numpy's; one beyond all of them is infinite."""
    with np.errstate(all="ignore"):
        return np.float64(float(number) if abs(number) < 10**309 else np.inf).astype(kind)


def go_on(draw):
    """Take up an odd state and go on from it."""
    system, data = press_half(draw(st.sampled_from(list(METHODS))))
    finger = np.tile(POSE, (2, 1, 1))
    for take_up in (snapshot.load, snapshot.transfer_heights):
        state = take_up(system, spoil_state(draw, data))
        for _ in range(PERIODS):
            poses = interpolate_poses(finger, system.instants / system.period)
            (trace,) = system.trace(poses, state.period)
            state = advance(system, state, trace)
        snapshot.dump(system, state)


def spoil_array(draw, usual):
    """Return an array of another type or shape, or with an odd number in it."""
    kind = draw(st.sampled_from(["type", "shape", "number", "near", "near", "near"]))
    if kind == "type":
        other = np.dtype(draw(TYPES))
        with np.errstate(all="ignore"):
            return usual.astype(other) if other.names is None else np.zeros(usual.shape, other)
    if kind == "shape":
        flat = usual.ravel()
        other = draw(st.integers(0, 6))
        return (flat, usual[None], flat[:0], flat[:1], usual.T, np.array(3.0), flat[:-1])[other]
    changed = usual.copy()
    flat, at = changed.reshape(-1), draw(st.integers(0, usual.size - 1))
    near = flat[at] * draw(st.sampled_from([0.0, 0.9, 1.1, -1.0]))
    flat[at] = round_to(near if kind == "near" else draw(NUMBERS), usual.dtype)
    return changed


def pack(draw, arrays):
    """Return arrays as a file .npz, some of them odd, or their heads."""
    for name in draw(
        st.lists(st.sampled_from(sorted(arrays)), min_size=1, max_size=2, unique=True)
    ):
        arrays = arrays | {name: spoil_array(draw, arrays[name])}
    heads = ((b"False", b"True "), (b"), }", b"L),}"), (b"descr", b"descx"), (b"<f8", b"<M8"))
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for name, array in arrays.items():
            part = io.BytesIO()
            np.lib.format.write_array(part, np.asarray(array), allow_pickle=False)
            data = part.getvalue()
            changed = data.replace(*draw(st.sampled_from(heads)), 1) if draw(RARELY) else data
            archive.writestr(f"{name}.npy", changed)
    return file.getvalue()


@cache
def record():
    """Return a short run of a small bed, and a take of the same."""
    small = {"layout": {"rows": 6, "columns": 11}, "simulation": {"duration": 0.05}, "recorder": {}}
    scene = resolve(small)
    start = snapshot.dump(assemble(scene), begin(assemble(scene)))
    surface = np.where(np.arange(66) % 3, 0.041, np.nan)
    smooth = repeat_order(2, Verb.SMOOTH, 0.0, 0.0, 5e-3, 0.5)
    orders = Orders(np.vstack([smooth, place(1, surface).rows]), (surface,))
    return run(scene), Take(scene, start, np.tile(POSE, (4, 1, 1)), start, orders)


def replay_take(draw):
    """Read a take with odd arrays and replay it."""
    with np.load(io.BytesIO(to_bytes(record()[1]))) as file:
        arrays = dict(file)
    for _ in replay(from_bytes(pack(draw, arrays))):
        pass


def evaluate_run(draw):
    """Read a run with odd arrays and evaluate it."""
    result = record()[0]
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "scene.toml").write_text(format_scene(result.scene), encoding="utf-8")
        (Path(folder) / "history.npz").write_bytes(pack(draw, result.history))
        finished = read_run(Path(folder), *HISTORY_ARRAYS)
    json.dumps(compute_metrics(finished.history, finished.scene.set_point), allow_nan=False)
    features.find(fit_skin(make_formed(finished.history, -1), "bilinear", 1, 0.0))


@pytest.mark.parametrize(
    "use, count",
    [(begin_scene, 120), (go_on, 80), (replay_take, 50), (evaluate_run, 50)],
)
def test_what_is_odd_is_taken_or_refused_in_one_line(use, count):
    refusals = []

    @settings(max_examples=count * settings.default.max_examples // 50)
    @given(st.data())
    def check(data):
        refusal = ""
        try:
            use(data.draw)
        except DigiclayError as error:
            refusal = str(error)
        assert "\n" not in refusal
        refusals.append(refusal)

    check()
    # Neither is everything refused, nor is everything taken: the cases reach beyond the first
    # check.
    assert 0.02 < refusals.count("") / len(refusals) < 0.98


@pytest.mark.parametrize(
    "key, value, said",
    [
        ("layout.rows", "1" + 400 * "0", "rows must be a finite number (got a whole number of 401 digits)"),
        ("layout.rows", "1" + 300 * "0", "rows must be at most 10000 (got a whole number of 301 digits)"),
        ("layout.rows", "0x" + 900 * "f", "finite number (got a whole number of 1084 digits)"),
        ("valve.discharge_slope", "5e-324", "slope must be at least 1e-09 (got 4.94066e-324)"),
        ("simulation.control_period", "1e300", "simulation.control_period must be at most 1e+06 s"),
        ("supply.low", "-1e300", "supply.low must be at least -1e+10 Pa"),
        ("relaxation.times", "[1e300, 1, 1]", "relaxation.times must be at most 1e+06 s"),
        ("recorder.every", "1" + 30 * "0", "at most 1e+09 (got a whole number of 31 digits)"),
    ],
)  # fmt: skip
def test_a_number_beyond_all_devices_is_refused_with_its_bound(key, value, said):
    with pytest.raises(SceneError) as caught:
        load(find("slow_press"), [Setting(key, value)])
    assert said in str(caught.value)


@pytest.mark.parametrize(
    "settings, said",
    [
        # 1000 steps of the adaptive stepper, each cut into 128, would make a plan of terabytes.
        ("bernoulli 4e-6", "must be at least a 1000th of simulation.control_period, 0.005 s (got"),
        ("adaptive 4e-4", "a 10th of simulation.control_period, 0.005 s, with the stepper adaptive"),
        ("richardson 9e-6", "a 500th of simulation.control_period, 0.005 s, with the stepper rich"),
        ("", "must increase from waypoint to waypoint by at least 1e-09 s"),
    ],
)  # fmt: skip
def test_steps_whose_plan_would_fill_the_memory_and_waypoints_at_one_time_are_refused(
    settings, said
):
    points = [{"time": time, "position": [0, 0, 0.046]} for time in (0.0, 5e-324, 1.0)]
    stepper, _, step = settings.partition(" ")
    simulation = {"simulation": {"stepper": stepper, "physics_step": float(step or 1.0)}}
    with pytest.raises(DigiclayError) as caught:
        resolve(simulation if settings else {"trajectory": {"waypoints": points}})
    assert said in str(caught.value)


@pytest.mark.parametrize("waypoints", [[], [3], {"time": 0}, 5e-324])
def test_waypoints_that_are_no_list_of_tables_are_refused_by_name(waypoints):
    with pytest.raises(DigiclayError, match=r"waypoints must .* \(got"):
        resolve({"trajectory": {"waypoints": waypoints}})


SYSTEM, KEPT = press_half("virtual_master")


def refusals(data):
    """Take up bytes both ways; return why each is refused, all that may go wrong, "" if it is not."""
    told = []
    for take_up in (snapshot.load, snapshot.transfer_heights):
        refused = ""
        try:
            state = take_up(SYSTEM, data)
        except StateError as error:
            refused = str(error)
        assert "\n" not in refused
        assert refused or np.isfinite(state.row(0)).all()
        told.append(refused)
    return told


#: In the header most bytes have a meaning of their own.
places = st.one_of(st.integers(0, len(KEPT) - 12), st.integers(0, 700), st.integers(0, 700))


@settings(max_examples=200)
@given(places, st.binary(max_size=12))
def test_bytes_that_are_changed_are_noticed_or_make_another_state(at, some):
    data = KEPT[:at] + some + KEPT[at + len(some) :]
    told = refusals(data)
    assert data != KEPT or told == ["", ""]


@given(st.integers(0, len(KEPT)), st.binary(max_size=40))
@example(len(KEPT), b"\0")
@example(len(KEPT) - 8, b"")
def test_bytes_that_are_cut_or_added_are_noticed(at, some):
    assert all(refusals(KEPT[:at] + some + KEPT[at:])) == bool(some)
    assert all(refusals(KEPT[:at])) == (at < len(KEPT))
    assert all(refusals(some))
    assert all(refusals(KEPT[:17] + some))
