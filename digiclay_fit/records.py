"""Measured records: CSV files with a row of units, checked, in SI units, by trial."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import DigiclayError
from digiclay.core.base.quantity import UNITS, normalize
from digiclay.core.files.run_folder import find_file, list_files
from digiclay.core.scene.scene_source import SAMPLES
from digiclay.core.studies.axes import is_number

#: Columns of a part's file and their SI units; the last ones may be absent.
COLUMNS = {
    "pulp": ({"time": "s", "position": "m", "force": "N"}, {}),
    "cell": ({"time": "s", "command": "", "height": "m"}, {"load": "N"}),
}
#: Other names of a column, which are fitted alike: its zero is free.
ALIKE = {"indentation": "position", "commanded": "position"}
TRIAL = "trial"
MEASUREMENTS = SAMPLES.parent / "measurements"
#: Least and most samples: of a trial, and of all.
LEAST, MOST = 20, 200_000
#: Equal samples in turn at the largest value that mean a clipped signal, and standard deviations of the
#: noise beyond which a force counts.
CLIPPED, CLEAR = 12, 5.0


class Trial(NamedTuple):
    """One trial: what drives it, what answers, and what loads a cell, (n,) each, in SI units."""

    name: str
    time: Floats
    drive: Floats
    """Position, m, or valve command."""
    answer: Floats
    """Force, N, or height, m."""
    load: Floats


def estimate_noise(values: Floats) -> float:
    """Return the standard deviation of white noise on a smooth signal, from third differences."""
    return float(1.4826 * np.median(np.abs(np.diff(values, 3))) / 20.0**0.5)


def find_records(word: str) -> Path:
    """Return the file that a word names, by its path or as a sample."""
    return find_file(word, list_files(MEASUREMENTS, ".csv"), "sample")


def read_records(paths: Sequence[Path], part: str) -> list[Trial]:
    """Read the trials of files; DigiclayError in one line: file, row or trial, rule and value."""
    trials = [trial for path in paths for trial in _read_file(path, part, len(paths) > 1)]
    _refuse_many("The files together", sum(trial.time.size for trial in trials))
    names = [trial.name for trial in trials]
    for name in names:
        if names.count(name) > 1:
            raise DigiclayError(f"Files must have different names (got {name} twice).")
    return trials


def _refuse_many(owner: object, count: int) -> None:
    if count > MOST:
        raise DigiclayError(
            f"{owner} must have at most {MOST:,} samples: thin them (got {count:,})."
        )


def _read_file(path: Path, part: str, several: bool) -> Iterator[Trial]:
    """Read the trials of a file, and refuse those that cannot be fitted."""
    try:
        rows = list(csv.reader(path.read_text(encoding="utf-8-sig").splitlines()))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or "it is no CSV file in UTF-8"
        raise DigiclayError(f"{path} cannot be read: {reason}.") from None
    while rows and not rows[-1]:
        rows.pop()
    _refuse_many(path, len(rows) - 2)
    names, values = _read_columns(path, rows, part)
    needed, _ = COLUMNS[part]
    table = dict(zip(names, values.T, strict=True))
    number = table.get(TRIAL, np.zeros(len(values)))
    _, drive, answer = needed
    for each in dict.fromkeys(number.tolist()):
        chosen = number == each
        name = f"{path.stem}:{each:g}" if several else f"{each:g}"
        load = table.get("load", np.zeros(len(values)))[chosen]
        time, given, measured = (table[key][chosen] for key in needed)
        trial = Trial(name, time, given, measured, load)
        try:
            _check_trial(trial, drive, answer)
        except ValueError as error:
            raise DigiclayError(f"{path}, trial {each:g}: {error}.") from None
        yield trial


def _read_columns(path: Path, rows: Sequence[Sequence[str]], part: str) -> tuple[list[str], Floats]:
    """Return the names of the columns of a file, and their values (n, columns) in SI."""
    needed, optional = COLUMNS[part]
    known = {**needed, **optional, TRIAL: ""}
    head = [word.strip().lower() for word in rows[0]] if rows else []
    if len(head) == 1 and ";" in head[0]:
        rule = "must use commas between columns, and points in decimals"
        raise DigiclayError(f"{path} {rule} (got ';').")
    names = [ALIKE.get(word, word) for word in head]
    if len(set(names)) < len(names) or not needed.keys() <= set(names) <= known.keys():
        more = ", ".join((*optional, TRIAL))
        rule = f"must have the columns {', '.join(needed)}, and perhaps {more}"
        raise DigiclayError(
            f"{path} {rule} (got {', '.join(head) or 'none'}).".replace("\n", " ")[:400]
        )
    factors = []
    units = rows[1] if len(rows) > 1 else []
    if len(units) != len(names) or all(is_number(word) for word in units):
        raise DigiclayError(f"{path}, row 2 must be the units of the columns, such as s,mm,N.")
    for name, word in zip(names, units, strict=True):
        wanted, plain = known[name], normalize(word.strip())
        factor, si = UNITS.get(plain, (1.0, "") if plain in ("", "1", "-") else (0.0, "?"))
        if si != wanted:
            rule = f"must be in {wanted or 'no unit'}" + (" or a multiple of it" if wanted else "")
            raise DigiclayError(f"{path}, row 2: {name} {rule} (got {word.strip()[:20]!r}).")
        factors.append(factor)
    values = np.empty((len(rows) - 2, len(names)))
    for number, row in enumerate(rows[2:]):
        try:
            values[number] = np.array(row, np.float64)
        except ValueError:
            values[number] = np.nan
        if not np.isfinite(values[number]).all():
            rule = f"must be {len(names)} finite numbers (got {','.join(row)[:40]!r})"
            raise DigiclayError(f"{path}, row {number + 3} {rule}.")
    return names, values * factors


def _check_trial(trial: Trial, drive: str, answer: str) -> None:
    """Refuse a trial whose samples cannot be fitted; ValueError with the rule and the value."""
    time, given, measured = trial.time, trial.drive, trial.answer
    if time.size < LEAST:
        raise ValueError(f"must have at least {LEAST} samples (got {time.size})")
    backward = np.flatnonzero(np.diff(time) <= 0.0)
    if backward.size:
        at = time[backward[0] : backward[0] + 2]
        raise ValueError(f"time must increase (got {at[1]:g} s after {at[0]:g} s)")
    if drive == "command":
        if np.abs(given).max() > 1.0:
            raise ValueError(
                f"command must be from -1 to 1 (got {given[np.abs(given).argmax()]:g})"
            )
        if np.ptp(given) == 0.0 and given[0] == 0.0:
            raise ValueError("command must move the valve (got 0 throughout)")
    for end in (measured.min(), measured.max()) if drive == "command" else (measured.max(),):
        held = (measured == end) & (given != 0.0)
        edges = np.flatnonzero(np.diff(np.concatenate(([0], held, [0]))))
        longest = int(np.diff(edges)[::2].max(initial=0))
        if longest >= CLIPPED:
            raise ValueError(f"{answer} is clipped at {end:g} ({longest} equal samples in turn)")
    if drive == "command":
        return
    noise = estimate_noise(measured)
    width = max(3, time.size // 100)
    level = np.convolve(measured, np.ones(width) / width, "valid")
    clear = CLEAR * max(noise, 1e-9) * (1.0 / width**0.5 + 0.2)
    if np.ptp(level) < clear:
        raise ValueError(
            f"it never touches: {answer} stays within ± {1e3 * np.ptp(level) / 2:.2g} mN"
        )
    if level[0] - level.min() > clear:
        above = 1e3 * (level[0] - level.min())
        raise ValueError(
            f"it must begin without contact ({answer} falls by {above:.3g} mN from its start)"
        )
    if given[measured.argmax()] <= given[0]:
        raise ValueError(
            f"{drive} must grow into the finger (it falls towards the largest {answer})"
        )
