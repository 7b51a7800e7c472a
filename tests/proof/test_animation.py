"""Ten seconds of the paper's session as animated files: small, and their heights read by other programs."""

import sys

import numpy as np
import pytest
from alembic3d import Abc, AbcGeom
from digiclay.core.session.finished_run import read_run
from pxr import Usd

from tests.scene_files import read_json

from .conftest import told

#: First instant, s; frames per second; frames that are compared, of 0 to 250.
START, RATE, FRAMES = 8.0, 25, (0, 1, 77, 128, 250)
#: Files hold float32 or 9 decimals in mm or m, some nm, and assimp prints six digits: 50 nm.
NEAR = 1e-7


@pytest.fixture(scope="module")
def animated(paper):
    out = paper.parent / "animated"
    options = ["--animated", "usd,abc,glb", "--start", "8", "--stop", "18", "--quiet", "--out"]
    told(sys.executable, "-m", "digiclay", "export", paper, *options, out)
    return out


@pytest.fixture(scope="module")
def heights(paper):
    """Return the run's heights in the frames that are compared, m."""
    history = read_run(paper, "height").history
    moments = START + np.array(FRAMES) / RATE
    return np.column_stack(
        [np.interp(moments, history["time"], pin) for pin in history["height"].T]
    )


def usd(path, kind):
    stage = Usd.Stage.Open(str(path))
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0.0, 250.0)
    assert stage.GetTimeCodesPerSecond() == RATE
    moving = stage.GetPrimAtPath(f"/digiclay/{kind}")
    points = moving.GetAttribute("positions" if kind == "pins" else "points")
    unit = stage.GetMetadata("metersPerUnit")
    return [np.array(points.Get(frame))[:, 2] * unit for frame in FRAMES]


def abc(path, kind):
    """Read an Alembic file, in mm and y up."""
    archive = Abc.IArchive(str(path))
    top = archive.getTop().getChild(0)
    times = [Abc.ISampleSelector(frame / RATE) for frame in FRAMES]
    if kind == "skin":
        schema = AbcGeom.IPolyMesh(top, "skin").getSchema()
        return [np.array([p[1] for p in schema.getValue(at).getPositions()]) / 1e3 for at in times]
    names = [top.getChild(number).getName() for number in range(top.getNumChildren())]
    pins = sorted((name for name in names if "-" in name), key=lambda name: int(name.split("-")[1]))
    schemas = [AbcGeom.IXform(top, name).getSchema() for name in pins]
    assert top.getChild(names.index(pins[1])).getChild(0).isInstanceRoot()
    return [
        np.array([each.getValue(at).getMatrix()[3][1] for each in schemas]) / 1e3 for at in times
    ]


def glb(path, kind):
    """Read the pins of a GLB by assimp, in m and y up; it leaves out the animation of a skin."""
    whole = path.with_suffix(".json")
    told("assimp", "export", path, whole, "-fassjson")
    (session,) = read_json(whole)["animations"]
    channels = {each["name"]: each["positionkeys"] for each in session["channels"]}
    paths = [channels[f"pin_{number}"] for number in range(len(channels))]
    return [np.array([keys[frame][1][1] for keys in paths]) for frame in FRAMES]


@pytest.mark.parametrize("kind", ["pins", "skin"])
@pytest.mark.parametrize("ending", ["usda", "abc", "glb"])
def test_ten_seconds_of_625_pins_take_at_most_20_mb(animated, kind, ending):
    assert 1e6 < (animated / f"animated_{kind}.{ending}").stat().st_size <= 20e6


@pytest.mark.parametrize(
    "read, ending, kind",
    [
        (usd, "usda", "pins"),
        (usd, "usda", "skin"),
        (abc, "abc", "pins"),
        (abc, "abc", "skin"),
        (glb, "glb", "pins"),
    ],
)
def test_other_programs_find_the_heights_of_the_run(animated, heights, read, ending, kind):
    found = read(animated / f"animated_{kind}.{ending}", kind)
    assert np.shape(found) == (len(FRAMES), 625)
    assert np.abs(found - heights).max() < NEAR
