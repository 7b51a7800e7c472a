"""Digital Clay: shape-design sessions on a simulated bed of fluidic pins.

As a package this is the simulation, its command line, and for Python the functions below; as a Blender
extension it registers what shows in Blender. Importing it does no work and needs neither numpy nor Blender::

    scene = digiclay.scene("slow_press", {"control.method": "hybrid", "control.force_setpoint": "0.3
    N"}) run = digiclay.run(scene) run.save("out")
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .core.version import __version__ as __version__

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping
    from os import PathLike

    from numpy.typing import NDArray

    from .core.scene.schema import Scene
    from .front_door import Result

#: What is imported when it is first asked for, with its module and its name there.
LATER = {
    "DigiclayError": ("core.base.errors", "DigiclayError"),
    "METRICS": ("core.studies.evaluation", "FIGURES"),
    "Method": ("core.control.own_method", "OwnMethod"),
    "Mode": ("core.base.modes", "Mode"),
    "Orders": ("core.control.own_method", "Orders"),
    "Result": ("front_door", "Result"),
    "Scene": ("core.scene.schema", "Scene"),
    "SetPoint": ("core.model.control_interface", "SetPoint"),
    "force": ("core.session.probes", "force"),
    "free_speed": ("core.session.probes", "free_speed"),
    "plate_force": ("core.session.plate", "plate_force"),
    "quantity": ("core.base.quantity", "quantity"),
    "step_response": ("core.session.probes", "step_response"),
    "steps": ("core.session.probes", "steps"),
}
__all__ = ["load", "methods", "run", "samples", "scene", "sweep", *LATER]


def __getattr__(name: str) -> Any:
    """Import what is asked for."""
    if name not in LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, attribute = LATER[name]
    return getattr(import_module(f".{module}", __name__), attribute)


def __dir__() -> list[str]:
    """Return all names, those that are not imported yet too."""
    return sorted({*globals(), *LATER})


def register() -> None:
    """Add the extension's properties, operators and panels; Blender calls this when it is enabled."""
    from . import registration

    registration.register()


def unregister() -> None:
    """Take back all that `register` added."""
    from . import registration

    registration.unregister()


def scene(
    content: Scene | Mapping[str, Any] | str | PathLike[str] | None = None,
    changes: Mapping[str, Any] | None = None,
    *,
    with_: str | PathLike[str] | None = None,
) -> Scene:
    """Return a scene: all parameters of a session as one valid value.

    Parameters
    ----------
    content : Scene, mapping, path or name, optional
        Another scene; tables as in a scene file, ``{"control": {"force_setpoint": "0.3 N"}}``; a
        scene file, the folder of a run; or a name of `samples`, such as ``"ridge_mound_valley"``,
        the session of the paper. What is left out has its default: the device of the paper, pressed
        once at its middle.
    changes : mapping, optional
        Other values by their keys, ``{"control.method": "hybrid", "conduit": "absent"}``, or in
        nested tables. Numbers are in SI units, texts may have a unit, ``"0.3 N"``.
        ``control.method`` is a name of `methods`, a subclass of `Method`, or the file of one,
        ``"yielding.py:Yielding"``, whose code is then run. What follows from a changed method,
        preset or bed changes too.
    with_ : path, optional
        File of parts of device and finger, such as ``fitted.toml`` of ``digiclay fit``. They take
        the place of those of `content`; `changes` come last.

    Returns
    -------
    Scene
        Frozen; its parts are attributes, such as ``scene.control.force_setpoint``, in SI units.

    Raises
    ------
    DigiclayError
        When a key or value is wrong; its text is one line with key, rule and value.

    Examples
    --------
    >>> digiclay.scene("tap", {"layout.pitch": "4 mm"}).layout.pitch
    0.004
    """
    from .front_door import change_scene

    return change_scene({} if content is None else content, changes, with_)


def run(
    scene: Scene, progress: Callable[[int, int], None] | None = None, *, errors: bool = True
) -> Result:
    """Simulate a scene from rest to its end.

    Parameters
    ----------
    scene : Scene
        From `scene`.
    progress : callable, optional
        Called after each control period with the number done and the number of all.
    errors : bool
        Estimate the errors of the integration, in about the time of the run; see ``height_error``,
        ``force_error`` and ``total_force_error`` among the metrics.

    Returns
    -------
    Result
        ``history``, the arrays of ``history.npz`` by name: ``time`` (t,), s; ``height`` (t, n), m;
        ``force`` (t, n) and ``total_force`` (t,), N; ``position`` of the pins (n, 2), m; and more.
        ``metrics``, the content of ``metrics.json``, in SI units. ``finger_force`` (t, f), N, and
        ``fingers``, contact time and losses of each. ``save``, ``surface``, ``plot`` and
        ``summary`` are its methods.

    Raises
    ------
    DigiclayError
        When the session does not fit into memory, or the integration leaves the finite numbers.
    """
    from . import front_door

    return front_door.run(scene, progress, errors=errors)


def load(folder: str | PathLike[str]) -> Result:
    """Read a run from its folder, as `Result.save` and the command ``digiclay run`` write it.

    Parameters
    ----------
    folder : path
        Folder of a run, of this or an older version.

    Returns
    -------
    Result
        As of `run`. No code is run: if the scene's method is one of your own that is not loaded,
        its ``scene.control`` is None, and the scene is refused where it would be simulated or
        saved. If the loaded one has other code than that of the run, a warning says so.

    Raises
    ------
    DigiclayError
        When the folder is no run's, or a file is missing or damaged.
    """
    from . import front_door

    return front_door.load(folder)


def sweep(
    scene: Scene,
    varied: Mapping[str, Iterable[Any]],
    metrics: Iterable[str],
    progress: Callable[[int, int], None] | None = None,
) -> NDArray[Any]:
    """Run a scene over a grid of values, many points at once where they have the same bed, parts and steps.

    It runs in this process and keeps nothing. The command ``digiclay sweep`` uses all cores, and
    continues after a stop.

    Parameters
    ----------
    scene : Scene
        From `scene`, with a recorder.
    varied : mapping
        Lists of values by their keys, ``{"control.force_gain": [1, 2, 4]}``; the last key varies
        fastest.
    metrics : iterable of str
        Keys of `METRICS`.
    progress : callable, optional
        Called with the number of points done and the number of all.

    Returns
    -------
    ndarray
        Structured, a row for each point: ``table["rfd"]`` is a column, ``pandas.DataFrame(table)``
        the table. Columns are the varied keys and the metrics, in SI units; ``run_time``, s, and
        the estimated ``height_error``, m, and ``force_error``, N; ``lost``, losses of contact;
        ``error``, why a point failed. What a point does not have is NaN.

    Raises
    ------
    DigiclayError
        For an unknown key or metric, a value that is not allowed, no value at all, or if every
        point fails.
    """
    from . import front_door

    return front_door.sweep(scene, varied, metrics, progress)


def methods() -> dict[str, str]:
    """Return the control methods, and what each does, by the names of ``control.method``; your own too."""
    from .core.control.methods import list_methods

    return {name: method.describe() for name, method in list_methods().items()}


def samples() -> dict[str, str]:
    """Return the sample scenes, and what each shows, by the names that `scene` accepts."""
    from .core.scene.scene_source import list_samples

    return {name: scene(name).description.partition("\n")[0] for name in list_samples()}
