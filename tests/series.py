"""A series of jobs in the working folder, as the tests of batches and of single jobs have it."""

from contextlib import redirect_stderr
from io import StringIO
from pathlib import Path

from tests.scene_files import call, read_text, write_text

ENDLESS = """
scenes = ["tap"]
errors = false
[settings]
quick = { simulation.duration = 0.05 }
endless = { simulation.duration = 1e6 }
narrow = { layout.pitch = "1 mm" }
"""
JOB, RUN = Path("two/jobs/tap-quick"), Path("two/runs/tap-quick")


def write(said):
    path = Path("two.toml").resolve()
    write_text(path, said)
    return path


def index():
    return read_text(Path("two/index.html"))


def prepare(said=ENDLESS):
    """Write the files of the jobs, none of which is done."""
    write(said)
    with redirect_stderr(StringIO()):
        assert call("batch two.toml --prepare --quiet") == int("narrow" in said)


def written(run=RUN):
    """Return when a run was written, ns."""
    return (run / "history.npz").stat().st_mtime_ns
