"""Pictures of the docs: `python tools/doc_pictures.py NAME ...` draws those that need no window.

`python tools/doc_pictures.py --guide FOLDER` takes those of the guide and of its tutorial, and the
film, from the screenshots of window tests in a folder.

CONTRIBUTING.md has the command of every picture.
"""

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from math import radians
from pathlib import Path

from digiclay.cli import main as digiclay
from digiclay.core.scene.scene_source import list_samples
from law_figures import draw_laws
from PIL import Image

PICTURES = Path(__file__).resolve().parents[1] / "docs" / "pictures"
#: Left, top, right and bottom, pixels.
Area = tuple[int, int, int, int]
#: The area of the 3D view in a window of 1100 x 720.
VIEW = (0, 28, 910, 646)
#: Other areas of screenshots: the dialog of the preferences, menus. The area of a film of the view,
#: its size, pixels, and its duration, ms.
AREAS = {"relief_install": (207, 89, 894, 431), "relief_export": (0, 0, 910, 646)}
FILM_AREA, FILM_SIZE, LASTS = (50, 84, 770, 564), (640, 427), 20_000
#: Size of the picture of a series' page, pixels.
SERIES = "1300,1080"
#: Series of which a frame of a film is shown, and the frame: the ridge under way.
FILMED = """\
scenes = ["ridge_mound_valley"]
[film]
"""
FRAME = 300
#: Scenes of several fingers, and of bodies.
HANDS = ("two_hands_bowl", "pinch_crease", "five_fingers_mound")
BODIES = ("hand_print", "face_cast", "ball_track")
#: Instants at which a scene shows more than at its last touch, s.
INSTANTS = {
    "ball_track": 4.58,
    "elastic_press": 1.4,
    "face_cast": 4.4,
    "five_fingers_mound": 7.0,
    "force_display": 3.0,
    "hand_print": 3.0,
    "pinch_crease": 7.0,
    "slow_press": 2.4,
    "tap": 0.2,
    "two_hands_bowl": 9.0,
    "viscous_press": 2.7,
    "zhu_5x5": 0.8,
}
#: Films of some: a series of a scene at a speed, and how long a frame is shown, ms.
SCENE_FILM = """\
scenes = ["{}"]
[film]
width = 640
height = 400
rate = 10
speed = {}
arrows = false
"""
SHOWN_FOR = 100
#: Size of each of the four views, pixels; how much of the world one shows, mm.
SIZE, SHOWN = (576, 395), 116.0
#: Colors of solids, bosses and creases: told apart with any color vision.
GRAY = (0.55, 0.60, 0.65)
ORANGES = ((0.80, 0.36, 0.02), (1.0, 0.70, 0.20))
BLUE = (0.02, 0.32, 0.75)
#: What is exported for each view.
VIEWS = (
    ["--kind", "solid"],
    ["--kind", "solid", "--skin", "smooth", "--resolution", "8"],
    ["--kind", "pins"],
    ["--kind", "features", "--separate", "--skin", "smooth", "--resolution", "8"],
)


def carry_out(*words: str | Path) -> None:
    """Carry out a command of digiclay; end with its exit code if it fails."""
    code = digiclay([str(word) for word in words])
    if code:
        sys.exit(code)


def save_jpeg(picture: Path, out: Path, quality: int = 88, area: Area | None = None) -> None:
    """Write a picture, or an area of it, as a JPEG."""
    with Image.open(picture) as opened:
        opened.convert("RGB").crop(area).save(out, quality=quality, optimize=True)


def save_film(frames: list[Image.Image], out: Path, shown_for: int) -> None:
    """Write frames, each shown for a time, ms, as an animated WebP, which pages show everywhere."""
    first, *others = frames
    looks = {"save_all": True, "quality": 60, "method": 6, "duration": shown_for, "loop": 0}
    first.save(out, append_images=others, **looks)


