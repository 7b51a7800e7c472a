"""User presets: scene files in the extension's folder, data only."""

from pathlib import Path

from ..compat import PACKAGE, bpy
from ..core.base.errors import OutputError, explain_os_error
from ..core.files.run_folder import write_whole
from ..core.scene.schema import Scene
from ..core.scene.toml_table import PRESETS, format_scene

#: Longest name, so that the file's stays within what file systems take.
LONGEST = 60
#: What no file's name can have on one system or another.
FORBIDDEN = frozenset('<>:"/\\|?*')


def folder() -> Path:
    """Return the folder of the presets, which need not be there yet."""
    if PACKAGE.startswith("bl_ext."):
        return Path(bpy.utils.extension_path_user(PACKAGE, path="presets"))
    # Run from its source it is no extension, and has no folder of its own.
    return Path(bpy.utils.user_resource("SCRIPTS", path=str(Path("presets", "digiclay"))))


def names() -> list[str]:
    """Return the names of the user's own presets in the order of the alphabet."""
    return sorted((file.stem for file in folder().glob("*.toml")), key=str.casefold)


def path(name: str) -> Path:
    """Return the file of a preset. Raises OutputError when a preset cannot have that name."""
    plain = name.strip()
    if not plain or len(plain) > LONGEST or plain.startswith("."):
        rule = f"must be a name of 1 to {LONGEST} letters that does not start with a dot"
    elif not plain.isprintable() or set(plain) & FORBIDDEN or plain.endswith("."):
        rule = "must be of letters that a file's name can have on every system"
    elif plain.casefold() in PRESETS:
        rule = f"must not be {', '.join(PRESETS)}"
    else:
        return folder() / f"{plain}.toml"
    raise OutputError(f"The preset's name {rule} (got {name!r}).")


def save(name: str, scene: Scene) -> Path:
    """Save a scene as a preset, in place of one of the same name."""
    file = path(name)
    with explain_os_error(f"Cannot write {file}"):
        file.parent.mkdir(parents=True, exist_ok=True)
    write_whole(file, format_scene(scene).encode())
    return file


def remove(name: str) -> None:
    """Remove a preset. Raises OutputError when there is none, or its file cannot be removed."""
    file = path(name)
    with explain_os_error(f"Cannot remove {file}"):
        file.unlink()
