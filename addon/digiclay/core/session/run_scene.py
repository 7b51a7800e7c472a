"""Session from scene to results: simulation, recording, run folder."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from pathlib import Path

from ..base.errors import OutputError
from ..engine.simulation import begin, periods
from ..scene.assembly import assemble
from ..scene.recorder import RunRecording, write
from ..scene.schema import Scene
from ..scene.toml_table import format_scene
from .memory_limit import check_memory
from .run_result import Ended, Result, count_losses, evaluate

__all__ = ["Result", "run", "save"]


def run(
    scene: Scene,
    *,
    progress: Callable[[int, int], None] | None = None,
    stopped: Callable[[], bool] | None = None,
    versions: Mapping[str, str] | None = None,
) -> Result:
    """Run a scene from rest to its end.

    `progress`: told after each control period how many are done, and of how many; `stopped`: asked after each
    control period; when it says True, the result is what there is so far; `versions`: what else to note as
    versions the run was made with. Raises ParameterError when the session cannot fit in memory. Raises
    DivergenceError when the integration leaves the finite numbers.
    """
    system = assemble(scene)
    check_memory(scene, system.rows)
    start = begin(system)
    recording = RunRecording(scene.recorder, system.rows, start, scene.periods) if scene.recorder else None
    started = time.perf_counter()
    for state in periods(system, scene.trajectories(), start, scene.periods):
        if recording:
            recording.observe(state)
        if progress:
            progress(state.period, scene.periods)
        if stopped and stopped():
            break
    took, losses = time.perf_counter() - started, count_losses(state.memory)
    rows = recording.finish(state.period) if recording else {}
    return evaluate(scene, system, rows, Ended(state.period, took, losses), versions or {})


def save(result: Result, folder: Path) -> None:
    """Write ``scene.toml``, ``history.npz`` and ``metrics.json`` into an existing folder.

    Raises OutputError when the folder cannot be written.
    """
    try:
        (folder / "scene.toml").write_text(format_scene(result.scene), encoding="utf-8")
        if result.history:
            write(result.history, folder / "history.npz")
        metrics = json.dumps(result.metrics, indent=2, ensure_ascii=False, allow_nan=False)
        (folder / "metrics.json").write_text(metrics + "\n", encoding="utf-8")
    except OSError as error:
        raise OutputError(f"Cannot write into {folder}: {error.strerror or error}.") from None
