"""Wherever an RFD stands, losses and time without contact stand beside it, where there are any."""

import pytest

from tests.scene_files import call, rows, scene_text

#: A lift at 24 mm/s, just as fast as a pin rises, and one at 5 mm/s, that Method I follows.
LIFTS = {"lost once": 24e-3, "": 5e-3}
FOUR = "--vary control.force_gain=2,2.1,2.2,2.3 --workers 1"
COMMANDS = {
    "run": ("run my.toml", ""),
    "batch": ("batch jobs.toml", "index.html"),
    "sweep of a batch": (f"sweep my.toml {FOUR}", "sweep.csv"),
    "sweep one by one": ("sweep my.toml --vary control.force_gain=2,2.1", "sweep.csv"),
}


@pytest.mark.parametrize("name, said", [*((name, "lost once") for name in COMMANDS), ("run", "")])
def test_losses_are_told_where_there_are_any(name, said, here, capsys):
    words, table = COMMANDS[name]
    points = [(0.0, 0.041), (0.2, 0.037), (0.5, 0.037), (1.5, 0.037 + LIFTS[said])]
    text = scene_text(13, 13, *points) + 'interpolation = "linear"\n[control]\nmethod = "virtual_master"\n'
    (here / "my.toml").write_text(text, encoding="utf-8")
    (here / "jobs.toml").write_text('scenes = ["my.toml"]\nerrors = false\n', encoding="utf-8")
    assert call(f"{words} --out out") == 0
    shown = (here / "out" / table).read_text(encoding="utf-8") if table else ""
    if table.endswith(".csv"):
        assert {row["lost"].partition(",")[0] for row in rows(here / "out" / table)} == {said}
    told = capsys.readouterr().out + (shown if table else "")
    assert ("lost once" in told, "s without contact" in told) == (bool(said), bool(said))
