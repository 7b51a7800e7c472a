"""Steps of a job: the session, its errors, meshes, pictures and films."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from .. import __version__
from ..core.base.errors import OutputError
from ..core.scene.schema import Scene
from ..core.session.accuracy import estimate_errors, has_every_command
from ..core.session.run_scene import run, save
from ..core.studies.job_outputs import Outputs
from ..plugins.method_copy import describe_origin
from .export import exported, formats
from .refusals import refuse_what_has_no_surface, refuse_without_blender
from .render import draw_film, draw_still, draw_turntable
from .thumbnail import of_heights, of_picture

#: Seconds between two lines of progress.
PAUSE = 0.2

#: Told of a step, and of how much of the whole job is done.
Tell = Callable[[str, float], None]


def check_outputs(scene: Scene, outputs: Outputs) -> None:
    """Refuse, before any work, what is bound to fail after it."""
    if outputs.export:
        try:
            formats(",".join(outputs.export))
        except argparse.ArgumentTypeError as error:
            raise OutputError(f"export: {error}.") from None
        refuse_what_has_no_surface(scene, "export")
    if (outputs.needs_blender or outputs.export) and scene.recorder is None:
        raise OutputError("Pictures and exports need a recorder, and the scene has recorder = 'absent'.")
    if outputs.needs_blender:
        refuse_without_blender()


def make_outputs(
    scene: Scene,
    outputs: Outputs,
    out: Path,
    timing: dict[str, Any],
    stopped: Callable[[], bool],
    tell: Tell,
) -> None:
    """Run the session, and make all that belongs to it.

    `out`: the folder; `timing`: gets the seconds of each step; `stopped`: whether to stop; asked all the
    time; `tell`: told of a step, and of how much of the whole job is done. Raises KeyboardInterrupt when it
    was stopped.
    """
    names = ["run", *(n for n in ("errors", "export", "still", "turntable", "film") if getattr(outputs, n))]
    told = 0.0

    @contextmanager
    def step(name: str) -> Iterator[Callable[[int, int], None]]:
        """Time a step; give what is to be called with how much of it is done."""

        def progress(done: int, total: int) -> None:
            nonlocal told
            if time.monotonic() - told >= PAUSE:
                told = time.monotonic()
                tell(name, (names.index(name) + done / total) / len(names))

        if stopped():
            raise KeyboardInterrupt
        began = time.perf_counter()
        yield progress
        timing[name] = time.perf_counter() - began

    with step("run") as progress:
        versions = {"digiclay": __version__, **describe_origin(scene)}
        result = run(scene, progress=progress, stopped=stopped, versions=versions)
        if result.incomplete:
            raise KeyboardInterrupt
    if outputs.errors:
        with step("errors") as progress:
            if has_every_command(scene):
                errors = estimate_errors(scene, result.history, progress=progress, stopped=stopped)
                if errors is None:
                    raise KeyboardInterrupt
                result = result.with_errors(errors)
    with step("save"):
        save(result, out)
    history = result.history
    if not history:
        return
    if outputs.export:
        with step("export"):
            exported(scene, history, -1, outputs.export, out, outputs.mesh)
    if outputs.still:
        with step("still"):
            draw_still(scene, history, outputs.still, out / "still.png")
    if outputs.turntable:
        with step("turntable") as progress:
            path = out / "turntable.mp4"
            if not draw_turntable(scene, history, outputs.turntable, path, progress, stopped):
                raise KeyboardInterrupt
    if outputs.film:
        with step("film") as progress:
            if not draw_film(scene, history, outputs.film, out / "film.mp4", progress, stopped):
                raise KeyboardInterrupt
    with step("thumbnail"):
        if outputs.still:
            of_picture(out / "still.png", out)
        else:
            of_heights(history["height"][-1], scene.layout.rows, scene.layout.columns, out)
