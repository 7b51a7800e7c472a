"""Mistakes in control methods of one's own: each is one line with file and rule, and nothing is written."""

from pathlib import Path

import pytest
from digiclay.cli import main
from digiclay.core.base.errors import MethodError
from digiclay.core.control.methods import list_added
from digiclay.core.session.run_scene import run
from digiclay.plugins.method_loader import load_method

from tests.own_methods import (
    PAD,
    bad,
    building,
    commanding,
    keeping,
    ordering,
    refused,
    small,
    write_method,
)
from tests.scene_files import write_text

pytestmark = pytest.mark.usefixtures("folder", "no_methods")


def refusal(text, attribute="Bad"):
    write_method(Path(), text, "bad.py")
    with pytest.raises(MethodError) as caught:
        run(small(load_method(f"bad.py:{attribute}")))
    said = str(caught.value)
    assert "\n" not in said
    assert said.startswith(("bad.py:", "bad.py ")), said
    return said


NONE = "command = lambda *_: None\n"


def test_a_scene_never_loads_code_by_itself(folder, capsys):
    write_method(folder)
    for word in ("soft_pad", "pad.py:SoftPad"):
        write_text(folder / "my.toml", f'[control]\nmethod = "{word}"\n')
        said = refused(capsys, "run", "my.toml")
        assert "my.toml: control.method must be one of virtual_master" in said
        assert "--method path/to/mine.py:Mine" in said
        assert list_added() == {}
    assert [path.name for path in folder.iterdir() if path.is_dir()] == []


@pytest.mark.parametrize(
    "text, rule",
    [
        (
            "import nothing_of_this_name",
            "the code must not raise (got ModuleNotFoundError in line 1: No",
        ),
        ("x = (", "pad.py: the code must not raise (got SyntaxError in line 1"),
        ("raise SystemExit(3)", "pad.py: the code must not raise (got SystemExit in line 1: 3)"),
        (
            "x = 1",
            "pad.py:SoftPad: the file must have the class SoftPad (it has no control method).",
        ),
        (
            PAD.replace("SoftPad", "Pad"),
            "the file must have the class SoftPad (it has pad.py:Pad).",
        ),
        ("SoftPad = 3", "the class must derive from digiclay.Method (got int)"),
        (
            PAD.replace("@dataclass(frozen=True)", "").replace("step: float", "step"),
            "no type annotation",
        ),
        (PAD.replace("def command", "def comand"), "must have a function command(self, "),
        (
            PAD.replace('unit="m"', 'unit="inch"'),
            "SoftPad.step must have one of the units m, s, Pa, ",
        ),
        (PAD.replace("quantity(50e-6", "quantity([1]"), "mutable default"),
        (
            PAD.replace("quantity(50e-6", "quantity(None"),
            "the default of step must be a bool, int, float",
        ),
        (
            PAD.replace("quantity(50e-6", "quantity(-1.0"),
            "the default of step must be above 0 m (got -1 m)",
        ),
        (PAD.replace("step: float", "method: float"), "nor be called method, begin"),
        (PAD + "\n    loose: float = 3.0\n", "the field loose must be declared with quantity"),
        (PAD + "\n    rows = -1\n", "rows must be from 0 to 1000 (got -1)"),
        (PAD + "\n    blister = 3\n", "blister must be None or a dictionary of defaults (got int)"),
        (
            PAD + '\n    blister = {"radius": -1.0}\n',
            "blister must hold values of the section [blister]",
        ),
    ],
)
def test_a_class_that_is_no_method_is_refused_in_a_line(folder, text, rule, capsys):
    write_method(folder, text)
    said = refused(capsys, "run", "tap", "--method", "pad.py:SoftPad")
    assert said.startswith("--method: pad.py")
    assert rule in said
    assert [path.name for path in folder.iterdir()] == ["pad.py"]


@pytest.mark.parametrize(
    "word, rule",
    [
        (
            "absent.py:Mine",
            "absent.py cannot be read as a control method: No such file or directory.",
        ),
        ("absent.py", "absent.py must be a file and a class in it, such as absent.py:Mine."),
        (":Mine", "must be a file and a class in it"),
        (".:Mine", "cannot be read as a control method: Is a directory."),
        ("bytes.py:Mine", "bytes.py must be UTF-8 text (byte 0 is not)."),
        ("large.py:Mine", "large.py must have at most 1 MB of code (got 1)."),
        ("magic", "control.method must be one of virtual_master"),
    ],
)
def test_a_word_that_names_no_code_is_refused_in_a_line(folder, word, rule, capsys):
    (folder / "bytes.py").write_bytes(b"\xff\xfe")
    (folder / "large.py").write_bytes(b"#" * 1_000_001)
    said = refused(capsys, "run", "tap", "--method", word)
    assert (said.startswith("--method: "), rule in said) == (True, True), said


