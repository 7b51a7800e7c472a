"""Snapshot of a state as bytes, restored bit for bit.

A short header in JSON describes what follows: the arrays, little-endian. The controller's
memory is written by its structure, and rebuilt like the memory with which a session of the
same controller begins: no content can name a class or run code.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import numpy as np

from ..base.arrays import Array, Flags, Floats
from ..base.errors import StateError
from ..base.modes import HOLD, LOCKED, REST, Mode
from ..control.pin_division import Hands
from ..engine.hand_steps import rest_hands
from ..engine.simulation import begin
from ..engine.state import ActiveSet, Rows, State
from ..engine.system import System
from ..files.formats import read_count
from ..files.tables import Record
from ..model.control_interface import Memory
from ..model.layout import Disc, join_discs

#: Largest number of a controller's memory, except those that begin infinite.
LARGEST_KEPT = 1e75


def flatten(memory: Memory, arrays: list[Array]) -> Any:
    """Return a memory as JSON: named tuples as lists that begin with their names, arrays as indices."""
    if isinstance(memory, np.ndarray):
        arrays.append(np.ascontiguousarray(memory, memory.dtype.newbyteorder("<")))
        return {"array": len(arrays) - 1}
    if isinstance(memory, tuple):
        return [type(memory).__name__, *(flatten(item, arrays) for item in memory)]
    if isinstance(memory, Enum):
        return memory.value
    # Numbers of numpy become Python's own, which JSON restores exactly.
    return memory.item() if isinstance(memory, np.generic) else memory


def rebuild(template: Any, stored: Any, arrays: list[Array]) -> Any:
    """Return a flattened memory in the types of a `template` of the same controller, or raise StateError."""
    try:
        return _rebuild_like(template, stored, arrays)
    except (ValueError, TypeError, KeyError, IndexError, OverflowError):
        raise StateError(
            f"The stored state's memory of the controller must be a {type(template).__name__} "
            f"(got {str(stored)[:60]}). Reset the session to begin with a bed at rest."
        ) from None


def _rebuild_like(template: Any, stored: Any, arrays: list[Array]) -> Any:
    """Return a stored memory in the types of the template; any error means another structure."""
    kind = type(template)
    if isinstance(template, np.ndarray):
        array = arrays[stored["array"]]
        if array.ndim != template.ndim or array.dtype.kind != template.dtype.kind:
            raise ValueError("another array")
        return array.astype(template.dtype)
    if isinstance(template, tuple):
        name, *items = stored
        if name != kind.__name__:
            raise ValueError("another named tuple")
        like = [
            _rebuild_like(part, item, arrays) for part, item in zip(template, items, strict=True)
        ]
        return kind(*like) if hasattr(kind, "_fields") else kind(like)
    if template is None:
        if stored is not None:
            raise ValueError("something instead of nothing")
        return None
    if not isinstance(template, Enum):
        _check_number(template, stored)
    return kind(stored)


def _check_number(template: object, number: object) -> None:
    """Refuse a number that no controller reaches: counts are whole, only what begins infinite may be so."""
    if not isinstance(number, (bool, int, float)) or math.isnan(number):
        raise ValueError("no number")
    if isinstance(template, int) and not isinstance(template, bool):
        if not 0 <= number <= 2**53:
            raise ValueError("no count")
    elif abs(number) > LARGEST_KEPT and number != template:
        raise ValueError("a number that is too large")


#: First bytes of a snapshot, with the version of its format. The first version had one fingertip,
#: not in a list.
START, FIRST = b"digiclay state 2\n", b"digiclay state 1\n"
#: Types of the arrays, by their names in `State` and `ActiveSet`.
ARRAYS = {"rows": "<f8", "modes": "i1", "aged": "<f8", "cells": "<i8", "block": "<f8", "mode": "i1"}
#: Arrays of which, with several fingers, only values other than 0 are written: at most one finger
#: presses most cells.
THIN = ("rows", "block")
#: Numbers of a hand's deflection.
DEFLECTION = 5
#: Tolerance of rounding beyond the ends of a height, m, or an opening.
SLACK = 1e-6
#: Largest number of a state: a session ends when the square of one is no longer finite.
LARGEST = 1e154
#: Largest coordinate or radius of a disc, m.
FARTHEST = 1e9
REMEDY = "Reset the session to begin with a bed at rest."


@dataclass(frozen=True, eq=False)
class Snapshot:
    """Content of a snapshot: the header, and the arrays by their names in `State` and `ActiveSet`."""

    header: Record
    arrays: dict[str, Array]
    memory: list[Array]


def dump(system: System, state: State) -> bytes:
    """Return a state as bytes, which stay as they are when the session continues."""
    active, rows = state.active, system.rows
    arrays: list[Array] = []
    memory = flatten(state.memory, arrays)
    optional = {
        "locks": state.locks,
        "under": None if active.under is None else np.packbits(active.under),
        "hands": state.deflection and np.array(state.deflection),
    }
    given = {name: flatten(array, arrays) for name, array in optional.items() if array is not None}
    if state.addressing is not None:
        given["addressing"] = flatten(state.addressing, arrays)
        given["sets"] = system.drive.sets
    values = state.rows, state.modes, state.aged, active.cells, active.block, active.mode
    body = [
        np.ascontiguousarray(array, kind)
        for array, kind in zip(values, ARRAYS.values(), strict=True)
    ]
    thin = []
    for number, name in enumerate(ARRAYS):
        if name in THIN and system.fingers > 1:
            # Values are compared by their bits, as -0.0 is to be restored.
            filled = body[number].view("<i8").reshape(-1) != 0
            body[number] = body[number].reshape(-1)[filled]
            thin.append(body[number].size)
            arrays.append(np.packbits(filled))
    header = {
        "cells": system.grid.count,
        "rows": _list_rows(rows),
        "control_period": system.period,
        "period": state.period,
        "peak": state.peak,
        "gathered": {
            "cells": active.cells.size,
            "near": active.near,
            "fingers": [{"reach": reach} for reach in _list_discs(active.reach, system.fingers)],
            "control": active.control
            if system.fingers == 1
            else _list_discs(active.control, system.fingers),
            "peak": active.peak,
            "until": active.until,
        },
        "memory": memory,
        **given,
        "thin": thin,
        "arrays": [[array.dtype.str, list(array.shape)] for array in arrays],
    }
    text = json.dumps(header).encode()
    # The arrays are joined without another copy.
    parts = (array.data for array in (*body, *arrays))
    return b"".join([START, len(text).to_bytes(4, "little"), text, *parts])


def load(system: System, data: bytes) -> State:
    """Return the state in bytes, bit for bit; StateError if they are damaged or of another bed."""
    stored = _read(data)
    header, arrays, rows = stored.header, stored.arrays, system.rows
    _check_same("number of cells", header["cells"], system.grid.count)
    _check_same("rows of a cell", header["rows"], _list_rows(rows))
    _check_same("control period", header["control_period"], system.period)
    _check_same("number of fingers", len(header["gathered"]["fingers"]), system.fingers)
    _check_limits(system, stored)
    gathered = header["gathered"]
    discs = _read_discs(gathered)
    reach, control = (each[0] if system.fingers == 1 else join_discs(each) for each in discs)
    cells = arrays["cells"].astype(np.intp)
    active = ActiveSet(
        rows,
        cells,
        gathered["near"],
        arrays["block"],
        arrays["mode"],
        system.grid.compute_basis(cells),
        reach,
        control,
        gathered["peak"],
        gathered["until"],
        under=stored.arrays.get("under"),
    )
    memory = rebuild(system.controller.begin(), header["memory"], stored.memory)
    bed = arrays["rows"], arrays["modes"], arrays["aged"]
    locks = stored.arrays.get("locks")
    deflection, addressing = rest_hands(system.hands), system.drive.begin()
    if addressing is not None and "addressing" in header:
        former = rebuild(addressing, header["addressing"], stored.memory)
        _check_same("lines of the drive", former.last.size, addressing.last.size)
        # Lines of other sets are addressed anew.
        if header.get("sets", system.drive.sets) == system.drive.sets:
            addressing = former
    if deflection and "hands" in stored.arrays:
        deflection = type(deflection)(*stored.arrays["hands"])
    peak = header["peak"]
    return State(header["period"], *bed, peak, active, memory, locks, deflection, addressing)


def count_fingers(data: bytes) -> int:
    """Return the number of fingers of a stored state; StateError if it is damaged."""
    return len(_read(data).header["gathered"]["fingers"])


def is_reached(data: bytes) -> bool:
    """Return whether fingertips reach pins in a stored state; StateError if it is damaged."""
    reaches, _ = _read_discs(_read(data).header["gathered"])
    return any(disc is not None for disc in reaches)


def read_shares(data: bytes) -> Floats:
    """Return the shares by which pins of a stored state are locked, (n,); StateError if it is damaged."""
    arrays = _read(data).arrays
    modes = arrays["modes"]
    modes[arrays["cells"]] = arrays["mode"]
    return np.where(modes == LOCKED, 1.0, arrays.get("locks", 0.0))


def transfer_heights(system: System, data: bytes) -> State:
    """Return the first state of a session, with heights and locks of a stored state of other parts."""
    stored = _read(data)
    _check_same("number of cells", stored.header["cells"], system.grid.count)
    height = stored.arrays["rows"][0].copy()
    height[stored.arrays["cells"]] = stored.arrays["block"][0]
    actuator, state = system.cell.actuator, begin(system)
    height = np.clip(height, 0.0, actuator.stroke)
    state.rows[0] = state.rows[system.rows.target] = height
    shares = read_shares(data)
    state.modes[:] = np.where(height == actuator.rest_height, REST, HOLD)
    state.modes[shares == 1.0] = LOCKED
    in_part = np.where(shares < 1.0, shares, 0.0)
    return state._replace(peak=float(height.max()), locks=in_part if in_part.any() else None)


def _check_limits(system: System, stored: Snapshot) -> None:
    """Refuse pins beyond their end stops, and openings of valves above 1."""
    rows, top = system.rows, system.cell.actuator.stroke + SLACK
    for name in ("rows", "block"):
        values = stored.arrays[name]
        height, valves = values[0], (values[system.cell.lag_rows], values[rows.commands])
        wide = any((np.abs(opening) > 1.0 + SLACK).any() for opening in valves)
        wide |= (np.abs(values[rows.controlled]) > LARGEST_KEPT).any()
        if wide or ((height < -SLACK) | (height > top)).any():
            raise _make_error("contains numbers that no state can have")


def _read(data: bytes) -> Snapshot:
    """Read bytes into new arrays, for any system."""
    if not isinstance(data, bytes) or not data.startswith((START, FIRST)):
        raise _make_error("does not begin like one")
    try:
        first = len(START) + 4
        length = int.from_bytes(data[len(START) : first], "little")
        header = json.loads(data[first : first + length])
        cells, gathered = read_count(header["cells"]), header["gathered"]
        if data.startswith(FIRST):
            gathered = header["gathered"] = {**gathered, "fingers": [{"reach": gathered["reach"]}]}
        count, taken = Rows(*map(read_count, header["rows"])).count, read_count(gathered["cells"])
        sizes = (count, cells), (cells,), (cells,), (taken,), (count, taken), (taken,)
        thin = dict(zip(THIN, map(read_count, header.get("thin", ())), strict=False))
        whole = dict(zip(ARRAYS, sizes, strict=True))
        shapes: list[tuple[str, tuple[int, ...]]] = [
            (kind, (thin[name],) if name in thin else whole[name]) for name, kind in ARRAYS.items()
        ]
        shapes += [(str(kind), tuple(map(read_count, shape))) for kind, shape in header["arrays"]]
        arrays, end = _read_arrays(data, first + length, shapes)
        if end != len(data):
            raise _make_error(f"must have {end} bytes and has {len(data)}")
        numbers = [header["peak"], gathered["peak"], header["control_period"]]
        numbers += [
            read_count(value) for value in (header["period"], gathered["until"], gathered["near"])
        ]
        numbers += [
            number for discs in _read_discs(gathered) for disc in discs for number in disc or ()
        ]
        stored = Snapshot(header, dict(zip(ARRAYS, arrays, strict=False)), arrays[len(ARRAYS) :])
        for name, bits in zip(thin, stored.memory[len(stored.memory) - len(thin) :], strict=True):
            stored.arrays[name] = _fill(stored.arrays[name], bits, whole[name])
        for name in {"locks", "hands"} & header.keys():
            stored.arrays[name] = stored.memory[header[name]["array"]]
        if "under" in header:
            shape = len(gathered["fingers"]), cells
            stored.arrays["under"] = _unpack(stored.memory[header["under"]["array"]], shape)
        # An empty memory is None; a missing one is damage.
        sound = (
            "memory" in header and gathered["near"] <= taken and all(map(math.isfinite, numbers))
        )
    except (ValueError, KeyError, TypeError, IndexError, OverflowError, RecursionError) as error:
        raise _make_error(f"is damaged: {type(error).__name__}") from None
    if not sound or not _is_sound(stored, cells):
        raise _make_error("contains numbers that no state can have")
    return stored


def _fill(values: Array, bits: Array, shape: tuple[int, ...]) -> Floats:
    """Return an array with the values (k,) where the packed bits are 1, and 0 elsewhere."""
    filled, whole = _unpack(bits, shape), np.zeros(shape)
    whole[filled] = values
    return whole


def _unpack(bits: Array, shape: tuple[int, ...]) -> Flags:
    """Return packed bits as an array."""
    count = math.prod(shape)
    if bits.shape != (-(-count // 8),):
        raise ValueError("another number of bits")
    return np.unpackbits(bits, count=count).astype(np.bool_).reshape(shape)


def _read_arrays(
    data: bytes, at: int, shapes: list[tuple[str, tuple[int, ...]]]
) -> tuple[list[Array], int]:
    """Return copies of the arrays in `data` from byte `at` on, and the byte after them."""
    arrays = []
    for name, shape in shapes:
        kind, count = np.dtype(name), math.prod(shape)
        if kind.hasobject or kind.itemsize == 0 or at + count * kind.itemsize > len(data):
            raise ValueError(f"no room for {count} of {kind}")
        arrays.append(np.frombuffer(data, kind, count, at).reshape(shape).copy())
        at += count * kind.itemsize
    return arrays, at


def _is_sound(stored: Snapshot, count: int) -> bool:
    """Return whether the values of the arrays are those of a state."""
    arrays = stored.arrays
    cells, locks = arrays["cells"], arrays.get("locks", np.zeros(count))
    fingers = len(stored.header["gathered"]["fingers"])
    hands = arrays.get("hands", np.zeros((DEFLECTION, fingers)))
    return bool(
        all((np.abs(arrays[name]) < LARGEST).all() for name in ("rows", "aged", "block"))
        and all(
            ((arrays[name] >= 0) & (arrays[name] < len(Mode))).all() for name in ("modes", "mode")
        )
        and ((cells >= 0) & (cells < count)).all()
        and np.unique(cells).size == cells.size
        and locks.shape == (count,)
        and locks.dtype == np.float64
        and ((locks >= 0.0) & (locks < 1.0)).all()
        and hands.shape == (DEFLECTION, fingers)
        and hands.dtype == np.float64
        and (np.abs(hands) < LARGEST_KEPT).all()
    )


def _list_rows(rows: Rows) -> list[int]:
    """Return the numbers of rows, with those of the forces of several fingers if there are any."""
    numbers = [rows.physics, rows.queue, rows.control, rows.sensors, rows.fingers]
    return numbers if rows.fingers else numbers[:-1]


def _list_discs(discs: Any, fingers: int) -> list[Any]:
    """Return the disc of one finger, or those of several from arrays (f,); None: no disc."""
    if fingers == 1 or discs is None:
        return [discs] * fingers
    return [None if disc[2] < 0.0 else disc for disc in np.transpose(discs).tolist()]


def _read_discs(gathered: Record) -> tuple[list[Disc | None], list[Disc | None]]:
    """Return the discs that the fingers may touch, and the controlled discs."""
    fingers = gathered["fingers"]
    controls = gathered["control"] if len(fingers) > 1 else [gathered["control"]]
    return [_read_disc(finger["reach"]) for finger in fingers], [
        _read_disc(disc) for disc in controls
    ]


def place_fingers(had: int, count: int, bodies: int) -> list[int | None]:
    """Return the `origins` of `change_fingers` for another number of fingers before the same bodies."""
    fingers: list[int | None] = [finger if finger < had else None for finger in range(count)]
    return [*fingers, *range(had, had + bodies)]


def change_fingers(
    former: System, system: System, state: State, origins: Sequence[int | None]
) -> State:
    """Return a state for another number of fingers, of beds and methods that are otherwise the same.

    `origins`: for each finger the number of the former one it was; None: it is new. Overwrites
    `state`.
    """
    former.selection.release(state)
    fresh, old, new = begin(system), former.rows, system.rows
    rows = fresh.rows
    rows[0] = state.rows[0]
    rows[system.cell.lag_rows] = state.rows[former.cell.lag_rows]
    rows[new.commands.start : new.force] = state.rows[old.commands.start : old.force]
    pressing = state.rows[old.pressing] if old.fingers else state.rows[old.force][None]
    rows[new.force] = sum(pressing[origin] for origin in origins if origin is not None)
    rows[new.sensed] = state.rows[old.sensed]
    _take_fingers(
        rows[system.cell.pulp_rows], state.rows[former.cell.pulp_rows], former.fingers, origins
    )
    # Behind the display of a shape stands the memory of the method.
    after, before = (getattr(memory, "method", memory) for memory in (fresh.memory, state.memory))
    if isinstance(after, Hands) or isinstance(before, Hands):
        begun, had = (
            list(each.fingers) if isinstance(each, Hands) else [each] for each in (after, before)
        )
        # A controller with other rows per cell begins anew.
        if new.control * former.fingers == old.control * system.fingers:
            _take_fingers(rows[new.controlled], state.rows[old.controlled], former.fingers, origins)
            for finger, origin in enumerate(origins):
                if origin is not None:
                    begun[finger] = had[origin]
        before = after._replace(fingers=tuple(begun)) if isinstance(after, Hands) else begun[0]
    else:
        rows[new.controlled] = state.rows[old.controlled]
    shown = hasattr(state.memory, "method")
    memory = state.memory._replace(method=before) if shown else before
    # What is pressed and what still moves goes on.
    chosen = replace(fresh.active, cells=state.active.cells, near=state.active.near)
    bed = State(state.period, rows, state.modes, state.aged, float(rows[0].max()), chosen, memory)
    if fresh.deflection and state.deflection:
        for row, before in zip(fresh.deflection, state.deflection, strict=True):
            _take_fingers(row, before, former.fingers, origins)
    taken = system.selection.take(bed, chosen)
    return bed._replace(
        active=taken,
        locks=state.locks,
        deflection=fresh.deflection,
        addressing=state.addressing,
    )


def _take_fingers(into: Floats, of: Floats, former: int, origins: Sequence[int | None]) -> None:
    """Copy rows (r, n) of former fingers to those of fingers, in place; either may have more at the end."""
    parts, sources = np.split(into, len(origins)), np.split(of, former)
    for part, origin in zip(parts, origins, strict=True):
        if origin is not None:
            least = min(len(part), len(sources[origin]))
            part[:least] = sources[origin][:least]


def _read_disc(values: Any) -> Disc | None:
    """Return a disc of the bed; None: no disc."""
    if values is None:
        return None
    x, y, radius = (float(value) for value in values)
    if max(abs(x), abs(y), abs(radius)) > FARTHEST:
        raise ValueError("a disc beyond all beds")
    return x, y, radius


def _check_same(what: str, stored: object, here: object) -> None:
    """Refuse a state of another system."""
    if stored != here:
        rule = f"must have the same {what} as the bed now, {here} (got {stored})"
        raise StateError(f"The stored state {rule}. {REMEDY}")


def _make_error(reason: str) -> StateError:
    """Return the error of bytes that are not a state."""
    return StateError(f"The stored state {reason}, and cannot be used. {REMEDY}")
