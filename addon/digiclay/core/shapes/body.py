"""Sections [[body]] of a scene: meshes that press the pins, their contact, and the reading of their files."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ..base.errors import ParameterError
from ..base.quantity import Parameters, quantity
from ..files.formats import inflate
from ..files.tables import shorten
from ..mesh_io import mesh_reader
from ..mesh_io.mesh_reader import READERS
from ..mesh_io.obj_reader import turn_up
from ..model.contact import Contact
from ..model.relaxation import Relaxation
from ..model.underside import MOST_SAMPLES, Mesh, check_mesh, refuse_flat
from .request import AUTO, LENGTHS, UPWARDS, find_length

#: Most triangles of a body, whose underside is computed many times per second, and bytes of a
#: packed mesh.
MOST_TRIANGLES, MOST_BYTES = 1_000_000, 100_000_000
#: Rate of stiffening of a body's contact, 1/m: at the cap a spring is straight to 0.1 %.
STRAIGHT = 1.0


@dataclass(frozen=True, eq=False, repr=False)
class Body(Parameters):
    """Rigid body: a mesh, and its contact with a pin, a spring and a damper up to the cap."""

    file: str = quantity("", "file of a mesh")
    mesh: str = quantity("", "vertices, m, and triangles, packed as text, in place of the file")
    up: str = quantity(AUTO, "upward direction of the file", choices=(AUTO, *UPWARDS))
    unit: str = quantity(AUTO, "unit of length of the file", choices=(AUTO, *LENGTHS))
    scale: float = quantity(1.0, "scale of the mesh", above=0.0, at_most=1e6)
    stiffness: float = quantity(
        400.0, "force of a pin per indentation", unit="N/m", symbol="k_b", above=0.0
    )
    damping: float = quantity(
        0.0, "force of a pin per speed of indentation", unit="N s/m", symbol="c_b", at_least=0.0
    )
    cap: float = quantity(
        1.6e-3, "largest indentation, e.g. of a pin met sideways", unit="m", symbol="x_b", above=0.0
    )
    tip_radius: float = quantity(
        0.0, "radius of a pin's end; at 0 a pin is its axis", unit="m", symbol="r_p", at_least=0.0
    )
    samples: int = quantity(
        3, "sample points per pitch of a rounded end, odd", at_least=1, at_most=MOST_SAMPLES
    )
    travel: float = quantity(
        1.5e-3, "motion sideways between two computed undersides", unit="m", at_least=0.0
    )

    def check(self) -> None:
        """Refuse keys of a file beside a mesh, and an even number of samples."""
        for field, usual in (("file", ""), ("up", AUTO), ("unit", AUTO)):
            value = getattr(self, field)
            if self.mesh and value != usual:
                raise ParameterError("Body", field, "must be left out where mesh is given", value)
        if self.samples % 2 == 0:
            raise ParameterError("Body", "samples", "must be odd", str(self.samples))

    @property
    def given(self) -> bool:
        """Whether it has no mesh: its underside is given, see `engine.bodies.GivenUndersides`."""
        return not (self.file or self.mesh)

    def without_mesh(self) -> Body:
        """Return the same contact, of a body that is given."""
        return replace(self, file="", mesh="", up=AUTO, unit=AUTO, scale=1.0)

    @property
    def contact(self) -> Contact:
        """Law of the contact at once: with damping twice as stiff as in the end."""
        stiffness = 2.0 * self.stiffness if self.relaxation else self.stiffness
        return Contact(stiffness, STRAIGHT, share=1.0)

    @property
    def relaxation(self) -> Relaxation | None:
        """Damper, in series with a second spring of the same stiffness, so that impacts stay finite."""
        time = self.damping / self.stiffness
        return Relaxation((time,), (0.5, 0.5)) if time > 1e-9 else None


def pack_mesh(vertices: ArrayLike, triangles: ArrayLike) -> str:
    """Return vertices (v, 3), m, z up, and triangles (t, 3) as `Body.mesh`; ParameterError if unsound."""
    mesh = check_mesh(vertices, triangles)
    head = np.array([len(mesh.vertices)], "<i4").tobytes()
    body = mesh.vertices.astype("<f8").tobytes() + mesh.triangles.astype("<i4").tobytes()
    return base64.b64encode(zlib.compress(head + body)).decode("ascii")


def read_bodies(bodies: Iterable[Body]) -> tuple[Mesh, ...]:
    """Return the meshes of a scene's bodies in their own axes, m, z up; ParameterError if one is unsound."""
    meshes = []
    for number, body in enumerate(bodies, 1):
        owner = f"body #{number}"
        mesh = _unpack(body.mesh, owner) if body.mesh else _read_file(body, owner)
        refuse_flat(mesh, owner, "mesh" if body.mesh else "file")
        meshes.append(mesh._replace(vertices=mesh.vertices * body.scale))
    return tuple(meshes)


def _unpack(text: str, owner: str) -> Mesh:
    """Return the mesh of a text of `pack_mesh`."""
    try:
        data = inflate(base64.b64decode(text, validate=True), MOST_BYTES)
        end = 4 + 24 * int(np.frombuffer(data, "<i4", 1)[0])
        vertices = np.frombuffer(data[4:end], "<f8").reshape(-1, 3)
        triangles = np.frombuffer(data[end:], "<i4").reshape(-1, 3)
        sound = len(triangles) <= MOST_TRIANGLES
    except ValueError:
        sound = False
    if not sound:
        rule = f"must be a mesh packed as text, of at most {MOST_TRIANGLES:,} triangles"
        raise ParameterError(owner, "mesh", rule, repr(shorten(text)))
    return check_mesh(vertices, triangles, owner)


def _read_file(body: Body, owner: str) -> Mesh:
    """Return the mesh of a body's file."""
    path = Path(body.file)
    if not path.is_file():
        raise ParameterError(owner, "file", "must be a file that exists", body.file)
    if path.suffix.lower() not in READERS:
        rule = f"must be the file of a mesh ({', '.join(READERS)})"
        raise ParameterError(owner, "file", rule, body.file)
    try:
        read = mesh_reader.read(path)
        if len(read.faces) > MOST_TRIANGLES:
            rule = f"must have at most {MOST_TRIANGLES:,} triangles"
            raise ParameterError(owner, "file", rule, f"{len(read.faces):,}")
        turned = turn_up(read.vertices, read.up if body.up == AUTO else body.up)
        return check_mesh(turned * find_length(body.unit, read.length), read.faces, owner)
    except OSError as error:
        rule = "must be a file that can be read"
        raise ParameterError(owner, "file", rule, f"{path}: {error.strerror}") from None
    except ParameterError as error:
        raise ParameterError(owner, "file", error.rule, error.value, error.hint) from None
