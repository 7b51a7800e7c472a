"""Fuzz test of scenes, snapshots, takes and run folders: each is accepted, or refused in one line.

usage: python tools/fuzz.py {scenes,states,takes,runs} [--count 100000] [--seed 0] [--first 0]

Case number n of a seed is always the same one, whatever the count. What was neither taken nor refused is
listed with its number, and makes the exit code 1.
"""

import argparse
import collections
import copy
import io
import itertools
import json
import sys
import tempfile
import warnings
import zipfile
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path as FolderPath
from traceback import extract_tb
from typing import Any

import numpy as np
from digiclay.core.base.errors import DigiclayError
from digiclay.core.control.methods import METHODS
from digiclay.core.control.orders import Orders, Verb, place, repeat_order
from digiclay.core.engine.simulation import advance, begin, periods, trace_fingers
from digiclay.core.engine.system import System
from digiclay.core.files.tables import parse_tables
from digiclay.core.metrics.summary import compute_metrics
from digiclay.core.model.trajectory import Path, Waypoint, interpolate_poses
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.schema import FINGER_SECTIONS, OPTIONAL, SECTIONS, STEPPERS
from digiclay.core.scene.toml_table import ABSENT, FINGERS, PRESETS, format_scene, resolve
from digiclay.core.session import snapshot
from digiclay.core.session.finished_run import SHAPES, read_run
from digiclay.core.session.run_scene import Result, run
from digiclay.core.session.snapshot import FIRST, START
from digiclay.core.session.take import Take, from_bytes, replay, to_bytes
from digiclay.core.surface import features
from digiclay.core.surface.formed import make_formed
from digiclay.core.surface.skins import fit_skin
from numpy.typing import NDArray

#: Numbers at the ends of what there is, and beyond.
NUMBERS: tuple[Any, ...] = (
    0, 0.0, -0.0, 1, -1, 5e-324, 1e-310, 2.3e-308, 1e-200, 1e-30, 1e-12, 1e-9, 1e-6, 1e-3, 0.5, 1e3, 1e6, 1e9,
    1e12, 1e30, 1e100, 1e200, 1.7e308, -5e-324, -1e-9, -1e308, float("inf"), float("-inf"), float("nan"),
    2**31, 2**53, 2**63, 10**19, 10**30, 10**308, 10**309, 10**400, -(10**400), True,
)  # fmt: skip
#: What is no number.
OTHERS: tuple[Any, ...] = (
    "", "a", "1e400 mm", "5e-324 mm", "-1 mm", "nan s", "inf Pa", "1 parsec", "absent", "\0", None, [], {},
    [[]], [1, 2], [1e308] * 4, [5e-324] * 3, [0.0] * 4, {"a": 1}, ["a"], "é" * 50,
)  # fmt: skip
#: Most cells and control periods of a session that is begun, and numbers of a row that it announces.
CELLS, PERIODS, RECORDED = 200, 3, 1_000_000
#: Names of what has the physics of its own.
WAYS = (*METHODS, ABSENT)


def pick(chance: np.random.Generator, values: Sequence[Any]) -> Any:
    """Return one of some values."""
    return values[chance.integers(len(values))]


def odd(chance: np.random.Generator, usual: Any) -> Any:
    """Return something in place of a usual value: mostly numbers, some of them near the usual one."""
    draw = chance.random()
    if draw < 0.3 and isinstance(usual, float):
        return usual * 10.0 ** chance.uniform(-12.0, 12.0)
    if draw < 0.4 and isinstance(usual, tuple):
        return [odd(chance, one) for one in usual]
    if draw < 0.85:
        return pick(chance, NUMBERS)
    return copy.deepcopy(pick(chance, OTHERS))  # lists among them are changed later


def spoil(chance: np.random.Generator, tree: Any) -> None:
    """Put something odd in place of a value, or sometimes of a whole part, of nested tables and lists."""
    while places := list(tree) if isinstance(tree, dict) else list(range(len(tree))):
        place = pick(chance, places)
        if not isinstance(tree[place], (dict, list)) or chance.random() < 0.2:
            tree[place] = odd(chance, tree[place])
            return
        tree = tree[place]


@cache
def written(method: str) -> str:
    """Return the text of a small scene under a method, with all of its sections."""
    sections: dict[str, Any] = {"layout": {"rows": 3, "columns": 3}, "sensors": {}, "shape": {}}
    sections["control"] = method if method == ABSENT else {"method": method}
    if METHODS.get(method) and METHODS[method].blister is not None:
        sections["blister"] = {"radius": 1e-3, "edge_radius": 1.5e-3, "flat_radius": 5e-4}
    return format_scene(resolve(sections))


