"""`digiclay.scene` and `digiclay.run`, by which Python programs simulate a session."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import digiclay
import numpy as np
import pytest
from digiclay.core.base.errors import DigiclayError
from digiclay.core.scene.scene_source import find, load
from digiclay.core.scene.toml_table import format_scene, resolve

from tests.other_process import finish, start

SMALL = {"layout": {"rows": 5, "columns": 5}, "control": "absent", "simulation": {"duration": "50 ms"}}


def test_a_scene_is_of_tables_of_a_file_a_name_or_nothing(tmp_path: Path) -> None:
    file = tmp_path / "my.toml"
    file.write_text(format_scene(resolve(SMALL, "my")), encoding="utf-8")
    assert digiclay.scene(SMALL) == resolve(SMALL)
    assert digiclay.scene(file) == digiclay.scene(str(file)) == load(file)
    assert digiclay.scene("ridge_mound_valley") == load(find("ridge_mound_valley"))
    assert digiclay.scene() == digiclay.scene({}) == resolve({})


def test_a_run_has_heights_metrics_and_a_summary() -> None:
    program = "import sys, digiclay; print({'numpy', 'digiclay.core'} & {*sys.modules})"
    assert finish(start(program))[1] == "set()\n"  # importing it imports no part of the simulation
    periods: list[tuple[int, int]] = []
    done = digiclay.run(digiclay.scene(SMALL), lambda *counts: periods.append(counts))
    assert periods == [(count, 10) for count in range(1, 11)]
    assert done.history["height"].shape == done.history["force"].shape == (11, 25)
    np.testing.assert_allclose(done.history["time"], np.arange(11) * 5e-3)
    assert done.metrics["simulated"] == pytest.approx(0.05)
    assert done.metrics["versions"]["digiclay"] == digiclay.__version__
    assert done.summary().startswith("0.1 s simulated in ")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"contrl": {}}, "contrl must be a known key (got an empty section). Did you mean control?"),
        ({"valve": {"orifice_diameter": "3 s"}}, "valve.orifice_diameter must be in m or a multiple"),
        ("no_such_scene", "no_such_scene is neither a file nor a sample"),
        (7, "A scene must be tables, a file or a name (got 7)."),
    ],
)
def test_a_wrong_scene_is_refused_in_one_line(content: Any, message: str) -> None:
    with pytest.raises(DigiclayError) as caught:
        digiclay.scene(content)
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)
