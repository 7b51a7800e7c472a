"""Live sessions in Blender: the loop, its ticks, their data in the .blend, and servers to follow."""
