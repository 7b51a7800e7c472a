"""Control methods of one's own as files, for the tests."""

from contextlib import contextmanager

import digiclay
import numpy as np
from digiclay.cli import main
from digiclay.core.control.methods import list_added, remove_method
from digiclay.core.scene.scene_source import Setting, find, load

from tests.scene_files import write_text

HEAD = '''
"""Method of a test."""
from dataclasses import dataclass
from typing import NamedTuple
import numpy as np
from digiclay.core.control.own_method import Cells, Mode, Orders, OwnMethod, quantity
'''
#: Pins under a force give way, step by step.
PAD = f'''{HEAD}
@dataclass(frozen=True)
class SoftPad(OwnMethod):
    """Pins under a force give way."""

    yield_force: float = quantity(0.03, "force above which a pin gives way", unit="N", above=0.0, below=1.0)
    step: float = quantity(50e-6, "way in a control period", unit="m", above=0.0)

    def command(self, memory, cells, device):
        down = cells.force > self.yield_force
        return memory, Orders(height=np.where(down, cells.height - self.step, cells.target))
'''

COPY = f"""{HEAD}
from digiclay.core.control import virtual_master

@dataclass(frozen=True)
class MethodOne(virtual_master.VirtualMaster):
    blister = {{}}

    def build(self, device):
        return virtual_master.build(self, device)
"""
COPY_TWO = COPY.replace("virtual_master", "cell_states").replace(".VirtualMaster", ".CellStates")
COPY_THREE = COPY.replace("virtual_master", "hybrid").replace(".VirtualMaster", ".Hybrid")
#: A memory as of a controller that follows a fingertip, and none.
PLACED = (
    PAD.replace(
        "    def command", "    def begin(self, device):\n        return Kept()\n\n    def command"
    )
    + "\nclass Kept(NamedTuple):\n    place: float = 0.5\n"
)


class Mine(digiclay.Method):
    """Pins under a force give way."""

    yield_force: float = digiclay.quantity(
        0.03, "force above which a pin gives way", unit="N", above=0.0
    )

    def command(self, memory, cells, device):
        down = cells.force > self.yield_force
        return memory, digiclay.Orders(height=np.where(down, cells.height - 50e-6, cells.target))


def write_method(folder, text=PAD, name="pad.py"):
    """Write the file of a method, and return it."""
    path = folder / name
    write_text(path, text)
    return path


@contextmanager
def forgotten():
    """Make methods that the block adds unknown again at its end."""
    before = list_added()
    try:
        yield
    finally:
        for name in list_added().keys() - before.keys():
            remove_method(name)


def small(method, *settings):
    """Return a press on a small bed with a method."""
    said = ("layout.rows=11", "layout.columns=11", "simulation.duration=0.2", *settings)
    changes = [Setting(*one.split("=", 1)) for one in said]
    return load(find("tap"), [Setting("control.method", method), *changes])


def refused(capsys, *arguments):
    """Return the line with which the command refuses."""
    assert main(list(arguments)) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1, said
    return said


def bad(body):
    inner = "\n".join(f"    {line}" for line in body.splitlines())
    return f"{HEAD}\n@dataclass(frozen=True)\nclass Bad(OwnMethod):\n{inner}\n"


def commanding(line):
    return bad(f"def command(self, memory, cells, device):\n    {line}")


def ordering(orders):
    return commanding(f"return memory, {orders}")


def building(line):
    return bad(f"def build(self, device):\n    {line}")


def keeping(first, later):
    return bad(
        f"def begin(self, device):\n    return {first}\n"
        f"def command(self, memory, cells, device):\n    return {later}, Orders()"
    )
