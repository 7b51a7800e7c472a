"""Bad measurements for `digiclay fit`: each is refused in one line that names file, rule and value."""

import numpy as np
import pytest
from digiclay.cli import main
from digiclay.core.base.errors import DigiclayError

from digiclay_fit.records import MOST, read_records
from tests.scene_files import write_text

TIME = np.arange(200) * 5e-3
DEPTH = np.clip(TIME - 0.2, 0.0, 0.5) * 4.0 - 0.3  # mm
NOISE = np.random.default_rng(1).normal(0.0, 1e-3, TIME.size)
FORCE = np.where(DEPTH > 0.0, DEPTH**2, 0.0) + NOISE
PULP = {"time": TIME, "position": DEPTH, "force": FORCE}
CELL = {"time": TIME, "command": np.sign(np.sin(20.0 * TIME)), "height": 40.0 + np.cos(20.0 * TIME)}
UNITS = {"time": "s", "position": "mm", "force": "N", "command": "", "height": "mm", "load": "mN"}


def write(path, columns, units=UNITS, last=""):
    """Write a file of columns with a row of units; `last`: a further row."""
    rows = [",".join(columns), ",".join(units.get(name, "") for name in columns)] if units else []
    rows = rows or [",".join(columns)]
    rows += [
        ",".join(f"{value:.9g}" for value in row) for row in zip(*columns.values(), strict=True)
    ]
    write_text(path, "\n".join([*rows, last]) + "\n")


def put(column, place, value, columns=PULP):
    """Return columns with another value."""
    changed = columns[column].copy()
    changed[place] = value
    return columns | {column: changed}


BAD = {
    "time decreases": (put("time", 100, 0.2), {}, "trial 0: time must increase (got 0.2 s after 0.495"),
    "NaN": (put("force", 7, np.nan), {}, "row 10 must be 3 finite numbers (got '0.035,"),
    "infinite": (put("position", 7, np.inf), {}, "row 10 must be 3 finite numbers"),
    "a row too short": (PULP, {"last": "1.0,2.0"}, "row 203 must be 3 finite numbers (got '1.0,2.0')"),
    "no unit row": (PULP, {"units": None}, "row 2 must be the units of the columns"),
    "a wrong unit": (PULP, {"units": UNITS | {"force": "mm"}}, "row 2: force must be in N or a multiple"),
    "an unknown unit": (PULP, {"units": UNITS | {"time": "min"}}, "row 2: time must be in s or a multiple"),
    "other columns": ({"t": TIME, "x": DEPTH, "F": FORCE}, {}, "must have the columns time, position, force"),
    "a column twice": (PULP | {"commanded": DEPTH}, {"units": UNITS | {"commanded": "mm"}}, "must have the"),
    "empty": ({}, {"units": None}, "must have the columns time, position, force"),
    "three samples": ({k: v[:3] for k, v in PULP.items()}, {}, "at least 20 samples (got 3)"),
    "begins pressed": (PULP | {"force": FORCE[::-1], "position": DEPTH}, {}, "must begin without contact"),
    "never touches": (PULP | {"force": NOISE}, {}, "it never touches"),
    "clipped": (PULP | {"force": np.minimum(FORCE, 1.0)}, {}, "force is clipped at 1 "),
    "pulls": (PULP | {"position": -DEPTH}, {}, "position must grow into the finger"),
    "a command of 2": (put("command", 3, 2.0, CELL), {}, "command must be from -1 to 1 (got 2)"),
    "no command": (CELL | {"command": 0.0 * TIME}, {}, "command must move the valve"),
    "an end stop": (CELL | {"height": np.minimum(CELL["height"], 40.5)}, {}, "height is clipped at 0.0405"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_a_bad_record_is_refused_in_a_line(tmp_path, name):
    columns, how, words = BAD[name]
    path = tmp_path / "record.csv"
    write(path, columns, **how)
    with pytest.raises(DigiclayError) as caught:
        read_records([path], "cell" if "height" in columns else "pulp")
    text = str(caught.value)
    assert words in text
    assert text.startswith(str(path))
    assert "\n" not in text
    assert len(text) <= 400


def test_too_many_samples_are_refused_before_they_are_read(tmp_path):
    path = tmp_path / "long.csv"
    write_text(path, "time,position,force\ns,mm,N\n" + "nonsense\n" * (MOST + 1))
    with pytest.raises(DigiclayError, match=r"at most 200,000 samples: thin them \(got 200,001\)"):
        read_records([path], "pulp")


def test_semicolons_are_refused_with_the_remedy(tmp_path):
    path = tmp_path / "from a spreadsheet.csv"
    write_text(path, "time;position;force\ns;mm;N\n0,001;0,5;0,1\n")
    with pytest.raises(DigiclayError, match=r"sheet.csv must use commas .* decimals \(got ';'\).$"):
        read_records([path], "pulp")


def test_units_names_and_trials_are_read(tmp_path):
    for path, factor in ((tmp_path / "a.csv", 1.0), (tmp_path / "b.csv", 1e3)):
        columns = {"trial": np.repeat((1, 2), 100), "time": TIME, "load": factor * np.ones(200)}
        columns |= {"command": CELL["command"], "height": CELL["height"]}
        write(path, columns, UNITS | {"load": "N" if factor == 1.0 else "mN"}, last="\n\n")
    one, both = read_records([path], "cell"), read_records([tmp_path / "a.csv", path], "cell")
    assert [trial.name for trial in one] == ["1", "2"]
    assert [trial.name for trial in both] == ["a:1", "a:2", "b:1", "b:2"]
    assert one[0].load[0] == both[0].load[0] == pytest.approx(1.0)
    assert one[0].answer[0] == pytest.approx(41e-3)
    with pytest.raises(DigiclayError, match=r"different names .got b:1 twice"):
        read_records([path, path], "cell")


SHORT = ["actuator.rest_height=1 mm", "--set", "actuator.stroke=2 mm"]


@pytest.mark.parametrize(
    "words, said",
    [
        (["none.csv", "--part", "pulp"], "none.csv: there is no such file"),
        (["fingertp", "--part", "pulp"], "Did you mean fingertip?"),
        (["fingertip", "--part", "cell"], "must have the columns time, command, height"),
        (["fingertip", "--part", "pulp", "--free", "valve"], "--free must be of contact, relaxation"),
        (["fingertip", "--part", "pulp", "--holdout", "9"], "--holdout must be of the trials 1, 2, 3 (got"),
        (["fingertip", "--part", "pulp", "--holdout", "1,2,3"], "--holdout must leave a trial"),
        (["fingertip", "--part", "pulp", "--set", "fingertip=absent"], "fingertip must be given"),
        (["fingertip", "--part", "pulp", "--set", "relaxation=absent"], "relaxation must be given"),
        (["fingertip", "--part", "pulp", "--scene", "pinch_crease"], "a single finger (got 2)"),
        (["valve", "--part", "cell", "--set", *SHORT], "height must change by less than"),
    ],
)  # fmt: skip
def test_a_wrong_word_is_refused_in_a_line(tmp_path, monkeypatch, capsys, words, said):
    monkeypatch.chdir(tmp_path)
    assert main(["fit", *words]) == 2
    text = capsys.readouterr().err
    assert said in text
    assert text.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
