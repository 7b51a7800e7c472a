"""Control methods of one's own in Blender: a folder that is off at first, parameters, a file without it."""

import bpy
import pytest
from digiclay import preferences
from digiclay.core.base.errors import ParameterError
from digiclay.core.control.methods import METHODS, list_added
from digiclay.core.scene.toml_table import format_scene
from digiclay.live import tick
from digiclay.sessions import running
from digiclay.settings import own_folder, properties

from tests.blender.at_hand import activate, new_bed
from tests.blender.session.live import Clock, exact, move, press
from tests.own_methods import HEAD, PAD, write_method

pytestmark = pytest.mark.usefixtures("extension")

#: A method that works until the finger touches.
FAULTY = f"""{HEAD}
@dataclass(frozen=True)
class Faulty(OwnMethod):
    '''Fails under a finger.'''

    def command(self, memory, cells, device):
        return memory, Orders(height=cells.target if cells.force.sum() == 0.0 else cells.height * np.nan)
"""


@pytest.fixture
def chosen(tmp_path):
    """Yield the preferences of the extension, with a folder of methods that is not allowed to run yet."""
    write_method(tmp_path)
    write_method(tmp_path, FAULTY, "faulty.py")
    write_method(tmp_path, "x = (", "broken.py")
    entry = bpy.context.preferences.addons.new()
    entry.module = "digiclay"
    entry.preferences.methods_folder = str(tmp_path)
    yield entry.preferences
    own_folder.clear()
    bpy.context.preferences.addons.remove(entry)


def choose(bed, name):
    """Choose a method as the panel does, and return the properties of its parameters."""
    bed.digiclay.chosen_method = name
    return properties.part_group(bed.digiclay, "control")


def test_no_code_is_run_until_the_preferences_allow_it(chosen, tmp_path):
    assert not preferences.defaults().run_own_methods
    assert (chosen.run_own_methods, list_added()) == (False, {})
    assert not bpy.ops.digiclay.methods_reload.poll()
    chosen.run_own_methods = True
    assert list(list_added()) == ["faulty", "soft_pad"]
    (line,) = own_folder.read_present().refused
    assert line.startswith("broken.py: the code must not raise (got SyntaxError in line 1")
    write_method(tmp_path, PAD.replace("SoftPad", "HardPad"), "hard.py")
    assert bpy.ops.digiclay.methods_reload() == {"FINISHED"}
    assert list(list_added()) == ["faulty", "hard_pad", "soft_pad"]
    chosen.methods_folder = str(tmp_path / "absent")  # nobody has allowed the code of that one
    assert (chosen.run_own_methods, list_added()) == (False, {})
    chosen.run_own_methods = True
    assert (list_added(), own_folder.read_present().refused) == (
        {},
        (f"{tmp_path / 'absent'} must be a folder.",),
    )
    chosen.run_own_methods = False
    assert own_folder.read_present() == ((), ())


def test_a_folder_beside_the_file_is_stored_as_a_full_path_or_refused(chosen, tmp_path):
    def enter():
        chosen.methods_folder = "//own"

    enter()  # beside a file that was never saved
    (line,) = own_folder.read_present().refused
    assert line.startswith("Own Methods must be a full path (got '//own')")
    (tmp_path / "own").mkdir()
    write_method(tmp_path / "own")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    chosen.run_own_methods = (
        True  # as older preferences do when Blender starts: not of whatever file is open
    )
    assert (list_added(), own_folder.read_present().refused) == ({}, (line,))
    chosen.methods_folder = "//own"
    assert (chosen.methods_folder, chosen.run_own_methods) == (str(tmp_path / "own"), False)
    chosen.run_own_methods = True
    assert list(list_added()) == ["soft_pad"]


def test_its_parameters_are_properties_with_units_and_bounds(chosen):
    chosen.run_own_methods = True
    bed = new_bed(rows=9, columns=9)
    group = choose(bed, "soft_pad")
    shown = group.bl_rna.properties["yield_force"]
    assert shown.name == "Yield Force (N)"
    assert shown.description.startswith("Force above which a pin gives way; above 0 N; below 1 N")
    assert shown.hard_max == pytest.approx(1.0, rel=1e-4)
    group.yield_force = 0.045
    scene = properties.scene_of(bed)
    assert (scene.method, scene.control.yield_force, scene.blister) == ("soft_pad", 0.045, None)
    assert not bpy.types.DIGICLAY_PT_part_blister.poll(bpy.context)
    assert bpy.types.DIGICLAY_PT_part_control.poll(bpy.context)
    properties.write_scene(bed, scene)
    assert properties.scene_of(bed) == scene
    offered = [item.identifier for item in bed.digiclay.bl_rna.properties["method"].enum_items]
    assert offered == list(METHODS)  # a .blend keeps places in this list
    bed.digiclay.method = "elastic"
    assert (bed.digiclay.chosen_method, properties.scene_of(bed).method) == ("elastic", "elastic")


def test_a_session_forms_with_it_and_one_mistake_pauses_the_session(chosen):
    chosen.run_own_methods = True
    bed = new_bed(rows=9, columns=9)
    choose(bed, "soft_pad")
    clock = Clock()
    assert tick.start(bpy.context, bed) == []
    clock.tick()
    press(bed, clock, 0.0)
    assert exact(bed).min() < 39.9e-3
    tick.stop(bed.session_uid)
    choose(bed, "faulty")
    tick.start(bpy.context, bed)
    (note,) = move(bed, Clock(), [(0.0, z) for z in (46.0, 45.0, 41.0, 38.0, 37.0, 37.0)])
    assert note.level == "ERROR"
    assert (
        "paused: faulty.py:Faulty: command must return height as finite numbers (got nan)"
        in note.message
    )
    assert running.find(bed).paused
    tick.stop(bed.session_uid)


def test_a_file_without_its_method_says_so_and_uses_no_other(chosen, tmp_path):
    chosen.run_own_methods = True
    bed = new_bed(rows=9, columns=9)
    group = choose(bed, "soft_pad")
    group.step = 0.07
    scene = properties.scene_of(bed)
    file = str(tmp_path / "bed.blend")
    bpy.ops.wm.save_as_mainfile(filepath=file)
    chosen.run_own_methods = False
    bpy.ops.wm.open_mainfile(filepath=file)
    bed = next(one for one in bpy.data.objects if one.digiclay.own_method)
    activate(bed)
    assert bed.digiclay.chosen_method == "soft_pad"
    with pytest.raises(
        ParameterError, match=r"^Control: Method must be one of .* \(got 'soft_pad'\)"
    ) as caught:
        tick.start(bpy.context, bed)
    assert "preferences" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert running.list_sessions() == ()
    assert not bpy.types.DIGICLAY_PT_part_control.poll(bpy.context)
    assert bpy.ops.mesh.digital_clay_make() == {"FINISHED"}  # a mesh needs no method
    activate(bed)
    chosen.run_own_methods = True
    assert format_scene(properties.scene_of(bed)) == format_scene(scene)  # its class is a new one
