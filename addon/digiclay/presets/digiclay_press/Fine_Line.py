import bpy

wm = bpy.context.window_manager
settings = bpy.context.workspace.tools.from_space_view3d_mode("OBJECT").operator_properties(
    "digiclay.press"
)

wm.digiclay_finger = (6.0, 6.0, 16.0)
settings.depth = 3.0
settings.stabilizer = 6.0
