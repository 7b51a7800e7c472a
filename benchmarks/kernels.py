"""Benchmark ``kernels``: sessions on other kernels of numpy's library, or with another numpy."""

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.files.run_folder import list_files
from digiclay.core.files.tables import Record
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import SAMPLES, find, make_scene, read_table
from digiclay.core.scene.schema import Scene

from digiclay_study.method_trials import GROUPS, LIMITS, RANDOM, list_trajectories, place_trial

from .processes import ROOT, run_python
from .report import Report, Row, Steps, tabulate

#: Methods that carry a blister, and behaviors.
CARRIED = ("virtual_master", "cell_states", "hybrid")
METHODS = (*CARRIED, "elastic", "plastic", "viscous", "push_pull", "force_display")
#: Kernels of OpenBLAS, and no instructions that numpy itself would choose.
KERNELS = {
    "Haswell": {"OPENBLAS_CORETYPE": "Haswell"},
    "Prescott": {"OPENBLAS_CORETYPE": "Prescott"},
    "SkylakeX": {"OPENBLAS_CORETYPE": "SkylakeX"},
    "no dispatch": {
        "NPY_DISABLE_CPU_FEATURES": "AVX2 FMA3 AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL"
    },
}
REFERENCE = "Haswell"
SESSION, DRAGS = "ridge_mound_valley", 8
#: With --quick one run of so many; every so many control periods are compared.
QUICK, EVERY = 12, 10


def list_scenes() -> dict[str, Scene]:
    """Return samples without bodies, with each method that fits, and the suite's trajectories, by name."""
    scenes, groups = {}, [group for group in GROUPS if group not in LIMITS]
    for name in list_files(SAMPLES, ".toml"):
        table = read_table(find(name))
        for method in METHODS:
            given = dict(table)
            if table.get("control", {}).get("method", CARRIED[0]) != method:
                given = {key: part for key, part in table.items() if key != "shape"}
                given["control"] = {"method": method}
            if method not in CARRIED:
                given.pop("blister", None)
            scenes[f"{name} {method}"] = make_scene(find(name), given)
    for method in CARRIED:
        session = make_scene(
            find(SESSION), read_table(find(SESSION)) | {"control": {"method": method}}
        )
        for name in list_trajectories(groups, DRAGS):
            scenes[f"{RANDOM if name == SESSION else name} {method}"] = place_trial(session, name)[
                0
            ]
    return scenes


def record(scene: Scene) -> Record:
    """Return heights, m, forces, N, and modes of every so many control periods, (t, n)."""
    system = assemble(scene)
    rows = [
        (state.row(0), state.row(system.rows.force), state.mode())
        for state in periods(system, scene.trajectories(), begin(system), scene.periods)
        if state.period % EVERY == 0
    ]
    return dict(
        zip(("height", "force", "mode"), map(np.array, zip(*rows, strict=True)), strict=True)
    )


def main() -> None:
    """Record the runs of some numbers in files of a folder; the arguments are folder and step."""
    for number, scene in list(enumerate(list_scenes().values()))[:: int(sys.argv[2])]:
        np.savez(Path(sys.argv[1]) / f"{number}.npz", **record(scene))


def measure(arguments: argparse.Namespace, steps: Steps) -> Report:
    """Compare the runs of each kernel with those of the first."""
    step, names, rows = QUICK if arguments.quick else 1, list(list_scenes()), list[Row]()
    kernels = {name: (sys.executable, change) for name, change in KERNELS.items()}
    kernels |= {_find_numpy(python): (python, {}) for python in arguments.python}
    with tempfile.TemporaryDirectory() as scratch:
        folders = {name: Path(scratch) / str(number) for number, name in enumerate(kernels)}
        for name in steps.through(list(kernels)):
            python, change = kernels[name]
            folders[name].mkdir()
            words = "-m", "benchmarks.kernels", str(folders[name]), str(step)
            run_python(ROOT, f"kernels: {name}", *words, python=python, **change)
            files = sorted(folders[name].iterdir(), key=lambda file: int(file.stem))
            for file in files if name != REFERENCE else ():
                differences = _compare(file, folders[REFERENCE] / file.name)
                rows.append({"kernel": name, "run": names[int(file.stem)], **differences})
                file.unlink()
    shown = []
    for kernel in dict.fromkeys(row["kernel"] for row in rows):
        runs = [row for row in rows if row["kernel"] == kernel]
        farthest = max(runs, key=lambda row: row["height"])
        largest = {key: max(row[key] for row in runs) for key in ("force", "modes")}
        shown.append({**farthest, **largest, "runs": len(runs)})
    columns = {
        "kernel": "kernel",
        "runs": "runs",
        "height (µm)": "height .2g 1e6",
        "force (mN)": "force .2g 1e3",
        "modes": "modes",
        "run of the largest": "run",
    }
    title = f"\nlargest differences from {REFERENCE}; modes: of so many pins at once\n"
    return Report([title, *tabulate(shown, columns)], rows)


def _find_numpy(python: str) -> str:
    """Return the name and version of the numpy of a Python."""
    script = "import numpy; print('numpy', numpy.__version__)"
    return run_python(ROOT, f"kernels: {python}", "-c", script, python=python).strip()


def _compare(file: Path, other: Path) -> Row:
    """Return the largest differences of two recorded runs, m and N, and of how many pins' modes at once."""
    first, second = dict(np.load(file)), dict(np.load(other))
    away = first["force"] - second["force"]
    force = np.abs(away).max(), np.abs(away.sum(1)).max()
    modes = np.count_nonzero(first["mode"] != second["mode"], axis=1).max()
    height = np.abs(first["height"] - second["height"]).max()
    return {"height": float(height), "force": float(max(force)), "modes": int(modes)}


if __name__ == "__main__":
    main()
