"""Reload: the files of the folder of own control methods are run again."""

from typing import Any

from .. import preferences
from ..compat import bpy
from ..settings import own_folder
from ..ui_text import localize
from .action import Action


class ReloadMethods(Action, bpy.types.Operator):
    """Run the Python files of the folder of own control methods again; running sessions keep their method"""

    bl_idname = "digiclay.methods_reload"
    bl_label = "Reload Methods"
    in_any_mode = True

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """The preferences must allow code of the folder."""
        return "" if preferences.get(context).run_own_methods else "Turn on Run Own Methods first"

    def perform(self, context: Any) -> None:
        """Run them."""
        preferences.take_methods(preferences.get(context), context)
        found = own_folder.read_present()
        for line in found.refused:
            self.report({"WARNING"}, line)
        self.report({"INFO"}, localize("{} control methods loaded", len(found.names)))