def table(chance: np.random.Generator) -> dict[str, Any]:
    """Return the tables of a scene, some of them left out, in which some values are odd."""
    made = parse_tables(written(pick(chance, WAYS))) | {"preset": pick(chance, list(PRESETS))}
    for section in (*SECTIONS, "trajectory"):
        if section in made and section not in ("layout", "control", "blister") and chance.random() < 0.7:
            del made[section]
    for section in OPTIONAL:
        if section != "control" and chance.random() < 0.05:
            made[section] = ABSENT
    made["layout"] |= {side: int(chance.integers(1, 6)) for side in ("rows", "columns")}
    made["simulation"] = made.get("simulation", {}) | {"stepper": pick(chance, list(STEPPERS))}
    for _ in range(chance.integers(1, 4)):
        spoil(chance, made)
    if chance.random() < 0.2:
        # The same finger none, one or two times in a list.
        own = {section: made.pop(section) for section in FINGER_SECTIONS if section in made}
        made[FINGERS] = [own] * int(chance.integers(0, 3)) if chance.random() < 0.9 else odd(chance, [own])
    return made


def spoilt(chance: np.random.Generator) -> str:
    """Return the text of a scene with some letters, or a value, turned into others."""
    lines = written("virtual_master").split("\n")
    for _ in range(chance.integers(1, 3)):
        at = int(chance.integers(len(lines)))
        key, equals, _ = lines[at].partition(" = ")
        if equals and chance.random() < 0.7:
            value = pick(chance, NUMBERS)
            lines[at] = f"{key} = {str(value).lower() if isinstance(value, bool) else value}"
        else:
            place = int(chance.integers(len(lines[at]) + 1))
            lines[at] = lines[at][:place] + chr(chance.integers(0, 300)) + lines[at][place + 1 :]
    return "\n".join(lines)


def scene(chance: np.random.Generator) -> None:
    """Take in a scene and begin its session, or have it refused."""
    if chance.random() < 0.2:
        try:
            made = parse_tables(spoilt(chance))
        except (ValueError, RecursionError):  # said with file and line by `scene_source.read_table`
            return
    else:
        made = table(chance)
    resolved = resolve(made)
    assert resolve(parse_tables(format_scene(resolved))) == resolved
    if resolved.cells > CELLS or resolved.cells * resolved.periods > RECORDED:
        return
    asked = itertools.count(1)
    json.dumps(run(resolved, stopped=lambda: next(asked) >= PERIODS).metrics, allow_nan=False)


@cache
def kept(method: str) -> tuple[System, bytes]:
    """Return a small bed under a method, and its state in the middle of a press."""
    system = assemble(resolve({"layout": {"rows": 6, "columns": 10}, "control": {"method": method}}))
    places = ((0.0, 42e-3), (0.2, 37e-3))
    way = Path("linear", tuple(Waypoint(time=when, position=(0.0, 0.0, z)) for when, z in places))
    *_, last = periods(system, [way.trajectory()], begin(system), 50)
    return system, snapshot.dump(system, last)


