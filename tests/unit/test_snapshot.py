"""A state, a controller's memory in it, is kept as bytes and taken up bit for bit, or refused in one line."""

import math
from dataclasses import fields
from enum import IntEnum
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from digiclay.core.base.errors import StateError
from digiclay.core.base.modes import Mode
from digiclay.core.control.methods import METHODS
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session.snapshot import START, dump, flatten, load, rebuild, transfer_heights
from numpy.testing import assert_array_equal
from numpy.typing import NDArray

from tests.assemble import path

SIZES = {"rows": 9, "columns": 11}
PRESS = path((0.0, -6, 0, 42), (0.2, -6, 0, 36), (0.6, 6, 2, 36), (0.8, 6, 2, 46))


def bed(**tables):
    return assemble(resolve({"layout": SIZES, **tables}))


def system_of(method="virtual_master", **tables):
    return bed(**{"control": {"method": method}, **tables})


def run(system, state, count):
    *_, last = periods(system, [PRESS], state, count)
    return last


def same(first, second):
    return pack(first) == pack(second)


def pack(state):
    """Return all that a state holds, its arrays as bytes."""
    arrays = []
    active = tuple(getattr(state.active, field.name) for field in fields(state.active))
    parts = flatten(state._replace(active=active), arrays)
    return parts, [array.tobytes() for array in arrays]


RISING = {"shape": {"file": "ripple", "rise": "10 mm"}}
MATRIX = {"drive": {"sections": 3, "slot": "20 ms", "share": True}}  # kept in mid-slot
SENSORS = {"sensors": {"delay": 3, "observer": "valve", "height_noise": "1 um"}}  # that remember


@pytest.mark.parametrize(
    "method, tables",
    [
        *((method, {}) for method in METHODS),
        ("virtual_master", SENSORS),
        ("viscous", RISING),
        ("virtual_master", MATRIX),
        ("virtual_master", {"hand": {}}),
    ],
    ids=str,
)
def test_a_session_goes_on_from_a_kept_state_bit_for_bit(method, tables):
    system = system_of(method, **tables)
    half = run(system, begin(system), 70)
    data = dump(system, half)
    before = bytes(data)
    # 10 rows of float64, the time of aging and a mode for each of 99 cells, and a header.
    assert len(data) < 2 * 99 * (8 * system.rows.count + 9) + 4000
    taken_up = load(system, data)
    assert same(taken_up, half)
    assert same(run(system, taken_up, 90), run(system, half, 90))
    assert data == before  # the state that was taken up has its own arrays


@cache
def kept():
    system = system_of()
    return system, dump(system, run(system, begin(system), 70))


@pytest.mark.parametrize(
    "tables, said",
    [
        ({"layout": {"rows": 9, "columns": 12}}, "number of cells"),
        ({"relaxation": "absent"}, "rows of a cell"),
        ({"simulation": {"control_period": "10 ms"}}, "control period"),
        ({"control": {"method": "plastic"}}, "memory of the controller"),
        ({"control": {"method": "viscous"}}, "memory of the controller"),
    ],
)
def test_a_state_of_another_bed_is_refused(tables, said):
    _, data = kept()
    with pytest.raises(StateError, match=said):
        load(bed(**tables), data)


def header_replaced(data, old, new):
    first = len(START) + 4
    length = int.from_bytes(data[len(START) : first], "little")
    text = data[first : first + length]
    assert old in text
    text = text.replace(old, new, 1)
    return START + len(text).to_bytes(4, "little") + text + data[first + length :]


LONG = b"0" * 400


