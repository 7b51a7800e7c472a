"""Preferences of all beds: redraw rate, colors, control periods to catch up in a tick."""

# No postponed annotations here: Blender reads the preferences' properties from them.
from types import SimpleNamespace

from .compat import RELATIVE_PATH, AddonPreferences, Context, UILayout, bpy
from .device import palettes
from .settings import own_folder
from .settings.declared import choice, flag, integer, text, title

#: Corners of a 3D view for the overlay.
CORNERS = ("top_left", "top_right", "bottom_left", "bottom_right")
#: Those that are drawn first, in their order.
SHOWN = (
    "redraw_rate",
    "most_periods",
    "palette",
    "take_press_tool",
    "light_relief",
    "show_cursor_text",
    "overlay_corner",
)


def redraw_views(preferences: AddonPreferences, context: Context) -> None:
    """Draw the 3D views anew."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            area.tag_redraw()


def take_methods(preferences: AddonPreferences, context: Context) -> None:
    """Run the files of the folder of own control methods where that is allowed; else take them back."""
    if preferences.run_own_methods:
        own_folder.load(preferences.methods_folder)
    else:
        own_folder.clear()


def take_folder(preferences: AddonPreferences, context: Context) -> None:
    """Take the permission back, which was given for another folder; store the full path of this one."""
    preferences.run_own_methods = False
    full = own_folder.find_full_path(preferences.methods_folder)
    if full != preferences.methods_folder:
        preferences.methods_folder = full
    elif not own_folder.is_full(full):
        own_folder.load(full)  # refuses it, which the preferences show


class Preferences(bpy.types.AddonPreferences):
    """Edit > Preferences > Add-ons > Digital Clay."""

    bl_idname = __package__

    redraw_rate: integer(
        "Redraw Rate (Hz)",
        "Largest redraw rate of a live session, in Hz; drawing takes most of the time",
        default=30,
        min=1,
        max=240,
        soft_min=10,
        soft_max=60,
    )
    most_periods: integer(
        "Periods per Redraw",
        "Control periods simulated between two redraws at most. A machine that does "
        "not manage them runs the session slower than real time instead of stalling",
        default=20,
        min=1,
        max=1000,
        soft_max=100,
    )
    palette: choice(
        "Mode Colors",
        "Colors of the modes; a choice recolors the beds of the open file",
        items=[(name, *words) for name, words in palettes.WORDS.items()],
        default=palettes.DEFAULT,
        update=lambda preferences, context: palettes.set_palette(preferences.palette),
    )
    take_press_tool: flag(
        "Take the Press Tool", "The start of a session takes the Press tool in hand", default=True
    )
    light_relief: flag(
        "Light for Sculpting",
        "Adding a bed and the start of a session light a 3D view with a matcap and "
        "cavity, once a workspace, unless its shading was changed",
        default=True,
    )
    show_cursor_text: flag(
        "Text at the Cursor",
        "The Press tool writes size, brush and amount beside the cursor",
        default=True,
    )
    overlay_corner: choice(
        "Overlay Corner",
        "Corner of the 3D view with the overlay of a session",
        items=[(name, title(name), "") for name in CORNERS],
        default="top_left",
        update=redraw_views,
    )
    run_own_methods: flag(
        "Run Own Methods",
        "Run all Python files of a folder, now and whenever Blender starts: "
        "the control methods in them are offered in Laboratory > Control",
        default=False,
        update=take_methods,
    )
    methods_folder: text(
        "Own Methods",
        "Folder with Python files of control methods; a change turns Run Own Methods off",
        default="",
        subtype="DIR_PATH",
        options=RELATIVE_PATH,
        update=take_folder,
    )

    def draw(self, context: Context) -> None:
        """Draw the preferences."""
        column = self.layout.column()
        column.use_property_split = True
        for name in SHOWN:
            column.prop(self, name)
        column.separator()
        row = column.row(align=True)
        row.prop(self, "methods_folder")
        row.operator("digiclay.methods_reload", text="", icon="FILE_REFRESH")
        if self.methods_folder:
            self._draw_methods(column)

    def _draw_methods(self, column: UILayout) -> None:
        """Draw a warning, the permission, what was loaded, and what was refused."""
        warning = column.column()
        warning.alert = True
        warning.label(
            text="Every Python file in this folder is run with all your rights:", icon="ERROR"
        )
        advice = "choose a folder that only you can write to, with code that you have read."
        warning.label(text=advice, icon="BLANK1")
        column.prop(self, "run_own_methods")
        present = own_folder.read_present()
        for name in present.names:
            column.label(text=title(name), icon="CHECKMARK", translate=False)
        for line in present.refused:
            column.label(text=line, icon="CANCEL", translate=False)


def defaults() -> SimpleNamespace:
    """Return the default preferences."""
    declared = Preferences.__annotations__
    return SimpleNamespace(**{name: each.keywords["default"] for name, each in declared.items()})


def get(context: Context) -> AddonPreferences:
    """Return the user's preferences; where the package is used without being enabled, the defaults."""
    entry = context.preferences.addons.get(__package__)
    return defaults() if entry is None or entry.preferences is None else entry.preferences


def register() -> None:
    """Register the preferences, and load the methods of the folder where they allow it."""
    bpy.utils.register_class(Preferences)
    take_methods(get(bpy.context), bpy.context)


def unregister() -> None:
    """Undo `register`."""
    own_folder.clear()
    bpy.utils.unregister_class(Preferences)
