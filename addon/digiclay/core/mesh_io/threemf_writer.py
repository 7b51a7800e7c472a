"""3MF files: a zip of XML with its unit; an object a body."""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from typing import IO, BinaryIO

from ..surface.body import Body, split_pieces

CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
PACKAGE = "http://schemas.openxmlformats.org/package/2006"
HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n'
TYPES = (
    f'{HEAD}<Types xmlns="{PACKAGE}/content-types">'
    '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
    '<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/>'
    "</Types>\n"
)
RELATIONS = (
    f'{HEAD}<Relationships xmlns="{PACKAGE}/relationships">'
    '<Relationship Id="model" Target="/3D/3dmodel.model" '
    'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>\n'
)
#: The same in every file, so that the same mesh gives the same bytes.
MOMENT = (1980, 1, 1, 0, 0, 0)


def write(file: BinaryIO, bodies: Sequence[Body], factor: float) -> None:
    """Write the bodies, lengths in 1 / `factor` m. `factor`: units of the file in a meter."""
    unit = "millimeter" if factor > 1.0 else "meter"
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, text in (("[Content_Types].xml", TYPES), ("_rels/.rels", RELATIONS)):
            archive.writestr(zipfile.ZipInfo(name, MOMENT), text)
        model = zipfile.ZipInfo("3D/3dmodel.model", MOMENT)
        model.compress_type = zipfile.ZIP_DEFLATED
        with archive.open(model, "w", force_zip64=True) as part:
            part.write(f'{HEAD}<model unit="{unit}" xml:lang="en-US" xmlns="{CORE}">\n<resources>\n'.encode())
            for number, body in enumerate(bodies, 1):
                # Only what encloses a volume may be a "model".
                kind = "model" if body.closed else "surface"
                part.write(f'<object id="{number}" type="{kind}" name="{body.name}"><mesh>\n'.encode())
                _mesh(part, body, factor)
                part.write(b"</mesh></object>\n")
            part.write(b"</resources>\n<build>\n")
            for number in range(1, len(bodies) + 1):
                part.write(f'<item objectid="{number}"/>\n'.encode())
            part.write(b"</build>\n</model>\n")


def _mesh(part: IO[bytes], body: Body, factor: float) -> None:
    """Write vertices to the nearest nanometer, and triangles."""
    number = "%.6f" if factor > 1.0 else "%.9f"
    vertex = f'<vertex x="{number}" y="{number}" z="{number}"/>\n'
    part.write(b"<vertices>\n")
    for some in split_pieces(len(body.vertices)):
        block = body.vertices[some] * factor
        part.write(((vertex * len(block)) % tuple(block.ravel().tolist())).encode())
    part.write(b"</vertices>\n<triangles>\n")
    triangle = '<triangle v1="%d" v2="%d" v3="%d"/>\n'
    for some in split_pieces(len(body.faces)):
        faces = body.faces[some]
        part.write(((triangle * len(faces)) % tuple(faces.ravel().tolist())).encode())
    part.write(b"</triangles>\n")