def cut_guide(folder: Path) -> None:
    """Write what each screenshot of the guide and its tutorial shows as a JPEG; and the film of the hand."""
    frames = sorted(folder.glob("film_*.png"))
    shots = sorted([*folder.glob("guide_*.png"), *folder.glob("relief_*.png")])
    if not shots or not frames:
        rule = "must have screenshots guide_*.png, relief_*.png and film_*.png"
        sys.exit(f"{folder} {rule} (got {len(shots)} and {len(frames)}): run tests/window first")
    for shot in shots:
        save_jpeg(shot, PICTURES / f"{shot.stem}.jpg", 85, AREAS.get(shot.stem, VIEW))
    size = Image.Resampling.LANCZOS
    film = [
        Image.open(frame).convert("RGB").crop(FILM_AREA).resize(FILM_SIZE, size) for frame in frames
    ]
    save_film(film, PICTURES / "relief.webp", round(LASTS / len(film)))


def plot_session(folder: Path, out: Path, scene: str, shrunk: int = 1) -> None:
    """Plot heights and force of a scene, of each finger; so many pixels become one."""
    carry_out("run", scene, "--out", folder / "run", "--plots", "--no-errors", "--quiet")
    with Image.open(folder / "run" / "session.png") as opened:
        opened.convert("RGB").reduce(shrunk).save(out, optimize=True)


def make_film(folder: Path, series: str, frames: str) -> Path:
    """Draw some frames of the film of the only job of a series; return the folder of its runs."""
    jobs, out = folder / "film.toml", folder / "film"
    jobs.write_text(series, encoding="utf-8")
    carry_out("batch", jobs, "--prepare", "--out", out, "--quiet")
    (job,) = (out / "jobs").iterdir()
    carry_out("job", job, "--only", "run")
    carry_out("job", job, "--only", "film", "--frames", frames)
    return out / "runs"


def draw_film(folder: Path, out: Path) -> None:
    """Draw a frame of a film of the paper's session."""
    (frame,) = make_film(folder, FILMED, f"{FRAME}-{FRAME}").rglob(f"*{FRAME}.png")
    save_jpeg(frame, out)


def draw_scene(
    folder: Path, out: Path, scene: str, size: str, quality: int = 85, color: str = "neutral"
) -> None:
    """Draw a scene at its instant of `INSTANTS`, or at its last touch."""
    run, drawn = folder / "run", folder / "drawn.png"
    carry_out("run", scene, "--out", run, "--no-errors", "--quiet")
    instant = ("--time", str(INSTANTS[scene])) if scene in INSTANTS else ()
    looks = ("--size", size, "--color", color, "--quiet")
    carry_out("render", run, *instant, *looks, "--out", drawn)
    save_jpeg(drawn, out, quality)


def draw_closing_hand(folder: Path, out: Path) -> None:
    """Draw a hand that has closed in the pins."""
    from closing_hand import main as close_hand

    save_jpeg(close_hand(folder), out, 85)


def draw_scene_film(folder: Path, out: Path, scene: str, speed: float, frames: int) -> None:
    """Draw a film of a scene, or its first frames."""
    runs = make_film(folder, SCENE_FILM.format(scene, speed), f"0+{frames}")
    film = [Image.open(path).convert("RGB") for path in sorted(runs.rglob("0*.png"))]
    save_film(film, out, SHOWN_FOR)


def draw_by_program(folder: Path, out: Path, page: str, program: str) -> None:
    """Carry out in a folder the program that a tutorial shows; take the picture that it writes."""
    text = (PICTURES.parent / "tutorials" / page).read_text(encoding="utf-8")
    shown = text.partition(f'title="{program}"\n')[2].partition("```")[0]
    (folder / program).write_text(shown, encoding="utf-8")
    subprocess.run([sys.executable, program], cwd=folder, check=True, timeout=1200)
    shutil.copyfile(folder / out.name, out)


def draw_series(folder: Path, out: Path) -> None:
    """Show the page of the sample series in Chromium; its jobs take minutes."""
    carry_out("batch", "first", "--out", folder / "first", "--quiet")
    shown, page = folder / "page.png", (folder / "first" / "index.html").as_uri()
    options = f"--headless --no-sandbox --hide-scrollbars --window-size={SERIES}".split()
    command = ["chromium", *options, f"--screenshot={shown}", page]
    subprocess.run(command, check=True, capture_output=True, timeout=300)
    save_jpeg(shown, out)


