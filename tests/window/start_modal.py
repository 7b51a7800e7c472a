"""Starts each modal operator with something that fails, and the Press tool with a stamp that is not there."""

import bpy

from tests.window import driver as blender


def list_modal():
    return sorted(operator.bl_idname for operator in blender.window().modal_operators)


def script():
    yield from blender.scene_with_bed(rows=25, columns=25)
    yield from stamp()
    blender.call(bpy.ops.digiclay.session_stop)
    blender.hover(blender.middle())
    yield None
    # Blender loses an operator of which it has had a subclass: last.
    action = blender.part("operators.action")
    every = [
        kind for kind in blender.part("operators").CLASSES if issubclass(kind, bpy.types.Operator)
    ]
    for kind in [kind for kind in every if hasattr(kind, "modal")]:
        begun = {}
        if issubclass(kind, action.Modal):
            begun = start_failing(kind, action)
        blender.SEEN[kind.bl_idname] = {"modal": issubclass(kind, action.Modal), **begun}
        yield None


def start_failing(kind, action):
    """Start an operator with all that it prepares, after which something fails."""

    def prepare(self, context, event):
        raise blender.part("core.base.errors").DigiclayError("Something fails.")

    name = f"{kind.bl_idname}_fails"
    failing = type("Failing", (kind,), {"bl_idname": name, "prepare": prepare, "needs": ()})
    bpy.utils.register_class(failing)
    area, _, verb = name.partition(".")
    # Without a path it would open the file browser first, which is no part of its own start.
    path = {"filepath": str(blender.OUT / "out.glb")} if "filepath" in kind.__annotations__ else {}
    try:
        said = sorted(blender.call(getattr(getattr(bpy.ops, area), verb), "INVOKE_DEFAULT", **path))
    except RuntimeError as error:
        said = [str(error)]
    left = list_modal()
    bpy.utils.unregister_class(failing)
    return {"said": said, "left": left}


def stamp():
    """Press on the bed with a stamp from a file that is not there, then with one that is."""
    blender.choose_tool()
    settings = blender.part("press.brush").tool_settings(bpy.context)
    settings.brush, settings.stamp, settings.stamp_file = (
        "STAMP",
        "FILE",
        str(blender.OUT / "no.stl"),
    )
    for name, x in (("FILE", -15.0), ("heart", 15.0)):
        settings.stamp, at = name, blender.on_the_bed(x, 0.0)
        blender.hover(at)
        yield None
        blender.event("LEFTMOUSE", "PRESS", at)
        for step in (5, 10, 20, 30):
            blender.hover((at[0] + step, at[1]))
            yield 0.2
        blender.SEEN[f"stamp {name}"] = list_modal()
        blender.event("LEFTMOUSE", "RELEASE", (at[0] + 30, at[1]))
        yield from blender.rounds(5)
        if name == "FILE":
            blender.key("ESC", (at[0] + 30, at[1]))  # the message
            yield None
        blender.SEEN[f"stamp {name}, sessions"] = len(blender.sessions())
