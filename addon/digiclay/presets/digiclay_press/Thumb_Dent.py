import bpy

wm = bpy.context.window_manager
settings = bpy.context.workspace.tools.from_space_view3d_mode("OBJECT").operator_properties(
    "digiclay.press"
)

wm.digiclay_finger = (28.0, 23.0, 22.0)
settings.depth = 6.0
