"""Digital Clay: shape-design sessions on a simulated bed of fluidic pins.

As a package this is the simulation (`digiclay.core`) and its command line; as a Blender
extension it registers what shows in Blender. Importing it does no work and needs no Blender.
"""

from __future__ import annotations

__version__ = "0.2.0"


def register() -> None:
    """Add the extension's properties, operators and panels; Blender calls this when it is enabled."""
    from . import registration

    registration.register()


def unregister() -> None:
    """Take back all that `register` added."""
    from . import registration

    registration.unregister()
