"""Runs in a Blender of its own: installs the extension's zip as a user does, uses it, takes it back.

usage: use_the_zip.py ZIP FOLDER. What was seen is written as JSON to FOLDER/seen.json.
"""

import importlib
import json
import sys
from contextlib import redirect_stderr
from io import StringIO
from pathlib import Path

import bpy

EXTENSION = "bl_ext.user_default.digiclay"
ARCHIVE, FOLDER = Path(sys.argv[1]), Path(sys.argv[2])


def part(name):
    return importlib.import_module(f"{EXTENSION}.{name}")


def main():
    import addon_utils  # Blender's own, found once Blender is there

    seen = {}
    install = bpy.ops.extensions.package_install_files
    seen["installed"] = sorted(
        install(repo="user_default", filepath=str(ARCHIVE), enable_on_install=True, overwrite=True)
    )
    seen["enabled"] = EXTENSION in bpy.context.preferences.addons
    # Looked for where Blender puts it: the Python that runs this may have a trimesh of its own.
    wheels = Path(bpy.utils.user_resource("EXTENSIONS"), ".local", "lib")
    seen["bundled"] = len(list(wheels.glob("python*/site-packages/trimesh")))
    seen["imported at once"] = sorted(
        name for name in sys.modules if name.split(".")[0] in ("trimesh", "matplotlib", "scipy")
    )
    seen["added"] = sorted(bpy.ops.mesh.digital_clay_add(rows=6, columns=6))
    bed = bpy.context.object
    seen["scene"] = part("settings.properties").scene_of(bed).cells
    chosen = part("preferences").get(bpy.context)
    chosen.redraw_rate = 24
    seen["redraw rate"] = bpy.context.preferences.addons[EXTENSION].preferences.redraw_rate

    part("settings.own_presets").save("Mine", part("settings.properties").scene_of(bed))
    own = Path(bpy.utils.extension_path_user(EXTENSION))
    seen["own presets"] = [str(file.relative_to(own)) for file in own.rglob("*.toml")]

    command = part("command_line").run
    run = FOLDER / "a tap"
    seen["describe"] = command(["describe", "tap"])
    short = ["--set", "simulation.duration=0.3", "--no-errors", "--quiet"]
    seen["run"] = command(["run", "tap", "--out", str(run), *short])
    seen["export"] = command(["export", str(run), "--out", str(FOLDER), "--format", "stl"])
    still = ["--out", str(FOLDER / "still.png"), "--size", "160x100", "--engine", "workbench"]
    seen["render"] = command(["render", str(run), *still])
    for outside in ("paper", "study", "tune", "benchmark"):
        with redirect_stderr(StringIO()) as told:
            seen[outside] = [command([outside]), told.getvalue()]
    # Its code imports digiclay, which has another name here.
    command(["new-method", "mine", "--out", str(FOLDER / "own"), "--quiet"])
    chosen.methods_folder = str(FOLDER / "own")
    chosen.run_own_methods = True
    bed.digiclay.chosen_method = "mine"
    seen["own method"] = part("settings.properties").scene_of(bed).method
    own = f"{FOLDER / 'own' / 'mine.py'}:Mine"
    own_run = ["run", "tap", "--method", own, "--out", str(FOLDER / "own run")]
    seen["own run"] = command([*own_run, *short])
    known = part("core.control.methods").list_added
    addon_utils.disable(EXTENSION)  # the preferences stay, as at the end of Blender
    seen["own methods"] = [list(known())]
    addon_utils.enable(EXTENSION)
    seen["own methods"] += [list(known())]
    addon_utils.disable(EXTENSION, default_set=True)
    names = [name for name in dir(bpy.types) if "digi" in name.lower()]
    seen["left behind"] = names + ["Object.digiclay"] * hasattr(bpy.types.Object, "digiclay")
    addon_utils.enable(EXTENSION, default_set=True)
    seen["added again"] = sorted(bpy.ops.mesh.digital_clay_add(rows=6, columns=6))
    addon_utils.disable(EXTENSION, default_set=True)
    (FOLDER / "seen.json").write_text(json.dumps(seen))


main()