def crafted(chance: np.random.Generator, data: bytes) -> bytes:
    """Return a state with odd values in its header, in its arrays, or with other bytes."""
    first = len(START) + 4
    length = int.from_bytes(data[len(START) : first], "little")
    header, arrays = json.loads(data[first : first + length]), bytearray(data[first + length :])
    for _ in range(chance.integers(1, 4)):
        draw = chance.random()
        if draw < 0.6:
            spoil(chance, header)
        elif draw < 0.9:
            at = int(chance.integers(len(arrays) // 8)) * 8
            value = pick(chance, NUMBERS)
            kind = pick(chance, ("<f8", "<i8"))
            with np.errstate(all="ignore"):
                number = np.float64(float(value) if abs(value) < 10**308 else np.inf)
                arrays[at : at + 8] = number.astype(kind).tobytes()
        else:
            arrays[int(chance.integers(len(arrays)))] = int(chance.integers(256))
    start = START
    if chance.random() < 0.2:
        start, gathered = FIRST, header.get("gathered")
        header["gathered"] = gathered | {"reach": None} if isinstance(gathered, dict) else gathered
    head = json.dumps(header).encode()
    return start + len(head).to_bytes(4, "little") + head + bytes(arrays)


def state(chance: np.random.Generator) -> None:
    """Take up a crafted state and go on from it, or have it refused."""
    system, data = kept(pick(chance, list(METHODS)))
    finger = np.tile([0.0, 0.0, 37e-3, 1.0, 0.0, 0.0, 0.0], (2, 1, 1))
    for take_up in (snapshot.load, snapshot.transfer_heights):
        reached = take_up(system, crafted(chance, data))
        for _ in range(PERIODS):
            (way,) = trace_fingers(system, interpolate_poses(finger, system.instants / system.period))
            reached = advance(system, reached, way)
        snapshot.dump(system, reached)


def odd_array(chance: np.random.Generator, usual: NDArray[Any]) -> NDArray[Any]:
    """Return an array of another type or shape, or with odd numbers in it."""
    draw = chance.random()
    with np.errstate(all="ignore"):
        if draw < 0.4:
            kind = np.dtype(pick(chance, KINDS))
            return usual.astype(kind) if kind.names is None else np.zeros(usual.shape, kind)
        if draw < 0.6:
            flat = usual.ravel()
            shapes = flat, usual[None], flat[:0], flat[:1], usual.T, np.array(3.0), flat[:-1]
            return pick(chance, shapes)
        made = usual.copy()
        number = pick(chance, NUMBERS)
        number = float(number) if abs(number) < 10**309 else float("inf")
        made.reshape(-1)[chance.integers(made.size)] = np.float64(number).astype(made.dtype)
        return made


def pack(chance: np.random.Generator, arrays: dict[str, NDArray[Any]]) -> bytes:
    """Return arrays as a file .npz, some of them odd, or their heads."""
    file = io.BytesIO()
    for name in chance.permutation(list(arrays))[: chance.integers(1, 3)]:
        arrays = arrays | {name: odd_array(chance, arrays[name])}
    words = ((b"False", b"True "), (b"), }", b"L),}"), (b"descr", b"descx"), (b"<f8", b"<M8"))
    with zipfile.ZipFile(file, "w") as archive:
        for name, array in arrays.items():
            part = io.BytesIO()
            np.lib.format.write_array(part, np.asarray(array), allow_pickle=False)
            data, (old, new) = part.getvalue(), pick(chance, words)
            archive.writestr(f"{name}.npy", data.replace(old, new, 1) if chance.random() < 0.05 else data)
    return file.getvalue()


@cache
def recorded() -> tuple[Result, Take]:
    """Return a short run of a small bed, and a take of the same."""
    small = {"layout": {"rows": 6, "columns": 11}, "simulation": {"duration": 0.05}, "recorder": {}}
    bed = resolve(small)
    rest, poses = begin(assemble(bed)), np.tile([0.0, 0.0, 37e-3, 1.0, 0.0, 0.0, 0.0], (4, 1, 1))
    start = snapshot.dump(assemble(bed), rest)
    surface = np.where(np.arange(66) % 3, 0.041, np.nan)
    smooth = repeat_order(2, Verb.SMOOTH, 0.0, 0.0, 5e-3, 0.5)
    orders = Orders(np.vstack([smooth, place(1, surface).rows]), (surface,))
    return run(bed), Take(bed, start, poses, start, orders)


def take(chance: np.random.Generator) -> None:
    """Read a take with odd arrays and replay it, or have it refused."""
    with np.load(io.BytesIO(to_bytes(recorded()[1]))) as file:
        arrays = dict(file)
    for _ in replay(from_bytes(pack(chance, arrays))):
        pass


def folder(chance: np.random.Generator) -> None:
    """Read a run with odd arrays and evaluate it, or have it refused."""
    done = recorded()[0]
    with tempfile.TemporaryDirectory() as name:
        (FolderPath(name) / "scene.toml").write_text(format_scene(done.scene), encoding="utf-8")
        (FolderPath(name) / "history.npz").write_bytes(pack(chance, done.history))
        finished = read_run(FolderPath(name), *SHAPES)
    json.dumps(compute_metrics(finished.history, finished.scene.set_point), allow_nan=False)
    features.find(fit_skin(make_formed(finished.history, -1), "bilinear", 1, 0.0))


#: Types of arrays that no file of ours has.
KINDS = ("M8[s]", "m8[s]", "c16", "U3", "S2", "?", "i8", "u1", "f4", "f2", "f16", ">f8", "V8", "f4,i4")
#: What can be made, and had taken or refused.
CASES: dict[str, Callable[[np.random.Generator], None]] = {
    "scenes": scene, "states": state, "takes": take, "runs": folder,
}  # fmt: skip


def failure(kind: str, seed: int, number: int) -> str | None:
    """Try a case; return "" if it was taken, None if it was refused, or else what happened and where."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            CASES[kind](np.random.default_rng((seed, number)))
    except DigiclayError as error:
        return f"two lines: {error}" if "\n" in str(error) else None
    except Exception as error:
        place = extract_tb(error.__traceback__)[-1]
        where = f"{place.filename.rpartition('/')[2]}:{place.lineno}"
        return f"{type(error).__name__} in {where}: {' '.join(str(error).split())[:80]}"
    return ""


def main() -> int:
    """Try many cases, and tell what came of them."""
    parser = argparse.ArgumentParser(description="Have odd scenes or states taken or refused.")
    parser.add_argument("kind", choices=tuple(CASES))
    parser.add_argument("--count", type=int, default=100_000, help="how many cases, default 100000")
    parser.add_argument("--seed", type=int, default=0, help="which ones, default 0")
    parser.add_argument("--first", type=int, default=0, help="number of the first case, default 0")
    arguments = parser.parse_args()
    taken, failures = 0, collections.defaultdict(list)
    for number in range(arguments.first, arguments.first + arguments.count):
        outcome = failure(arguments.kind, arguments.seed, number)
        taken += outcome == ""
        if outcome:
            failures[outcome].append(number)
    failed = sum(map(len, failures.values()))
    refused = arguments.count - taken - failed
    print(f"{arguments.count} {arguments.kind}: {taken} taken, {refused} refused, {failed} neither")
    for outcome, numbers in sorted(failures.items(), key=lambda item: -len(item[1])):
        print(f"  {len(numbers)} x {outcome}  (number {', '.join(map(str, numbers[:3]))})")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
