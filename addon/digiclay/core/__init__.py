"""Simulation core: numpy only, no Blender, imports strictly down the levels of docs/architecture.md."""