@pytest.mark.parametrize(
    "text, rule",
    [
        (ordering("Orders(height=cells.height[:-1])"), "command must return height of the shape ("),
        (ordering("Orders(opening=cells.height * np.nan)"), "return opening as finite numbers (got nan)"),
        (ordering("Orders(height=cells.height * 1j)"), "height as real numbers (got complex128)"),
        (ordering("Orders(mode=cells.height)"), "mode as whole numbers (got float64)"),
        (ordering("Orders(mode=np.full(cells.height.size, 8))"), "codes of Mode, from 0 to 7 (got 8)"),
        (ordering("Orders(rows=cells.height)"), "rows of the shape (0, "),
        (ordering("cells.height"), "must return Orders as its second result (got ndarray)"),
        (commanding("pass"), "command must return two results, memory and orders (got NoneType)."),
        (ordering("__import__('sys').exit(3)"), "command must not raise (got SystemExit in line 11: 3)."),
        (building("raise SystemExit(3)"), "build must not raise (got SystemExit in line 11: 3)."),
        (bad(f"{NONE}set_point = property(lambda self: exit(3))"), "must not raise (got SystemExit: 3)"),
        (bad(f"{NONE}set_point = 3"), "set_point must be a SetPoint or None (got int)."),
        (bad(f"{NONE}def check(self):\n    exit(3)"), "must pass its own check (got SystemExit: 3)."),
        (ordering("1 / 0"), "command must not raise (got ZeroDivisionError in line 11: division by zero)"),
        (ordering("cells.force.sort() or Orders()"), "got ValueError in line 11: sort array is read-only"),
        (bad(f"{NONE}begin = lambda self, device: []"), "begin must return a"),
        (bad(f"{NONE}locate = lambda *_: 3"), "two results, memory and a disc, or None (got int)."),
        (bad(f"{NONE}locate = lambda self, memory, *_: (memory, (0, 0))"), "the disc of the shape (3,)"),
        (keeping("0.0", "cells.force"), "must keep the kinds of its memory, here float (got ndarray)."),
        (keeping("0.0", "float('nan')"), "command must return a memory without NaN."),
        (keeping("True", "1"), "command must keep the kinds of its memory, here bool (got int)."),
        (keeping("np.zeros(3)", "np.zeros((3, 3))"), "array of 1 dimensions and float64 (got 2 and"),
        (
            commanding("raise DigiclayError('no finger')").replace(
                "import numpy", "from digiclay.core.base.errors import DigiclayError\nimport numpy"),
            "command must not raise (got DigiclayError in line 12: no finger).",
        ),
        (building("return 3"), "build must return a controller with begin (got"),
        (
            building(
                "from types import SimpleNamespace\n"
                "    return SimpleNamespace(begin=int, locate=int, command=int, rows=-1)"
            ),
            "build must have rows, a whole number from 0 to 1000 (got -1).",
        ),
    ],
)  # fmt: skip
def test_a_mistake_while_it_runs_is_a_line_with_file_and_rule(text, rule):
    said = refusal(text)
    assert said.startswith("bad.py:Bad: ")
    assert rule in said


#: Each call takes more than twenty control periods.
SLOW = bad(
    "def command(self, memory, cells, device):\n"
    "    import time\n"
    "    end = time.thread_time() + 22 * device.period\n"
    "    while time.thread_time() < end: pass\n"
    "    return memory, Orders()"
)


def run_quickly(*more):
    period = [
        "--set",
        "simulation.control_period=0.2 ms",
        "--set",
        "simulation.physics_step=0.2 ms",
    ]
    return main(["run", "tap", "--method", "bad.py:Bad", *period, "--quiet", *more])


def test_a_method_that_is_too_slow_is_refused(folder, capsys):
    write_method(folder, SLOW, "bad.py")
    assert run_quickly() == 2
    said = capsys.readouterr().err
    assert "command must take at most 20 control periods of processor time per call (got 2" in said
    assert [path.name for path in folder.iterdir()] == ["bad.py"]


def test_one_slow_call_is_no_slow_method(folder):
    once = SLOW.replace("while", "while memory == 0 and").replace("return memory", "return 1")
    write_method(
        folder,
        once.replace("def command", "begin = lambda self, device: 0\n    def command"),
        "bad.py",
    )
    assert run_quickly("--set", "simulation.duration=0.008", "--no-errors", "--out", "r") == 0


@pytest.mark.parametrize(
    "commands, rule",
    [
        (
            "seen.target, seen.mode, seen.height * 0 + 1.5",
            "must return commands from -1 to 1 (got 1.5).",
        ),
        (
            "seen.target, seen.mode + 9, seen.height * 0",
            "must return mode as codes of Mode, from 0 to 7",
        ),
        ("seen.target, None, seen.height * 0", "must return mode of the shape ("),
        ("None, seen.mode, seen.height * 0", "must return target of the shape ("),
        ("seen.height.sort() or 3", "sort array is read-only"),
        (
            "seen.target, seen.height",
            "must return three results, target, mode and command (got 2 results)",
        ),
        (
            "seen.target, seen.mode, seen.own.__setitem__(0, np.nan) or seen.height * 0",
            "rows as finite numbers",
        ),
    ],
)
def test_a_controller_of_ones_own_is_checked_as_well(commands, rule):
    text = bad("def build(self, device):\n    return Raw()")
    controller = f"""
class Raw:
    rows = 1
    begin = lambda self: 0
    locate = lambda self, memory, touched: (memory, None)
    command = lambda self, memory, seen: (memory, ({commands}))
"""
    said = refusal(text + controller)
    assert said.startswith("bad.py:Bad: command ")
    assert rule in said


def test_two_methods_of_one_name_are_refused(folder):
    write_method(folder)
    write_method(folder, PAD.replace("50e-6", "60e-6"), "other.py")
    assert (
        load_method("pad.py:SoftPad") == load_method(str(folder / "pad.py:SoftPad")) == "soft_pad"
    )
    with pytest.raises(MethodError, match=r"soft_pad must be unique \(also that of pad.py\)"):
        load_method("other.py:SoftPad")
    write_method(folder, PAD.replace("SoftPad", "Elastic"), "elastic.py")
    with pytest.raises(MethodError, match=r"must not have the name of the built-in method elastic"):
        load_method("elastic.py:Elastic")
