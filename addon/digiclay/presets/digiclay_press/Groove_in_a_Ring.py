import bpy

wm = bpy.context.window_manager
settings = bpy.context.workspace.tools.from_space_view3d_mode("OBJECT").operator_properties("digiclay.press")

wm.digiclay_finger = (12.0, 12.0, 12.0)
settings.brush = "LOWER"
settings.depth = 4.0
settings.height = 15.0
settings.strength = 1.0
settings.symmetry = "NONE"
settings.path = "RING"
settings.stabilizer = 0.0
settings.use_pressure = True
settings.pressure_curve = "LINEAR"
settings.use_tilt = True
