"""Mesh files by hand, and what is said of those that cannot be read."""

import re

import numpy as np
from digiclay.core.base.errors import ParameterError
from digiclay.core.mesh_io.mesh_reader import read

from tests.assemble import refused_in_a_line

#: A tetrahedron without symmetry: its volume's sign tells a turn from a reflection.
PLACES = np.array([[0.0, 0, 0], [5, 0, 0], [0, 7, 0], [0, 0, 11]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
VOLUME = 5 * 7 * 11 / 6


def put(folder, name, content):
    """Write text or bytes into a file of a folder, and return its path."""
    (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    return folder / name


def assert_refused(path, said):
    """Assert that a mesh's file is refused in a line that has these words."""
    with refused_in_a_line(ParameterError, re.escape(said)):
        read(path)
