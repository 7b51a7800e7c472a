"""Differences between Blender 4.2 to 5.2."""

import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from .core.base.errors import DigiclayError

try:
    import bpy as bpy  # for the others, as are the types
    from bpy.types import ID as ID
    from bpy.types import AddonPreferences as AddonPreferences
    from bpy.types import Area as Area
    from bpy.types import Collection as Collection
    from bpy.types import Context as Context
    from bpy.types import Depsgraph as Depsgraph
    from bpy.types import Event as Event
    from bpy.types import Header as Header
    from bpy.types import Material as Material
    from bpy.types import Menu as Menu
    from bpy.types import Mesh as Mesh
    from bpy.types import Modifier as Modifier
    from bpy.types import Node as Node
    from bpy.types import NodeInputs as NodeInputs
    from bpy.types import NodeOutputs as NodeOutputs
    from bpy.types import NodeSocket as NodeSocket
    from bpy.types import NodeTree as NodeTree
    from bpy.types import Object as Object
    from bpy.types import Operator as Operator
    from bpy.types import OperatorProperties as OperatorProperties
    from bpy.types import PropertyGroup as PropertyGroup
    from bpy.types import Region as Region
    from bpy.types import RegionView3D as RegionView3D
    from bpy.types import RenderSettings as RenderSettings
    from bpy.types import Scene as Scene
    from bpy.types import Screen as Screen
    from bpy.types import Timer as Timer
    from bpy.types import UILayout as UILayout
    from bpy.types import View3DShading as View3DShading
    from bpy.types import ViewLayer as ViewLayer
    from bpy.types import Window as Window
    from bpy.types import WorkSpaceTool as WorkSpaceTool
    from bpy.types import World as World
    from bpy.types import bpy_struct as bpy_struct
    from mathutils import Matrix as Matrix
except ModuleNotFoundError as error:
    if error.name != "bpy":
        raise
    raise DigiclayError(
        "This needs Blender's Python module, bpy: install digiclay[blender] with pip, or run inside Blender."
    ) from None
except ImportError as error:
    raise DigiclayError(
        f"Blender's Python module, bpy, is installed but cannot be loaded: {error}"
    ) from None

#: The name Blender knows the extension by.
PACKAGE = __package__
#: Of a property that takes paths beside the open file: without it Blender 4.5 to 5.2 crash in
#: preferences.
RELATIVE_PATH = {"PATH_SUPPORTS_BLEND_RELATIVE"} if bpy.app.version >= (4, 5) else set()
#: What inputs of the bed's geometry nodes are called in older files.
FORMER_INPUTS = {"Color by Force": "Colour by Force", "Top Color at (N)": "Top Colour at (N)"}
#: What a scene of ours can be made of, in the order it is taken apart.
KINDS = (
    "scenes",
    "objects",
    "collections",
    "meshes",
    "curves",
    "fonts",
    "lights",
    "cameras",
    "materials",
    "worlds",
    "node_groups",
    "images",
    "actions",
)


def shader_nodes(owner: Material | World) -> NodeTree:
    """Return the node tree of a material or world; up to 4.5 it must be enabled, from 5.0 it exists."""
    if owner.node_tree is None:
        owner.use_nodes = True
    return owner.node_tree


def has_node_setting(modifier: Modifier, name: str) -> bool:
    """Return whether a geometry nodes modifier's tree has an input, be it under its name in older files."""
    inputs = modifier.node_group.interface.items_tree
    return name in inputs or FORMER_INPUTS.get(name, name) in inputs


def node_setting(modifier: Modifier, name: str) -> Any:
    """Return what a geometry nodes modifier sets an input of its tree to."""
    identifier = _identifier(modifier, name)
    if hasattr(modifier, "properties"):
        # From 5.2 on; before that the modifier itself is the dictionary.
        return getattr(modifier.properties.inputs, identifier).value
    return modifier[identifier]


def read_stored(owner: ID, name: str) -> dict[str, Any]:
    """Return all that is stored in a property group of an object, nested; what was never set is not in it."""
    # From 5.0 on these values are kept apart from the custom properties.
    properties = (
        owner.bl_system_properties_get() if hasattr(owner, "bl_system_properties_get") else owner
    )
    group = properties.get(name) if properties is not None else None
    return group.to_dict() if group is not None else {}


