"""Registration of the extension in Blender, in order, and its reverse."""

import sys
from types import ModuleType

from . import command_line, manual_map, operators, panels, preferences, translations
from .device import detail, part_watch
from .exchange import image_reader
from .live import handlers
from .press import brush_presets, ghost, lock_marks, tool
from .settings import properties

#: Each has a function `register` and one `unregister`. Properties come first: panels draw them.
MODULES: tuple[ModuleType, ...] = (
    properties,
    image_reader,
    preferences,
    brush_presets,
    operators,
    panels,
    tool,
    ghost,
    lock_marks,
    translations,  # of all that is registered before
    command_line,
    manual_map,
    part_watch,
    detail,
    handlers,  # the last to come and the first to go: it ends what runs
)


def register() -> None:
    """Register every module; when one fails, take back those before it, so that nothing half-done stays."""
    done: list[ModuleType] = []
    try:
        for module in MODULES:
            module.register()
            done.append(module)
    except BaseException:
        for module in reversed(done):
            module.unregister()
        raise


def unregister() -> None:
    """Undo `register` in the opposite order."""
    # Blender 4.2 keeps callbacks of properties for good, and with them the names of their modules,
    # `bpy` too; its Python module then crashes at exit. Python clears the names of a module that
    # something refers to.
    for name, module in list(sys.modules.items()):
        if name.startswith(__package__):
            vars(module)["_this_module"] = module
    for module in reversed(MODULES):
        module.unregister()
