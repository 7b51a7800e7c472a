"""Ends of a command: stopped with the computed rows kept, or refused in one line; exit codes."""

from __future__ import annotations

import importlib
import importlib.util
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any

from ..core.base.errors import OutputError

if TYPE_CHECKING:
    from ..core.scene.schema import Scene

#: Some jobs of a batch failed; what the user asked for cannot be done; stopped by Ctrl-C or SIGTERM.
FAILED, WRONG, STOPPED = 1, 2, 130


#: What asks to stop; Windows has no SIGHUP.
ASKING = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]


class Stop:
    """Block in which a first signal is noted and a second one interrupts; the first if `requested`."""

    def __init__(self, *, requested: bool = False) -> None:
        self.requested = requested
        self._former: dict[int, Any] = {}

    def __call__(self) -> bool:
        """Return whether a stop was requested."""
        return self.requested

    def __enter__(self) -> Stop:
        # Python takes signals in its main thread only; elsewhere there are none.
        with suppress(ValueError):
            for number in ASKING:
                # A closed terminal does not end what nohup has begun.
                if number in ASKING[:2] or signal.getsignal(number) != signal.SIG_IGN:
                    self._former[number] = signal.signal(number, self._note)
        return self

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self.requested:
            raise KeyboardInterrupt
        self.requested = True

    def __exit__(self, *raised: object) -> None:
        for number, handler in self._former.items():
            # Python does not know a handler that Blender itself has set, and cannot set it again.
            signal.signal(number, signal.SIG_DFL if handler is None else handler)


def allow_interrupt() -> Stop:
    """Let a first signal interrupt at once, SIGTERM as Ctrl-C does: where there is nothing to be kept."""
    return Stop(requested=True)


@contextmanager
def defer_interrupt() -> Iterator[None]:
    """Let Ctrl-C wait for the end of the block: libraries take an interrupted import for a broken one."""
    with Stop() as stop:
        yield
    if stop():
        raise KeyboardInterrupt


def require_surface(scene: Scene, option: str) -> None:
    """Refuse to make a surface of a bed that has none. `option`: what asks for the surface."""
    if min(scene.layout.rows, scene.layout.columns) < 2:
        raise OutputError(
            f"{option} needs at least 2 x 2 cells (got {scene.layout.rows} x {scene.layout.columns})."
        )


def refuse_without(option: str, extra: str, *modules: str) -> None:
    """Refuse what needs libraries of an extra of this package that are not installed."""
    for module in modules:
        if importlib.util.find_spec(module) is None:
            raise OutputError(f"{option} needs {module}: run 'pip install digiclay[{extra}]'.")


def refuse_without_blender() -> None:
    """Refuse without Blender's module, with the command that installs it."""
    with defer_interrupt():
        importlib.import_module("..compat", __package__)


def refuse_unwritable(folder: Path) -> None:
    """Refuse a folder that is none, or that cannot be made or written to."""
    above = next(path for path in (folder, *folder.resolve().parents) if os.path.lexists(path))
    if not os.path.isdir(above):
        raise OutputError(f"{folder} cannot be a folder: {above.name} is a file.")
    if not os.access(above, os.W_OK | os.X_OK):
        raise OutputError(f"{folder} cannot be written to.")


def refuse_file(out: Path, ending: str) -> None:
    """Refuse a file that cannot be written, or whose name promises another format."""
    if out.suffix.lower() != ending:
        raise OutputError(f"--out must end with {ending} (got {out}).")
    if os.path.isdir(out):
        raise OutputError(f"--out must be a file ({out} is a folder).")
    refuse_unwritable(out.parent)
