"""Two gates in series per cell: half-selected and leaking cells, in runs and by formula."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from digiclay.core.base.errors import DigiclayError
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.model.lag import ValveLag
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session.run_scene import run
from digiclay.core.studies.omissions import find_omissions
from scipy.integrate import quad, solve_ivp

from tests.assemble import (
    AWAY,
    Scripted,
    assert_goes_on,
    assert_near,
    over_middle,
    record,
    refused_in_a_line,
    sample,
    scripted,
    table,
)

#: Control periods of a slot, and of the five lines in turn.
SLOT, PERIOD = 4, 5e-3
CYCLE = 5 * SLOT


def bed(lag=2e-3, sections=1, power=1, step=PERIOD, cells=5, **gates):
    gates = {
        "line_lag": lag,
        "sections": sections,
        "policy": "round_robin",
        "slot": SLOT * PERIOD,
        **gates,
    }
    return resolve(
        {
            "layout": {"rows": cells, "columns": cells},
            "valve": {"gap": "opening" if power == 1 else "stroke"},
            "conduit": "absent",
            "control": "absent",
            "valve_lag": {"time_constant": lag},
            "drive": gates,
            "simulation": {"physics_step": step},
            "trajectory": {"waypoints": over_middle((0.0, 0.5), (1.0, 0.5))},
        }
    )  # fmt: skip


class Middle(Scripted):
    """A script that asks for the middle pin: with its neighbors, nine are active."""

    def locate(self, memory, touched):
        return memory, (0.0, 0.0, 1e-3)


class Wide(Scripted):
    """A script that asks for the pins around the middle, 9 mm to each side."""

    def locate(self, memory, touched):
        return memory, (0.0, 0.0, 9.1e-3)


def rise(scene, count, command=0.0):
    """Return the rise of the pins, (5, 5), m, while the middle one is commanded; the free speed, m/s."""
    system = assemble(scene)
    if command:
        only = Middle(lambda t, x, y: command * (np.hypot(x, y) < 1e-4), PERIOD)
        system = replace(system, controller=only)
    # Idle cells are as of the last renewal of the set, every 8 periods.
    height = record(system, AWAY, count + 1).height
    return (height[-1] - height[0]).reshape(5, 5), system.fastest


def pulse(lag, overlap, power, follows):
    """Return for how long an open pair lets through the same as a half-selected one, s, by quadrature.

    The column opens at 0 and shuts after a slot; the line of the cell shuts, or opens, `overlap` later.
    """

    def conduct(t):
        def decay(since):
            return math.exp(-max(since, 0.0) / lag)

        column = decay(t) if follows else 1.0 - decay(t)
        line = 1.0 - decay(t - overlap) if follows else decay(t - overlap)
        first, second = line**power, column**power
        return 2.0 * first * second / (first + second + 1e-300)

    return quad(conduct, 0.0, 40.0 * lag, points=[overlap], limit=200)[0]


@table(
    "lag, overlap, power",
    {
        "gates that overlap by their lag": (2e-3, 0.0, 1),
        "quick gates": (0.2e-3, 0.0, 1),
        "flow as the square of the lift": (2e-3, 0.0, 2),
        "lines that follow columns": (2e-3, 1.5e-3, 1),
        "lines a period late": (1e-3, 5e-3, 1),
    },
)
def test_a_half_selected_pin_moves_by_the_free_speed_times_the_pulse_of_its_gates(
    lag, overlap, power
):
    cycles = 4
    moved, free = rise(bed(lag, power=power, overlap=overlap), cycles * CYCLE + SLOT, 1.0)
    before, after = pulse(lag, overlap, power, False), pulse(lag, overlap, power, True)
    if not overlap and power == 1:
        assert before == after == pytest.approx(lag, rel=1e-6)  # dh = v0 tau
    # Lines are addressed in turn: that before the middle one is half-selected as the column opens
    # for the middle one, that after it as the column shuts.
    assert moved[1, 2] == pytest.approx(cycles * free * before, rel=0.02)
    assert moved[3, 2] == pytest.approx(cycles * free * after, rel=0.02)
    assert np.abs(moved[:, [0, 1, 3, 4]]).max() == 0.0


@table(
    "sections, command, place, wanted",
    {
        "both gates shut, no cell active": (1, 0.0, (0, 0), -1.0),
        "both gates shut": (1, 1.0, (0, 0), -1.0),
        "the line's open": (5, 1.0, (2, 0), -2.0),
        "the line's open for a fifth of the time": (1, 1.0, (2, 0), -2.0 * 0.2 - 0.8),
        "a column of another set open": (5, 1.0, (0, 2), -1.0),
        "the column's open, upwards, for a fifth of the time": (1, 1.0, (0, 2), 2.0 * 0.2 - 0.8),
    },
)
def test_an_idle_pin_creeps_by_the_leak_of_its_gates(sections, command, place, wanted):
    leak, count = 1e-3, 16 * CYCLE
    moved, free = rise(bed(0.02e-3, sections, leak=leak), count, command)
    assert moved[place] == pytest.approx(wanted * free * leak * count * PERIOD, rel=0.02)


def test_pins_where_other_lines_and_columns_cross_are_half_selected_too():
    # Two pins off the middle, one to the right, one behind, are raised in turn: the columns of one
    # change as the line of the other does.
    scene = bed(policy="needed", cells=11)
    system = assemble(scene)
    both = Wide(lambda t, x, y: np.hypot(x + y - 9e-3, x * y * 1e3) < 1e-4, PERIOD)
    system = replace(system, controller=both)
    run = record(system, AWAY, 10 * SLOT)
    x, y = system.grid.x, system.grid.y
    corner = np.flatnonzero((np.abs(x - 9e-3) < 1e-4) & (np.abs(y - 9e-3) < 1e-4))
    moved = (run.height[-1] - 40e-3)[corner] / system.fastest / 2e-3
    assert moved == pytest.approx(9.0, rel=0.02)
    # Commands are told where they act: those of a shut line are 0.
    assert np.count_nonzero(run.command[:-1]) == len(run.command) - 1
    assert run.last.active.cells.size < 121


def test_a_pressed_pin_with_gates_moves_as_scipy_says():
    lag, leak, commands = 2e-3, 1e-2, [0.5, 1.0, 0.8, 0.0, -0.7, 0.9] * 5
    scene = bed(lag, sections=5, leak=leak, step=1e-3)
    finger = scene.fingers[0]
    path = resolve({"trajectory": {"waypoints": over_middle((0.0, 0.041), (0.15, 0.0388))}})
    scene = scene.with_sections(trajectory=path.section("trajectory"))
    script = scripted(lambda t, x, y: commands[round(t / PERIOD)] * (np.hypot(x, y) < 1e-4))
    system = replace(assemble(scene), controller=script(PERIOD))
    run = record(system, scene.trajectories()[0], len(commands))
    b, m, share = 250.0, 2000.0, finger.contact.share
    rates, weights = 1.0 / np.array([4e-3, 70e-3, 1.4]), np.array([0.62, 0.20, 0.10])
    free, area, top = system.fastest, system.cell.actuator.area, scene.trajectories()[0]

    def rate(t, y, command):
        under = top.poses(np.array([t]))[0, 2]
        pull = b / m * math.expm1(m * max(y[0] - under, 0.0))
        force = share * max(pull - float(weights @ y[3:]), 0.0)
        line = leak + (1.0 - leak) * y[1]
        column = (1.0 - leak) * abs(y[2])
        driven = 2.0 * line * column / (line + column)
        leaked = 2.0 * line * (column + leak) / (line + column + leak) - driven
        lift = math.copysign(driven, y[2]) - leaked
        speed = free * abs(lift) * (math.copysign(1.0, lift) - force / area / 0.5e5)
        wanted = math.copysign(abs(command) / (2.0 - abs(command)), command)
        return [speed, (1.0 - y[1]) / lag, (wanted - y[2]) / lag, *(rates * (pull - y[3:]))]

    y, found = np.array([40e-3, *[0.0] * 5]), []
    seen = [0.0, *commands]  # the dead time of the column and of the line is 1 ms
    for number in range(len(commands)):
        for start, end, command in ((0.0, 1e-3, seen[number]), (1e-3, PERIOD, seen[number + 1])):
            span = number * PERIOD + start, number * PERIOD + end
            if number == 0 and start == 0.0:
                continue  # all gates are shut, and the finger is away
            done = solve_ivp(rate, span, y, "DOP853", args=(command,), rtol=1e-9, atol=1e-12)
            y = done.y[:, -1]
        found.append(y[0])
    assert np.ptp(found) > 0.2e-3
    # Within the first millisecond, with both gates shut, a pin leaks 0.24 um.
    assert_near(run.height[1:, 12], found, 3e-6)


def test_the_active_set_stays_small_and_a_session_goes_on_from_its_state():
    scene = sample("ridge_mound_valley", "drive.line_lag=0.5e-3", "drive.leak=1e-3")
    systems = assemble(scene), assemble(scene.with_sections(drive=None))
    gated, plain = (
        [state.active.cells.size for state in periods(one, scene.trajectories(), begin(one), 500)]
        for one in systems
    )
    # Cells where lines and columns of the others cross are added: a box around the disc.
    assert sum(gated) < 1.5 * sum(plain)
    assert_goes_on(scene, 400, 50)


def test_a_history_has_the_creep_of_idle_cells_and_says_why_it_has_no_error():
    done = run(bed(leak=1e-3))
    fall = 40e-3 - done.history["height"]
    assert fall[-1].min() > 0.0
    assert fall[-1] == pytest.approx(2.0 * fall[100], rel=0.1)
    assert "lines' gates" in done.estimate_errors().summary()
    with refused_in_a_line(DigiclayError, "run.budget must be left out .* lines' gates"):
        find_omissions(done.scene, 20e-6)


@table(
    "sections, said",
    {
        "a leak without gates": ({"drive": {"leak": 1e-3}}, "drive.leak must be 0 without gates"),
        "an overlap without gates": ({"drive": {"overlap": 1e-3}}, "drive.overlap must be 0"),
        "a volume without gates": (
            {"drive": {"trapped_volume": "1 mm3"}},
            "drive.trapped_volume must be 0 without gates of lines",
        ),
        "a volume that leaks": (
            {"drive": {"line_lag": 1e-3, "leak": 1e-3, "trapped_volume": 1e-9}},
            "drive.trapped_volume must be 0 with drive.leak",
        ),
        "gates quicker than any": (
            {"drive": {"line_lag": 1e-300}},
            "drive.line_lag must be 0 or at least 1e-09 s",
        ),
        "lines that open in the next slot": (
            {"drive": {"line_lag": 1e-3, "slot": 10e-3, "overlap": 11e-3}},
            "drive.overlap must be at most a slot, 0.01 s",
        ),
        "valves without lag": (
            {"drive": {"line_lag": 1e-3}, "valve_lag": "absent"},
            "valve_lag must be given with drive.line_lag",
        ),
        "another stepper": (
            {"drive": {"line_lag": 1e-3}, "simulation": {"stepper": "heun"}},
            "simulation.stepper must be bernoulli or richardson with drive.line_lag",
        ),
        "motors": (
            {"drive": {"line_lag": 1e-3}, "valve": {"law": "motor"}, "conduit": "absent"},
            "valve.law must be orifice with drive.line_lag",
        ),
        "forces by the valve": (
            {"drive": {"line_lag": 1e-3}, "sensors": {"observer": "valve"}},
            "sensors.observer must be none with drive.line_lag",
        ),
        "a hand": ({"drive": {"line_lag": 1e-3}, "hand": {}}, "hand must be absent with drive"),
    },
)
def test_what_gates_cannot_be_with_is_refused(sections, said):
    with refused_in_a_line(DigiclayError, said):
        resolve({"trajectory": {"waypoints": over_middle((0.0, 0.5), (1.0, 0.5))}, **sections})


def test_two_gates_without_a_line_s_are_the_bed_as_it_was():
    parts = (replace(bed().drive, line_lag=0.0), bed().drive)
    kinds = [type(assemble(bed().with_sections(drive=part)).cell.lag) for part in parts]
    assert kinds[0] is ValveLag is not kinds[1]


@table(
    "modulus, command, gates",
    {
        "oil": (1e9, 1.0, {}),
        "oil with 1 % air": (1e7, 1.0, {}),
        "air": (1e5, 1.0, {}),
        "downwards, flow as the square of the lift": (1e7, -1.0, {"power": 2}),
    },
)
def test_a_trapped_volume_moves_a_pin_by_a_packet_per_turn_of_its_gates(modulus, command, gates):
    cycles, volume = 4, 1e-9
    # The line of a cell opens 3 ms after the column has shut.
    scene = bed(0.2e-3, overlap=3e-3, trapped_volume=volume, bulk_modulus=modulus, **gates)
    moved, _ = rise(scene, cycles * CYCLE + SLOT, command)
    packet = command * volume * 0.5e5 / (modulus * scene.actuator.area)
    assert moved[3, 2] == pytest.approx(cycles * packet, rel=0.02)
    assert np.abs(moved[:, [0, 1, 3, 4]]).max() == 0.0


@table(
    "line, modulus, top, gates",
    {
        "its own line: both together": (2, 1e7, 0.5, {}),
        "its line after the column": (1, 1e6, 0.5, {"overlap": 3e-3}),
        "as the column shuts": (1, 1e6, 0.5, {}),
        "as the column opens": (3, 1e6, 0.5, {}),
        "slow gates": (1, 1e7, 0.5, {"lag": 2e-3}),
        "air": (3, 1e5, 0.5, {}),
        "pressed, after the column": (1, 1e7, 39.5e-3, {"overlap": 3e-3}),
        "pressed, as the column opens": (3, 1e7, 39.5e-3, {}),
    },
)
def test_a_pin_over_a_trapped_volume_moves_as_scipy_says(line, modulus, top, gates):
    lag, cycles = gates.get("lag", 0.2e-3), 2
    scene = bed(**{"lag": lag, **gates}, trapped_volume=1e-9, bulk_modulus=modulus)
    still = resolve({"trajectory": {"waypoints": over_middle((0.0, top), (1.0, top))}})
    scene = scene.with_sections(trajectory=still.section("trajectory"), relaxation=None)
    system = assemble(scene)
    place = system.grid.x[5 * line + 2], system.grid.y[5 * line + 2]
    script = scripted(lambda t, x, y: 1.0 * (np.hypot(x - place[0], y - place[1]) < 1e-4))
    system = replace(system, controller=script(PERIOD))
    run = record(system, scene.trajectories()[0], cycles * CYCLE)
    area, contact = system.cell.actuator.area, scene.fingers[0].contact
    gate = 2.0 * system.fastest * area / 0.5e5  # m3/s/Pa of an open one
    late = 1e-3 + np.array([gates.get("overlap", 0.0), 0.0])

    def load(rise):
        return contact.share * 0.125 * math.expm1(2000.0 * max(40e-3 + rise - top, 0.0)) / area

    def rate(t, y, command):
        given, taken = gate * y[1:3] * (y[3] - load(y[0]), 0.5e5 - y[3])
        return [given / area, *(command - y[1:3]) / lag, (taken - given) * modulus / 1e-9]

    y = np.array([0.0, 0.0, 0.0, load(0.0)])
    edges = np.unique(
        [
            0.0,
            cycles * CYCLE * PERIOD,
            *np.add.outer(late, np.arange(5 * cycles) * SLOT * PERIOD).ravel(),
        ]
    )
    for start, end in pairwise(edges):
        slots = np.floor((0.5 * (start + end) - late) / (SLOT * PERIOD)) % 5
        wanted = (slots == (2, line)) * (0.5 * (start + end) > late)
        # m, shares and Pa: the rises are micrometers.
        some = [1e-11, 1e-6, 1e-6, 1.0]
        done = solve_ivp(rate, (start, end), y, "Radau", args=(wanted,), rtol=1e-5, atol=some)
        y = done.y[:, -1]
    assert run.height[-1, 12] - 40e-3 == pytest.approx(y[0], rel=0.02)


#: Control periods for which a pin is asked for, longer than a set of active cells serves.
TURN = 12


class Alternating(Scripted):
    """A script that asks for a pin in front on the left and one behind on the right, by way of the middle."""

    def locate(self, memory, touched):
        return memory, (*2 * [find_side(memory)], 1e-3)


def find_side(period):
    """Return where the pin of a period is, x = y, m."""
    return (-9e-3, 0.0, 9e-3, 0.0)[period // TURN % 4]


def test_an_idle_pin_gets_the_packets_of_a_line_and_a_column_that_open_at_other_times():
    rounds, modulus = 3, 1e6
    scene = bed(1e-6, policy="needed", cells=11, trapped_volume=1e-9, bulk_modulus=modulus)
    system = assemble(scene)

    def command(t, x, y):
        side = find_side(round(t / PERIOD))
        return (side != 0.0) * (np.hypot(x - side, y - side) < 1e-4)

    system = replace(system, controller=Alternating(command, PERIOD))
    run = record(system, AWAY, rounds * 4 * TURN)
    packet = 1e-9 * 0.5e5 / (modulus * scene.actuator.area)
    moved = (run.height[-1] - 40e-3).reshape(11, 11) / packet
    assert run.last.active.cells.size < 20
    # The line in front has no turn after the last of the column on the right.
    assert moved[2, 8] == pytest.approx(rounds - 1, rel=0.02)
    assert moved[8, 2] == pytest.approx(rounds, rel=0.02)
