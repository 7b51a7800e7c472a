"""Results as Python has them: saved, exported, plotted, shown in a notebook; and tables of sweeps."""

from __future__ import annotations

import base64
import io
import itertools
import os
import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .core.base.errors import OutputError, ParameterError, SceneError
from .core.control.methods import list_added
from .core.files.run_folder import write_folder
from .core.files.tables import Record, Table
from .core.mesh_io.export_model import Model, make_bodies
from .core.mesh_io.mesh_writer import write
from .core.scene.scene_source import (
    Setting,
    Source,
    list_changes,
    make_scene,
    read_parts,
    read_source,
    write_word,
)
from .core.scene.schema import Scene
from .core.session import finished_run, run_scene
from .core.session.probes import require_scene
from .core.studies.axes import make_axis, make_columns, make_points
from .core.studies.evaluation import (
    evaluate_bundle,
    find_figure,
    judge_all,
    make_bundles,
    require_any,
    require_recorder,
)
from .core.studies.sweep_plan import EFFORT, make_rows
from .core.surface.features import Finding
from .core.surface.formed import Formed, make_formed
from .plots.figure import save
from .plots.run import session_figure
from .plugins.method_loader import (
    describe_origin,
    find_code,
    is_in_memory,
    load_method,
    refuse_former,
    write_code,
)

#: Key of the control method.
METHOD = "control.method"
#: File endings of plots.
PLOTS = (".png", ".svg")


def read_path(path: object) -> Path:
    """Return a path, or refuse what is none."""
    if not isinstance(path, (str, os.PathLike)):
        raise OutputError(f"A file or folder must be a path (got {path!r:.60}).")
    return Path(os.fspath(path))


@dataclass(frozen=True, eq=False)
class Surface:
    """Formed surface of a run at one instant."""

    scene: Scene
    formed: Formed
    """Pins now and before: ``position`` (n, 2), ``height``, ``former`` (n,), m, ``force`` (n,), N."""

    def export(
        self,
        path: str | os.PathLike[str],
        kind: str = "solid",
        skin: str = "bilinear",
        unit: str = "mm",
    ) -> Path:
        """Write the surface as a mesh, complete or not at all, in place of an older file.

        Parameters
        ----------
        path : path
            Its ending selects the format: stl, obj, ply, glb or 3mf.
        kind : {"solid", "surface", "pins", "features"}
            A watertight body for printing, the skin alone, the stepped bed, or each boss and
            crease.
        skin : {"bilinear", "smooth", "membrane"}
            Skin between the pins.
        unit : {"mm", "m"}
            Unit of length of the file; GLB is in meters.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        DigiclayError
            For an unknown ending, kind, skin or unit, without features, or if the file cannot be
            written.
        """
        model = Model(kind=kind, skin=skin, cap=self.scene.actuator.bore / 2.0)
        return write(make_bodies(self.formed, model, Finding()), read_path(path), unit)


@dataclass(frozen=True, eq=False, repr=False)
class Result(run_scene.Result):
    """Results of a run: scene, history and metrics, in SI units."""

    def save(self, folder: str | os.PathLike[str], overwrite: bool = False) -> Path:
        """Write the run's folder, complete or not at all: scene.toml, history.npz, metrics.json.

        The code of a method of your own is written as method.py. Of a class without a file, such as
        one of a notebook, there is no code to write: a warning says so.

        Parameters
        ----------
        folder : path
            New or empty, unless `overwrite`.
        overwrite : bool
            Replace an older run.

        Returns
        -------
        Path
            The folder.

        Raises
        ------
        DigiclayError
            When the folder is not empty, contains something other than a run, or cannot be written.
        """
        path, source = read_path(folder), find_code(self.scene)
        with write_folder(path, overwrite=overwrite) as staged:
            run_scene.save(self, staged)
            write_code(self.scene, staged)
        if source and is_in_memory(source):
            what = f"{path} has parameters and results of {source.label}, but not its code, which has no file"
            warnings.warn(f"{what}: it runs again only where this class is loaded.", stacklevel=2)
        return path

    def surface(self, time: float | None = None, former: float = 0.0) -> Surface:
        """Return the formed surface.

        Parameters
        ----------
        time : float, optional
            Instant, s; by default the end.
        former : float
            Instant of the surface with which features are compared, s.

        Returns
        -------
        Surface

        Raises
        ------
        DigiclayError
            Without a history, for less than 2 x 2 pins, or for a time outside the run.
        """
        self.require_history("surface")
        finished_run.require_surface(self.scene, "surface")
        last = self.history["time"][-1]
        row, before = (
            finished_run.find_row(self.history, moment, name)
            for name, moment in (("time", last if time is None else time), ("former", former))
        )
        return Surface(self.scene, make_formed(self.history, row, before))

    def plot(self, path: str | os.PathLike[str]) -> Path:
        """Draw heights of selected pins and force over time; needs ``digiclay[plots]``.

        Parameters
        ----------
        path : path
            A .png or .svg file; an older one is replaced.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        DigiclayError
            Without matplotlib or a history, for another ending, or if the file cannot be written.
        """
        self.require_history("plot")
        out = read_path(path)
        if out.suffix not in PLOTS:
            raise OutputError(f"The file of a plot must end with {' or '.join(PLOTS)} (got {out}).")
        return save(session_figure(self.history, self.scene.set_point), out)

    def _repr_html_(self) -> str:
        """Return a table for a notebook, with the plot where matplotlib is installed."""
        table = super()._repr_html_()
        try:
            self.require_history("plot")
            figure = session_figure(self.history, self.scene.set_point)
        except OutputError:
            return table
        content = io.BytesIO()
        figure.savefig(content, format="png")
        source = f"data:image/png;base64,{base64.b64encode(content.getvalue()).decode()}"
        return f'{table}<img alt="heights and force over time" width="800" src="{source}">'