@pytest.mark.parametrize(
    "old, new",
    [
        *((b'"cells": 99', b'"cells": ' + wrong) for wrong in (b"-99", b"1e99", b"99999999999999")),
        (b'"near": ', b'"near": 1'), (b'"peak": ', b'"peak": NaN, "p": '), (b'"memory"', b'"m"'),
        (b'"memory": ["Master"', b'"memory": ["State"'),
        (b'"memory": ["Master", ', b'"memory": ["Master", 9'),
        (b'"memory": ["Master", ', b'"memory": ["Master", null, '),
        (b'"arrays": []', b'"arrays": [["O", [1]]]'), (b'"rows": [', b'"rows": ["a", '),
        (b'"reach": [', b'"reach": [1, '), (b'"memory": ', b'"memory": ' + b"[" * 100_000),
        (b'"period": 70', b'"period": 1' + LONG), (b'"peak": ', b'"peak": 1' + LONG + b', "p": '),
        *((b'"reach": [', b'"reach": [' + wrong + b'], "r": [') for wrong in (
            b"1" + LONG + b", 0, 0", b"2e9, 0, 0", b"0, 0, 2e9",
        )),
    ],
)  # fmt: skip
def test_a_damaged_header_is_refused(old, new):
    system, data = kept()
    with pytest.raises(StateError):
        load(system, header_replaced(data, old, new))


@cache
def kept_of_twelve():
    """Return a bed that one of twelve fingertips has pressed."""
    system = assemble(resolve({"layout": SIZES, "control": {"method": "hybrid"}}).with_fingers(12))
    paths = [PRESS, *[path((0.0, 0, 0, 90), (0.8, 0, 0, 90))] * 11]
    *_, state = periods(system, paths, begin(system), 70)
    state.rows[-1, 3] = -0.0
    return system, state, dump(system, state)


def test_fingertips_that_touch_nothing_take_next_to_no_room_and_nothing_is_lost():
    system, state, data = kept_of_twelve()
    assert len(data) < 0.25 * 2 * 99 * 8 * system.rows.count  # of what all their zeros would take
    taken_up = load(system, data)
    for one, other in ((taken_up.rows, state.rows), (taken_up.active.block, state.active.block)):
        assert one.tobytes() == other.tobytes()
    assert dump(system, taken_up) == data


@pytest.mark.parametrize(
    "wrong", [b'"thin": [1', b'"thin": [-', b'"thin": 5, "t": [', b'"rows": [9999999999']
)
def test_another_number_of_what_is_not_zero_is_refused(wrong):
    system, _, data = kept_of_twelve()
    with pytest.raises(StateError):
        load(system, header_replaced(data, wrong[:8] + b"[", wrong))


IMPOSSIBLE = [("rows", (0, 3), np.nan), ("rows", (0, 3), np.inf), ("rows", (0, 3), -np.inf)]
IMPOSSIBLE += [("modes", 5, len(Mode)), ("cells", slice(2), 40)]  # gathered twice
#: Rows: height, opening, command, force.
IMPOSSIBLE += [
    (part, (row, 1), value)
    for part in ("rows", "block")
    for row, value in ((0, -1e-3), (0, 0.11), (1, 1.1), (1, -1.1), (2, 1.1), (3, 1e154))
]


@pytest.mark.parametrize("name, index, value", IMPOSSIBLE)
def test_numbers_no_state_or_device_can_have_are_refused(name, index, value):
    system, data = kept()
    state = load(system, data)
    if isinstance(index, tuple) and index[1] == 1:
        rows = (0, system.cell.lag_rows.start, system.rows.command, system.rows.force)
        index = rows[index[0]], 1
    array = getattr(state, name) if name in state._fields else getattr(state.active, name)
    array[index] = value
    with pytest.raises(StateError, match="no state can have"):
        load(system, dump(system, state))


def test_pins_at_their_ends_are_taken_up_and_a_memory_of_no_number_of_the_world_is_refused():
    system, data = kept()
    state = load(system, data)
    state.rows[0, :2] = 0.0, system.cell.actuator.stroke
    state.rows[system.cell.lag_rows, :2] = state.rows[system.rows.commands, :2] = -1.0, 1.0
    assert same(load(system, dump(system, state)), state)
    system = system_of("hybrid")
    state = run(system, begin(system), 70)
    # Pulp of Method III: the logarithm is NaN.
    state.active.block[system.rows.controlled, 1] = -1e91
    with pytest.raises(StateError, match="no state can have"):
        load(system, dump(system, state))


