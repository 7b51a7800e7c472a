"""Force colors of pins: a dozen levels, distinct for any color vision.

Levels rather than a gradient, because a pin wears one of a few materials: that shows in Solid
view, in Workbench and in Cycles alike. No Blender.
"""

#: Force from which on a pin has the last color, N; a gently pressing finger gives a cell a third of
#: it.
TOP = 0.2
#: sRGB of a pin that nothing presses.
NO_FORCE = (0.78, 0.79, 0.80)
#: sRGB of the levels in the order of the force: viridis in twelve even steps, its darkest end left
#: out.
COLORS = (
    (0.283, 0.116, 0.436),
    (0.269, 0.219, 0.510),
    (0.232, 0.318, 0.545),
    (0.192, 0.403, 0.556),
    (0.158, 0.486, 0.558),
    (0.129, 0.563, 0.551),
    (0.125, 0.640, 0.527),
    (0.208, 0.719, 0.473),
    (0.361, 0.786, 0.388),
    (0.565, 0.842, 0.263),
    (0.783, 0.879, 0.125),
    (0.993, 0.906, 0.144),
)
