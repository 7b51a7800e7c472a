"""The device as Blender shows it: bed, pins, fingertip, colours and arrows."""
