"""Size limits of input meshes, and the messages of their refusal."""

from __future__ import annotations

from ..base.errors import ParameterError

#: Most triangles of a mesh: as many as a bed may have cells. They take some 5 GB while they are laid onto it.
MOST_TRIANGLES = 20_000_000
#: Most bytes of a mesh's file, or of what a compressed one unpacks to.
MOST_BYTES = 2_000_000_000
SMALLER = "Make the mesh coarser first."


def make_refusal(rule: str, name: str, said: str, hint: str = "") -> ParameterError:
    """Return the error of an unusable mesh: the rule, the file, and its content.

    `rule`: what holds for every mesh, from *must* on; `name`: of the file; `said`: what this one has; `hint`:
    what to do about it.
    """
    return ParameterError("shape", "file", rule, f"{name}: {said}", hint)


def refuse_many_triangles(name: str, count: int) -> None:
    """Refuse a mesh of more triangles than can be worked on, before they are made.

    `name`: of the file; `count`: triangles.
    """
    if count > MOST_TRIANGLES:
        rule = f"must have at most {MOST_TRIANGLES // 1_000_000} million triangles"
        # Copies of copies can come to a number of any length.
        shown = f"{count:,}" if count < 10**15 else "more than 10^15"
        raise make_refusal(rule, name, shown, SMALLER)


def refuse_size(name: str, size: int, what: str = "") -> None:
    """Refuse a file of more bytes than can be read; `what` names the part.

    `name`: of the file; `size`: bytes; `what`: part of the file that has this size; empty: the file.
    """
    if size > MOST_BYTES:
        rule = f"must have at most {MOST_BYTES / 1e9:g} GB{' unpacked' if what else ''}"
        raise make_refusal(rule, name, f"{what} {size / 1e9:.3g} GB".strip(), SMALLER)