def write_value(key: str, value: Any) -> str:
    """Return the word of a value in a scene file, with the method loaded that it names."""
    return write_word(
        load_method(value) if key == METHOD and isinstance(value, (str, type)) else value
    )


def change_scene(source: Source, changes: Table | None, with_: object = None) -> Scene:
    """Return the scene of a source with parts of a file and changes, whose methods are loaded."""
    if changes is not None and not isinstance(changes, Mapping):
        raise SceneError(f"Changes must be a table of keys and values (got {changes!r:.60}).")
    path, table = read_source(source)
    control, given = table.get("control"), list(list_changes(changes or {}))
    if isinstance(source, Scene):
        refuse_former(source)
    elif isinstance(source, Mapping) and isinstance(control, Mapping) and "method" in control:
        given.insert(0, (METHOD, control["method"]))
    settings = read_parts(read_path(with_)) if with_ is not None else []
    settings += [Setting(key, write_value(key, value), "changes") for key, value in given]
    return make_scene(path, table, settings)


def run(scene: Scene, progress: Callable[[int, int], None] | None, *, errors: bool) -> Result:
    """Simulate a scene, with an estimate of errors if asked for."""
    done = run_scene.run(require_scene(scene), progress=progress, versions=describe_origin(scene))
    done = (done.estimate_errors() if errors else None) or done.without_errors("errors=False")
    return Result(**vars(done))


def load(folder: object) -> Result:
    """Read a run's folder; warn where the method of this process is not that of the run."""
    path = read_path(folder)
    result = Result(**vars(finished_run.read_result(path)))
    origin = result.metrics.get("versions", {}).get("method")
    if (
        result.scene.method in list_added()
        and describe_origin(result.scene).get("method") != origin
    ):
        rule = f"was not run with the code of {result.scene.method} that is loaded, or with a class in memory"
        warnings.warn(f"{path} {rule}: its scene may give another run.", stacklevel=3)
    return result


def sweep(
    scene: Scene,
    varied: Mapping[str, Iterable[Any]],
    metrics: Iterable[str],
    progress: Callable[[int, int], None] | None,
) -> NDArray[Any]:
    """Run a scene over a grid of values; return a row for each point."""
    if not isinstance(varied, Mapping) or not varied:
        raise SceneError(
            f"A sweep must vary at least one key: {{key: values}} (got {varied!r:.60})."
        )
    words = metrics.split(",") if isinstance(metrics, str) else metrics
    if not isinstance(words, Iterable):
        raise ParameterError("metrics", "", "must be a list of metrics", repr(metrics))
    names = list(dict.fromkeys(find_figure(str(word).strip(), "metrics") for word in words))
    refuse_former(require_scene(scene))
    axes = [make_axis(key, values, partial(write_value, key)) for key, values in varied.items()]
    points = judge_all(make_points(scene, (), axes, option="sweep"))
    require_recorder(points)
    records: dict[int, Record] = {}
    for bundle in make_bundles(points).every:
        for point, record in zip(bundle, evaluate_bundle(bundle), strict=True):
            records[point.index] = record or {}
        if progress:
            progress(len(records), len(points))
    rows = [records[point.index] for point in points]
    require_any(rows)
    names = list(dict.fromkeys((*names, *EFFORT)))
    values = itertools.product(*(column.values for column in make_columns(points, axes)))
    lines = zip(*make_rows(values, rows, names), strict=True)
    columns = [np.array([np.nan if cell is None else cell for cell in column]) for column in lines]
    heads = [*varied, *names, "lost", "error"]
    kinds = [(head, column.dtype) for head, column in zip(heads, columns, strict=True)]
    return np.array(list(zip(*columns, strict=True)), kinds)
