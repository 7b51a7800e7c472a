"""Device in Blender: bed, pins, fingertip, colors and arrows."""
