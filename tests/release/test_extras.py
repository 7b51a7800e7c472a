"""Extras beside Blender's module: a checkout's environment keeps its numpy."""

import json
import re
import sys
import tomllib

from tests.other_process import carry_out
from tests.scene_files import command, read_text, write_text

from .conftest import ENVIRONMENT, ROOT, copy_checkout


def test_all_extras_fit_into_the_checkout_without_another_numpy(tmp_path):
    checkout = copy_checkout(tmp_path / "a checkout")
    pins = read_text(checkout / "requirements" / "demo.txt")
    # As `make demo` sets it up, but without Blender's module, which is 400 MB.
    few = re.findall(r"^(?:numpy|setuptools|trimesh)==.*$", pins, re.MULTILINE)
    write_text(checkout / "few.txt", "\n".join(few) + "\n")
    here = {"cwd": checkout, "env": ENVIRONMENT | {"GOAL": "demo"}}
    words = ".venv", "few.txt", "3.11", "PYTHON", sys.executable
    carry_out("tools/environment", *words, **here)
    project = tomllib.loads(read_text(ROOT / "pyproject.toml"))["project"]
    extras = {*project["optional-dependencies"]} - {"blender", "dev"}
    pip = command(
        ".venv/bin/python -m pip --disable-pip-version-check install --dry-run --quiet --report -"
    )
    said = carry_out(*pip, f"digiclay[{','.join(extras)}]", **here)
    found = [one["metadata"] for one in json.loads(said)["install"]]
    wanted = {one["name"].lower(): one["version"] for one in found}
    assert {"matplotlib", "optuna", "scipy", "websockets"} <= wanted.keys()
    assert "numpy" not in wanted
    assert f"matplotlib=={wanted['matplotlib']}" in pins
