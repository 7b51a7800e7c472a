"""Make docs/pictures/export.jpg: what `digiclay export` writes of the paper's session, drawn by Workbench.

Usage: .venv/bin/python tools/export_picture.py
"""

from __future__ import annotations

import tempfile
from math import radians
from pathlib import Path

import bpy
from digiclay.cli import main as digiclay
from mathutils import Vector
from PIL import Image

PICTURE = Path(__file__).parents[1] / "docs" / "pictures" / "export.jpg"
#: Size of each of the four views, pixels; how much of the world one shows, mm.
SIZE, SHOWN = (576, 395), 116.0
#: Colors of solids, bosses and creases: told apart with any color vision.
GRAY, ORANGES, BLUE = (0.55, 0.60, 0.65), ((0.80, 0.36, 0.02), (1.0, 0.70, 0.20)), (0.02, 0.32, 0.75)
#: What is exported for each view.
VIEWS = (
    ["--kind", "solid"],
    ["--kind", "solid", "--skin", "smooth", "--resolution", "8"],
    ["--kind", "pins"],
    ["--kind", "features", "--separate", "--skin", "smooth", "--resolution", "8"],
)


def look() -> None:
    """Set up an empty scene with a camera that looks down on the bed from the front left."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera, camera.data.type, camera.data.ortho_scale = camera, "ORTHO", SHOWN
    camera.data.clip_end = 1e4
    camera.rotation_euler = radians(55.0), 0.0, radians(32.0)
    bpy.context.view_layer.update()
    camera.location = Vector((0.0, 0.0, 36.0)) + camera.matrix_world.to_3x3() @ Vector((0.0, 0.0, 500.0))
    scene.render.engine = "BLENDER_WORKBENCH"
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.film_transparent = True
    scene.display.shading.color_type = "OBJECT"
    scene.display.shading.show_cavity = True
    scene.display.shading.show_specular_highlight = False
    scene.display.render_aa = "16"
    scene.view_settings.view_transform = "Standard"


def render(meshes: list[Path], out: Path) -> Image.Image:
    """Draw meshes, mm, and return the picture on white."""
    look()
    bosses = 0
    for mesh in sorted(meshes):
        bpy.ops.wm.stl_import(filepath=str(mesh))
        color = BLUE if mesh.stem.startswith("crease") else GRAY
        if mesh.stem.startswith("boss"):
            color, bosses = ORANGES[bosses % len(ORANGES)], bosses + 1
        bpy.context.object.color = (*color, 1.0)
    bpy.context.scene.render.filepath = str(out)
    bpy.ops.render.render(write_still=True)
    drawn = Image.open(out).convert("RGBA")
    white = Image.new("RGBA", drawn.size, "white")
    return Image.alpha_composite(white, drawn).convert("RGB")


def main() -> None:
    """Form, export, draw, and put the four views together."""
    whole = Image.new("RGB", (2 * SIZE[0], 2 * SIZE[1]), "white")
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "run"
        digiclay(["run", "ridge_mound_valley", "--out", str(run), "--quiet"])
        for index, options in enumerate(VIEWS):
            out = Path(folder) / str(index)
            digiclay(["export", str(run), "--format", "stl", "--out", str(out), *options])
            view = render(list(out.glob("*.stl")), Path(folder) / f"{index}.png")
            whole.paste(view, (index % 2 * SIZE[0], index // 2 * SIZE[1]))
    whole.save(PICTURE, quality=88)


if __name__ == "__main__":
    main()
