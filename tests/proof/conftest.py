"""Common parts of the proofs by other programs: meshes of the paper's final surface, the programs."""

import shutil
import subprocess
from functools import partial

import pytest

from tests.other_process import carry_out
from tests.scene_files import call

PROGRAMS = ("admesh", "assimp", "prusa-slicer")


def pytest_collection_modifyitems(items):
    """Skip what needs a missing program; `make test-proof` sees to it that none is."""
    lacking = [name for name in PROGRAMS if shutil.which(name) is None]
    if not lacking:
        return
    skip = pytest.mark.skip(reason=f"{', '.join(lacking)} not installed: run 'make test-proof'")
    for item in items:
        if "meshes" in getattr(item, "fixturenames", ()):
            item.add_marker(skip)


@pytest.fixture(scope="session")
def paper(tmp_path_factory):
    folder = tmp_path_factory.mktemp("proof") / "paper"
    assert call(f"run ridge_mound_valley --out {folder} --quiet --no-errors") == 0
    return folder


@pytest.fixture(scope="session")
def meshes(paper):
    out = paper.parent
    export = f"export {paper} --format stl,stl_ascii,obj,ply,glb,3mf --quiet"
    for kind in ("solid", "surface", "pins", "features"):
        assert call(f"{export} --kind {kind} --out {out / 'bilinear'}") == 0
    for skin in ("smooth", "membrane"):
        for kind in ("solid", "features --separate"):
            assert call(f"{export} --kind {kind} --skin {skin} --out {out / skin}") == 0
    return out


#: Runs another program and returns all that it says.
told = partial(carry_out, stderr=subprocess.STDOUT)