def set_node_setting(modifier: Modifier, name: str, value: Any) -> None:
    """Set an input of a geometry nodes modifier's tree, for the object that has the modifier."""
    identifier = _identifier(modifier, name)
    if hasattr(modifier, "properties"):
        getattr(modifier.properties.inputs, identifier).value = value
    else:
        modifier[identifier] = value
    modifier.id_data.update_tag()  # Blender does not notice by itself


def keyframe_node_setting(modifier: Modifier, name: str, frame: int) -> None:
    """Insert a keyframe for an input of a geometry nodes modifier's tree, at its present value."""
    identifier = _identifier(modifier, name)
    if hasattr(modifier, "properties"):
        getattr(modifier.properties.inputs, identifier).keyframe_insert("value", frame=frame)
    else:
        modifier.keyframe_insert(f'["{identifier}"]', frame=frame)


def _identifier(modifier: Modifier, name: str) -> str:
    """Return the identifier of an input of a geometry nodes modifier's tree, also of an older file's tree."""
    inputs = modifier.node_group.interface.items_tree
    return inputs[name if name in inputs else FORMER_INPUTS[name]].identifier


def curves(owner: ID) -> list[Any]:
    """Return the collections of animation curves of an object: from 4.4 on those of its own slot alone."""
    data = owner.animation_data
    action = data.action if data else None
    if action is None:
        return []
    if not hasattr(data, "action_slot"):  # up to 4.3 an action has no slots
        return [action.fcurves]
    if data.action_slot is None:
        return []
    strips = (strip for layer in action.layers for strip in layer.strips)
    bags = (strip.channelbag(data.action_slot) for strip in strips)
    return [bag.fcurves for bag in bags if bag is not None]


def own_curves(owner: ID) -> None:
    """Give an object an action of its own where it shares its curves with others, as linked duplicates do."""
    data = owner.animation_data
    if not data or data.action is None:
        return
    # Up to 4.3 an action has the same curves for all its users.
    slot = getattr(data, "action_slot", None)
    if (data.action.users if slot is None else len(slot.users())) < 2:
        return
    action = data.action.copy()
    data.action = action
    if slot is None:
        return
    data.action_slot = action.slots[slot.identifier]
    for other in [each for each in action.slots if each.identifier != slot.identifier]:
        action.slots.remove(other)


def has_denoiser() -> bool:
    """Return whether this Blender was built with Cycles' denoiser; some distributions' are not."""
    try:
        import _cycles
    except ImportError:
        return False
    return bool(getattr(_cycles, "with_openimagedenoise", False))


def to_video(render: RenderSettings) -> None:
    """Have a scene's render settings write a film in an MP4 file, H.264, without sound."""
    image = render.image_settings
    if hasattr(image, "media_type"):  # from 5.0 on
        image.media_type = "VIDEO"
    image.file_format, image.color_mode = "FFMPEG", "RGB"
    film = render.ffmpeg
    film.format, film.codec, film.audio_codec = "MPEG4", "H264", "NONE"
    film.constant_rate_factor, film.ffmpeg_preset, film.gopsize = "HIGH", "GOOD", 12


def strips(scene: Any) -> Any:
    """Return the strips of a scene's video sequencer, made now; up to 4.3 they were called sequences."""
    editor = scene.sequence_editor_create()
    return editor.strips if hasattr(editor, "strips") else editor.sequences


def connect(functions: Mapping[str, Callable[..., object]]) -> None:
    """Have Blender call functions, by the names of its lists of handlers."""
    for name, function in functions.items():
        handlers = getattr(bpy.app.handlers, name)
        if function not in handlers:
            handlers.append(function)


def disconnect(functions: Mapping[str, Callable[..., object]]) -> None:
    """Undo `connect`."""
    for name, function in functions.items():
        handlers = getattr(bpy.app.handlers, name)
        if function in handlers:
            handlers.remove(function)


@contextmanager
def scratch() -> Iterator[None]:
    """Remove on leaving all data that was added to the open file inside the block."""

    def present() -> dict[int, Any]:
        return {item.as_pointer(): item for kind in KINDS for item in getattr(bpy.data, kind)}

    before = present().keys()
    try:
        yield
    finally:
        bpy.data.batch_remove([item for key, item in present().items() if key not in before])


@contextmanager
def quiet() -> Iterator[None]:
    """Keep the lines Blender itself prints while rendering off the terminal."""
    sys.stdout.flush()
    former = os.dup(1)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        yield
    finally:
        os.dup2(former, 1)
        os.close(former)
        os.close(nowhere)