def draw_shapes(folder: Path, out: Path) -> None:
    """Draw every sample shape as a bed of 49 x 49 pins shows it."""
    import matplotlib.pyplot as plt
    from digiclay.core.model.actuator import Actuator
    from digiclay.core.model.layout import Layout, make_grid
    from digiclay.core.shapes.fitting import fit_shape, list_shapes
    from digiclay.core.shapes.request import Shape
    from digiclay.plots.bed import draw_relief

    bed, names = make_grid(Layout(rows=49, columns=49, pitch=2e-3)), list_shapes()
    figure = plt.figure(figsize=(15, 9.4))
    for number, name in enumerate(names):
        left, below = number % 5 / 5, (2 - number // 5) / 3
        axes = figure.add_axes((left, below, 0.2, 0.33), projection="3d", computed_zorder=False)
        heights = fit_shape(Shape(file=name, rise=16e-3), bed, Actuator()).heights
        area = (left + 0.004, below + 0.01, left + 0.196, below + 0.29)
        draw_relief(axes, {"position": bed.positions, "height": heights[None]}, area)
        figure.text(left + 0.1, below + 0.28, name, ha="center", fontsize=15)
    drawn = folder / "drawn.png"
    figure.savefig(drawn, dpi=80)
    save_jpeg(drawn, out, 85)


def set_up_scene() -> None:
    """Set up an empty scene with a camera that looks down on the bed from the front left."""
    import bpy
    from mathutils import Vector

    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera, camera.data.type, camera.data.ortho_scale = camera, "ORTHO", SHOWN
    camera.data.clip_end = 1e4
    camera.rotation_euler = radians(55.0), 0.0, radians(32.0)
    bpy.context.view_layer.update()
    camera.location = Vector((0.0, 0.0, 36.0)) + camera.matrix_world.to_3x3() @ Vector(
        (0.0, 0.0, 500.0)
    )
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
    import bpy

    set_up_scene()
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


def draw_export(folder: Path, out: Path) -> None:
    """Draw by Workbench what `digiclay export` writes of the paper's session, four views in one."""
    whole = Image.new("RGB", (2 * SIZE[0], 2 * SIZE[1]), "white")
    carry_out("run", "ridge_mound_valley", "--out", folder / "run", "--quiet")
    for index, options in enumerate(VIEWS):
        meshes = folder / str(index)
        carry_out("export", folder / "run", "--format", "stl", "--out", meshes, *options)
        view = render(list(meshes.glob("*.stl")), folder / f"{index}.png")
        whole.paste(view, (index % 2 * SIZE[0], index // 2 * SIZE[1]))
    whole.save(out, quality=88)


#: By name of the picture what draws it, given a folder for other files and its path.
DRAWN: dict[str, Callable[[Path, Path], None]] = {
    "pins.jpg": partial(
        draw_scene, scene="ridge_mound_valley", size="1600x1000", quality=88, color="mode"
    ),
    "session.png": partial(plot_session, scene="ridge_mound_valley"),
    "film.jpg": draw_film,
    "batch.jpg": draw_series,
    "export.jpg": draw_export,
    "shapes.jpg": draw_shapes,
    **{
        f"{name}.jpg": partial(draw_scene, scene=name, size="900x563") for name in (*HANDS, *BODIES)
    },
    "closing_hand.jpg": draw_closing_hand,
    **{
        f"samples/{name}.jpg": partial(draw_scene, scene=name, size="520x390", quality=70)
        for name in list_samples()
    },
    "two_hands.webp": partial(draw_scene_film, scene="two_hands_bowl", speed=3.0, frames=53),
    "hand_print.webp": partial(draw_scene_film, scene="hand_print", speed=0.8, frames=38),
    "hand_forces.png": partial(plot_session, scene="five_fingers_mound", shrunk=2),
    "noise.svg": partial(draw_by_program, page="figure.md", program="question.py"),
    "animation.png": partial(draw_by_program, page="animation.md", program="animate.py"),
    "laws.svg": lambda folder, out: draw_laws(out),
}


def main(names: list[str]) -> None:
    """Draw the named pictures, or take those of the guide."""
    if names[:1] == ["--guide"]:
        return cut_guide(Path(names[1]))
    if not names or set(names) - set(DRAWN):
        sys.exit(
            f"The arguments must be names of pictures: {', '.join(DRAWN)} (got {' '.join(names) or 'none'})"
        )
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            DRAWN[name](Path(folder), PICTURES / name)


if __name__ == "__main__":
    main(sys.argv[1:])
