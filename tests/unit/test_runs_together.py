"""The benchmark of stacks: what it varies, its table, what it keeps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from digiclay.core.batch.packing import describe_structure
from digiclay.core.scene.scene_source import find, load
from digiclay.core.studies.axes import Point
from digiclay.core.studies.evaluation import LEAST, make_bundles

from benchmarks import runs_together
from benchmarks.__main__ import main
from benchmarks.runs_together import STUDIES, Size, study


@pytest.mark.parametrize("name", list(STUDIES))
def test_the_runs_of_a_study_differ_and_stand_together(name: str) -> None:
    scenes = study(load(find("tap")), name, LEAST)
    section, key, low, high = STUDIES[name]
    usual = getattr(load(find("tap")).section(section), key)
    values = np.array([getattr(scene.section(section), key) for scene in scenes])
    assert np.all(np.diff(values) > 0.0)
    assert low * usual < values[0] < values[-1] < high * usual
    assert len({describe_structure(scene) for scene in scenes}) == 1
    assert make_bundles([Point(i, (), scene) for i, scene in enumerate(scenes)]).alone == ()


def test_the_benchmark_prints_and_keeps_a_table_and_a_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(runs_together, "COUNTS", (1, 4))
    monkeypatch.setattr(runs_together, "REST", 0.0)
    out = ["--out", str(tmp_path)]
    assert main(["stack", "--scene", "tap", "--quick", "--quiet", *out]) == 0
    said = capsys.readouterr().out
    assert "control.force_gain varies" in said
    assert "valve.stroke varies" in said
    assert sorted(path.name for path in tmp_path.iterdir()) == ["stack.csv", "stack.md", "stack.png"]
    lines = (tmp_path / "stack.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0] == ("study,runs,alone,stacked,judged_alone,judged_stacked,errors_alone,errors_stacked")
    assert [line.split(",")[:2] for line in lines[1:]] == [[s, n] for s in STUDIES for n in ("1", "4")]


def test_the_table_gives_runs_a_second_and_their_ratio() -> None:
    row = runs_together._row(Size("control", 64, 0.1, 0.01, 0.2, 0.05, 0.5, 0.1))
    assert row == ["64", "10", "100", "10.0", "5", "20", "4.0", "2", "10", "5.0"]
