"""Scene files for tests of the command line: a few pins, a tenth of a second or so."""

import csv
import json
import os
import shlex
import signal

from digiclay.cli import main

#: A blister that fits a bed of a few pins; on larger ones the default does.
SMALL_BLISTER = """
[blister]
radius = 0.005
edge_radius = 0.008
flat_radius = 0.002
"""
#: A tenth of a second: the finger presses the pins, and lifts off.
TOUCH = (0.0, 0.041), (0.05, 0.038), (0.1, 0.05)


def command(line):
    """Return the words of a command line."""
    return line.split()


def read_text(path):
    """Return a text file's content."""
    return path.read_text(encoding="utf-8")


def write_text(path, text):
    """Write a text file."""
    path.write_text(text, encoding="utf-8")


def scene_text(rows, columns, *waypoints, parts=""):
    """Return a scene file: a bed, and a level finger over its middle (time in s, height in m)."""
    places = [f"  {{ time = {time}, position = [0, 0, {height}] }}," for time, height in waypoints]
    bed = f"[layout]\nrows = {rows}\ncolumns = {columns}\n{parts}"
    return "\n".join([bed, "[trajectory]", "waypoints = [", *places, "]\n"])


#: A tap on 3 x 4 pins, the least that most commands need.
SCENE = scene_text(3, 4, *TOUCH, parts=SMALL_BLISTER)


def folder_with(scene, folder, monkeypatch):
    """Work in an empty folder with one scene, my.toml."""
    (folder / "my.toml").write_text(scene, encoding="utf-8")
    monkeypatch.chdir(folder)
    return folder


def call(line):
    """Give the program a command line, and return its exit code."""
    return main(shlex.split(line))


def read_json(path):
    """Return what a JSON file holds."""
    return json.loads(path.read_text(encoding="utf-8"))


def timeless(path):
    """Return the rows of a table without the run times, which are others each time."""
    return [
        {name: text for name, text in row.items() if name != "run_time (s)"} for row in rows(path)
    ]


def left(folder):
    """Return what lies in the folder besides the scene, hidden things too."""
    return sorted(path.name for path in folder.iterdir() if path.name != "my.toml")


def rows(path):
    """Return the lines of a table."""
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def interrupt_after(count, monkeypatch, number=signal.SIGINT):
    """Have this process get a signal when so many points of a series are kept."""
    from digiclay.core.studies.sweep_plan import Folder

    keep, kept = Folder.keep, []

    def told(*given):
        keep(*given)
        kept.append(given)
        if len(kept) == count:
            os.kill(os.getpid(), number)

    monkeypatch.setattr(Folder, "keep", told)
