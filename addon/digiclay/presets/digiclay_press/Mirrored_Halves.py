import bpy

wm = bpy.context.window_manager
settings = bpy.context.workspace.tools.from_space_view3d_mode("OBJECT").operator_properties(
    "digiclay.press"
)

wm.digiclay_finger = (20.0, 16.0, 16.0)
settings.symmetry = "X"
settings.stabilizer = 3.0