LOCKS = np.linspace(0.0, 0.9, 99)


@pytest.mark.parametrize(
    "locks, sound",
    [
        (LOCKS, True),
        *((np.where(LOCKS > 0.5, wrong, LOCKS), False) for wrong in (np.nan, -0.1, 1.0, np.inf)),
        (LOCKS[1:], False),
        (0 * LOCKS.astype(int), False),
    ],
)
def test_shares_of_locks_are_kept_and_refused_where_they_are_none(locks, sound):
    system, data = kept()
    stored = dump(system, load(system, data)._replace(locks=locks))
    if sound:
        assert_array_equal(load(system, stored).locks, locks)
        return
    with pytest.raises(StateError, match="no state can have"):
        load(system, stored)


def test_heights_are_carried_over_to_other_parts_within_the_stroke():
    system, data = kept()
    before = load(system, data).row(0)
    for tables in (
        {"control": {"method": "plastic"}},
        {"relaxation": "absent"},
        {"simulation": {"control_period": "10 ms"}},
    ):
        other = bed(**tables)
        state = transfer_heights(other, data)
        assert np.array_equal(state.row(0), before)
        # Nothing calls the pins back: without a finger they stay where they are.
        *_, later = periods(other, [path((0.0, 0, 0, 500))], state, 40)
        assert np.array_equal(later.row(0), before)
    low = bed(actuator={"stroke": "38 mm", "rest_height": "20 mm"})
    assert transfer_heights(low, data).row(0).max() == 38e-3
    with pytest.raises(StateError, match="number of cells"):
        transfer_heights(assemble(resolve({})), data)


class Color(IntEnum):
    RED = 1
    BLUE = 2


class Inner(NamedTuple):
    edge: float = 0.0
    felt: bool = False


class Outer(NamedTuple):
    color: Color
    inner: Inner
    table: NDArray[np.float64]
    count: int = 0


def test_a_memory_comes_back_in_its_types_with_its_arrays():
    memory = Outer(
        Color.BLUE, Inner(-math.inf, np.bool_(True)), np.array([[0.1, 2.0]]), np.int64(7)
    )
    arrays = []
    text = flatten(memory, arrays)
    back = rebuild(Outer(Color.RED, Inner(-math.inf), np.zeros((0, 2))), text, arrays)
    assert back.table.tolist() == [[0.1, 2.0]]
    assert [*back[:2], back.count] == [Color.BLUE, Inner(-math.inf, True), 7]
    assert [type(item) for item in (back.color, back.inner.edge, back.inner.felt, back.count)] == [
        Color,
        float,
        bool,
        int,
    ]


@pytest.mark.parametrize(
    "kept_memory",
    [None, 3, "Inner", [], ["Inner"], ["Inner", 0.0], ["Inner", 0.0, False, 1], ["Inner", "a", False],
     ["Inner", math.nan, False], ["Inner", math.inf, False], ["Inner", -1e76, False],
     ["Inner", 10**400, False], {"array": 0}, ["Outer", 0.0, False]],
)  # fmt: skip
def test_a_memory_of_another_structure_is_refused(kept_memory):
    with pytest.raises(StateError, match="memory of the controller must be a Inner"):
        rebuild(Inner(), kept_memory, [])


@pytest.mark.parametrize("count", [-1, 2**53 + 1, 1e30, -math.inf, 10**400])
def test_a_memory_with_a_count_that_is_none_is_refused(count):
    arrays = [np.zeros((0, 2))]
    template = Outer(Color.RED, Inner(), arrays[0])
    assert (
        rebuild(template, ["Outer", 1, ["Inner", 0.0, False], {"array": 0}, 3], arrays).count == 3
    )
    with pytest.raises(StateError, match="memory of the controller must be a Outer"):
        rebuild(template, ["Outer", 1, ["Inner", 0.0, False], {"array": 0}, count], arrays)
