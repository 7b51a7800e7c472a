"""Version of this release: that of the package, of the extension, and of what a run is stored with."""

__version__ = "0.2.0"
