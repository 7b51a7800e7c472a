"""Every operator with odd things active, in every mode: it is refused or does its work, and never fails."""

import bpy
import pytest
from digiclay import operators
from digiclay.core.session import live_session
from digiclay.live import handlers, tick
from digiclay.press import tool
from digiclay.roles import fingertip_of
from digiclay.sessions import running
from digiclay.strokes.stroke import start

from tests.blender.at_hand import in_the_view, new_bed, select
from tests.blender.session.live import Clock, queue

OPERATORS = [kind for kind in operators.CLASSES if issubclass(kind, bpy.types.Operator)]
#: Settings with which long work takes less time.
QUICK = {"digiclay.bake": {"last": 3}, "digiclay.add_sample": {"take": False}}
BPY = bpy.ops


def enter(mode):
    BPY.object.mode_set(mode=mode)


#: Blender 4.2 makes no points of a mesh.
NO_MESH = "POINTCLOUD" if bpy.app.version >= (4, 5) else "CURVE"
#: What can be active, and what can become of a bed that was active.
ODD = {
    "a bed": lambda bed: None,
    "its fingertip": lambda bed: select(fingertip_of(bed)),
    "nothing": lambda bed: setattr(bpy.context.view_layer.objects, "active", None),
    "another mesh": lambda bed: select(bpy.data.objects["Cube"]),
    "no bed in the file": lambda bed: BPY.wm.read_homefile(use_empty=True),
    "a linked duplicate": lambda bed: BPY.object.duplicate(linked=True),
    "edited": lambda bed: enter("EDIT"),
    "edited by a linked duplicate": lambda bed: (
        BPY.object.duplicate(linked=True), enter("EDIT"),
        setattr(bpy.context.view_layer.objects, "active", bed),
    ),
    "sculpted": lambda bed: enter("SCULPT"),
    "another mesh edited": lambda bed: (select(bpy.data.objects["Cube"]), enter("EDIT")),
    "pins deleted": lambda bed: (
        enter("EDIT"), BPY.mesh.select_all(action="SELECT"), BPY.mesh.delete(type="VERT"),
    ),
    "mesh swapped": lambda bed: setattr(bed, "data", bpy.data.meshes["Cube"]),
    "attribute removed": lambda bed: bed.data.attributes.remove(bed.data.attributes["mode"]),
    "converted to what is no mesh": lambda bed: BPY.object.convert(target=NO_MESH),
    "joined with a cube": lambda bed: (select(bpy.data.objects["Cube"], bed), BPY.object.join()),
    "joined into a cube": lambda bed: (select(bed, bpy.data.objects["Cube"]), BPY.object.join()),
    "geometry nodes removed": lambda bed: bed.modifiers.clear(),
    "fingertip deleted": lambda bed: bpy.data.objects.remove(fingertip_of(bed)),
    "fingertip without parent": lambda bed: setattr(fingertip_of(bed), "parent", None),
    "hidden": lambda bed: bed.hide_set(True),
    "mirrored": lambda bed: setattr(bed, "scale", (-1.0, 1.0, 1.0)),
    "scaled to nothing": lambda bed: setattr(bed, "scale", (0.0, 0.0, 0.0)),
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The folder of the file."""
    return tmp_path_factory.mktemp("bed")


@pytest.fixture
def file(extension, folder, tmp_path, monkeypatch):
    """A file with a small bed, active, beside Blender's cube, made by the first test that asks."""
    monkeypatch.chdir(tmp_path)  # for what is exported
    monkeypatch.setattr(live_session, "find_spare", lambda *given: 0.0)  # a tick simulates a period
    path = folder / "bed.blend"
    if not path.exists():
        new_bed(rows=5, columns=5)
        tool.take_up(bpy.context)
        BPY.wm.save_as_mainfile(filepath=str(path))
    return str(path)


def prepare(file, odd, live):
    """Load the file, in mid-stroke of a session if wanted, do what is odd, and return the state."""
    BPY.wm.open_mainfile(filepath=file)
    bed, clock = bpy.context.object, Clock()
    if live:
        tick.start(bpy.context, bed)
        queue(bed, start(0, 0.0, 0.0, 4e-3))
        clock.tick(2)
        assert running.find(bed).strokes[0].height is not None  # it has begun
    ODD[odd](bed)
    clock.tick(2)
    return state()


def state():
    """Return what is active, in which mode, and among how many objects."""
    return getattr(bpy.context.object, "name", ""), bpy.context.mode, len(bpy.data.objects)


#: What only adds another bed, which takes time: called while a session runs, in states that matter
#: for it.
ADDS = {"mesh.digital_clay_add", "digiclay.add_sample"}
FOR_ADDS = {"a bed", "nothing", "edited", "another mesh edited", "joined into a cube"}


def calls(adds):
    """Give every operator, how to call it, and its settings: either value of what has two."""
    for kind in OPERATORS:
        if kind.bl_idname in ADDS and not adds:
            continue
        area, _, name = kind.bl_idname.partition(".")
        operator, quick = getattr(getattr(BPY, area), name), QUICK.get(kind.bl_idname, {})
        how = "EXEC_DEFAULT" if hasattr(kind, "execute") else "INVOKE_DEFAULT"
        known = () if kind.bl_idname in ADDS else operator.get_rna_type().properties
        twofold = [each for each in known if each.type == "ENUM" and len(each.enum_items) == 2]
        given = [{each.identifier: item.identifier} for each in twofold for item in each.enum_items]
        for settings in given or [{}]:
            yield operator, how, quick | settings


def call(operator, how, settings):
    """Call an operator as the 3D view would; return why it declines, or what it says of an error."""
    with in_the_view():
        try:
            operator(how, **settings)
        except RuntimeError as error:
            return str(error)
    return ""


#: What `test_bed_states.py` has without a session.
TABLED = {"a bed", "edited", "hidden", "mirrored"}


@pytest.mark.parametrize(
    "odd, live", [(odd, live) for odd in ODD for live in (False, True) if live or odd not in TABLED]
)
def test_no_operator_fails(file, odd, live, capfd):
    before, said = prepare(file, odd, live), []
    for operator, how, settings in calls(live and odd in FOR_ADDS):
        said.append((operator.idname(), settings, call(operator, how, settings)))
        if state() != before:
            before = prepare(file, odd, live)
    assert [
        words for words in said if "Traceback" in words[2] or "context is incorrect" in words[2]
    ] == []
    prepare(file, odd, live)
    handlers.end_all(handlers.STOPPED)
    assert running.list_sessions() == ()
    assert "Traceback" not in "".join(capfd.readouterr())  # of a poll, for instance
