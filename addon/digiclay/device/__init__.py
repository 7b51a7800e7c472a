"""Device in Blender: bed, pins, fingertip, colours and arrows."""
