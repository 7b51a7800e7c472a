"""Digital Clay: shape-design sessions on a simulated bed of fluidic pins.

As a package this is the simulation (`digiclay.core`) and its command line; as a Blender
extension it registers what shows in Blender. Importing it does no work and needs no Blender.
From Python, ``digiclay.run(digiclay.scene({"layout": {"rows": 15}}))`` simulates a session.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .core.version import __version__ as __version__

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from os import PathLike

    from .core.scene.schema import Scene
    from .core.session.run_scene import Result


def register() -> None:
    """Add the extension's properties, operators and panels; Blender calls this when it is enabled."""
    from . import registration

    registration.register()


def unregister() -> None:
    """Take back all that `register` added."""
    from . import registration

    registration.unregister()


def scene(content: Mapping[str, Any] | str | PathLike[str] | None = None) -> Scene:
    """Return a scene: all parameters of a session as one valid value.

    Parameters
    ----------
    content : mapping, path or name, optional
        Tables as in a scene file, ``{"control": {"force_setpoint": "0.3 N"}}``; a scene file, the folder of
        a run, or the name of a sample scene such as ``"ridge_mound_valley"``, the session of the paper. What
        is left out has its default: the device of the paper, pressed once at its middle.

    Returns
    -------
    Scene
        Frozen; its parts are attributes, such as ``scene.control.force_setpoint``, in SI units.

    Raises
    ------
    DigiclayError
        When a key or value is wrong; its text is one line with key, rule and value.
    """
    import os
    from collections.abc import Mapping

    from .core.base.errors import SceneError
    from .core.scene import scene_source, toml_table

    if isinstance(content, (str, os.PathLike)):
        return scene_source.load(scene_source.find(os.fspath(content)))
    if content is not None and not isinstance(content, Mapping):
        raise SceneError(f"A scene must be tables, a file or a name (got {content!r:.60}).")
    return toml_table.resolve(content or {})


def run(scene: Scene, progress: Callable[[int, int], None] | None = None) -> Result:
    """Simulate a scene from rest to its end.

    Parameters
    ----------
    scene : Scene
        From `scene`.
    progress : callable, optional
        Given after each control period how many are done, and of how many.

    Returns
    -------
    Result
        ``history``, the arrays of ``history.npz`` by name: ``time`` (t,), s; ``height`` (t, n), m; ``force``
        (t, n) and ``total_force`` (t,), N; ``position`` of the pins (n, 2), m; and more. ``metrics``, the
        content of ``metrics.json``, in SI units. ``summary()``, the session in one line.

    Raises
    ------
    DigiclayError
        When the session does not fit into memory, or the integration leaves the finite numbers.
    """
    from .core.session import run_scene

    return run_scene.run(scene, progress=progress)
