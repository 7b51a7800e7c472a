"""``digiclay serve``: a session for other programs, in real time."""

import argparse
import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

from digiclay.commands.arguments import (
    Options,
    add_command,
    add_options,
    add_scene,
    scene_of,
    whole_number,
)
from digiclay.commands.refusals import refuse_unwritable, refuse_without
from digiclay.commands.stop import Stop
from digiclay.core.base.addresses import describe_exposure
from digiclay.core.base.errors import OutputError
from digiclay.core.files.run_folder import format_json, write_whole
from digiclay.core.files.tables import Table
from digiclay.core.metrics.metric_table import describe_errors
from digiclay.core.scene.scene_source import Setting

from .doors import Doors
from .protocol import LIMITS, MOST_FINGERS, VARIABLE, Limits, choose_token, describe_bed, pack_frame
from .real_time_loop import run_session
from .served_session import PartWriter, begin_session, hold_softly, make_frame
from .tracked_fingers import Tracking

EXAMPLES = f"""\
examples:
  digiclay serve                                    the device of the paper, 200 control periods per second
  digiclay serve --rate 1000 --out recorded
  digiclay serve my.toml --port 9000 --seconds 60 --report times.json

Ctrl-C stops. Other programs send poses of the fingertip and receive forces and heights, by WebSocket and
OSC; both need the token, which is printed once, or given by --token or {VARIABLE}.
"""
HOST, PORT, OSC_PORT = "127.0.0.1", 8765, 8766
SCENE = "ridge_mound_valley"


def add(commands: Any) -> None:
    """Add the command."""
    description = "Run a session in real time for other programs: poses in, forces and heights out."
    force, most_speed, port = LIMITS.force, 1e3 * LIMITS.speed, whole_number(0, 65535)
    options: Options = {
        "--rate HZ": (
            _within(1, 1000, "Hz"),
            "control periods per second, 1 to 1000; default: the scene's",
        ),
        "--host": (str, f"address of this machine to serve at; default: {HOST}", HOST),
        "--port N": (port, f"of the WebSocket, 0: any; default: {PORT}", PORT),
        "--osc-port N": (port, f"of OSC, 0: any; default: {OSC_PORT}", OSC_PORT),
        "--token T": f"token of the clients; default: {VARIABLE}, or one at random",
        "--most-force N": (
            _within(1e-3, 1e3, "N"),
            f"largest force that a finger reports, N; default: {force:g}",
            force,
        ),
        "--most-speed MM/S": (
            _within(1.0, 1e4, "mm/s"),
            f"largest speed of the fingertip, mm/s; default: {most_speed:g}",
            most_speed,
        ),
        "--silence S": (
            _within(0.01, 1e6, "s"),
            f"lift the fingertip after this time without a pose; default: {LIMITS.silence:g}",
            LIMITS.silence,
        ),
        "--fingers N": (
            whole_number(1, MOST_FINGERS),
            "number of fingertips, all like the scene's first",
        ),
        "--lift MS": (
            _within(1.0, 1e4, "ms"),
            "lift fingers unnamed for this time; default: 100",
            100.0,
        ),
        "--clutch MM": (
            _within(0.0, 1e3, "mm"),
            "height over the pins where fingers begin, and slip",
            0.0,
        ),
        "--filter HZ": (
            _within(0.0, 1e3, "Hz"),
            "least cutoff of the 1-euro filter of fingers",
            0.0,
        ),
        "--coupling N/MM": (
            _within(0.0, 1e3, "N/mm"),
            "stiffness of the hand: fingertips yield; default: the scene's",
            0.0,
        ),
        "--out DIR": (Path, "record a take into this folder"),
        "--part S": (
            _within(0.1, 600.0, "s"),
            "most seconds of a take that a killed process loses; default: 10",
            10.0,
        ),
        "--report FILE": (Path, "write times and counts as JSON at the end"),
        "--seconds S": (_within(0.0, 1e9, "s"), "stop after this time; default: Ctrl-C"),
        "--overwrite": "replace the takes in that folder",
        "--quiet": "print addresses, errors and a random token",
    }
    purpose = "run a session for other programs"
    parser = add_command(commands, "serve", purpose, EXAMPLES, description, carry_out=carry_out)
    add_scene(parser, optional=True)
    add_options(parser, options)


def carry_out(arguments: argparse.Namespace) -> int:
    """Serve until Ctrl-C."""
    refuse_without("digiclay serve", "serve", "websockets", "pythonosc")
    if sys.platform == "win32":
        raise OutputError("digiclay serve runs on Linux and macOS: it needs non-blocking pipes.")
    if arguments.report is not None:
        refuse_unwritable(arguments.report.resolve().parent)
    token, is_new = choose_token(arguments.token)
    if arguments.rate is not None:
        arguments.settings.append(
            Setting("simulation.control_period", repr(1.0 / arguments.rate), "--rate")
        )
    arguments.scene = arguments.scene or SCENE
    scene, _ = scene_of(arguments)
    if arguments.fingers is not None:
        scene = replace(scene, fingers=scene.fingers[:1] * arguments.fingers)
    if arguments.coupling:
        scene = hold_softly(scene, 1e3 * arguments.coupling)
    limits = Limits(arguments.most_force, 1e-3 * arguments.most_speed, arguments.silence)
    tracking = Tracking(1e-3 * arguments.lift, 1e-3 * arguments.clutch, arguments.filter)
    session = begin_session(scene, limits, tracking)
    bed, host = describe_bed(scene, session.system, session.limits), arguments.host
    size, out = len(pack_frame(make_frame(session))), arguments.out
    with (
        PartWriter(out, overwrite=arguments.overwrite)
        if out is not None
        else nullcontext() as writer,
        Stop() as stop,
        Doors(
            bed, size, host=host, port=arguments.port, osc_port=arguments.osc_port, token=token
        ) as doors,
    ):
        rate, shown = 1.0 / session.system.period, f"[{host}]" if ":" in host else host
        _tell(
            f"{scene.name or scene.method}: {scene.cells} pins, {rate:g} control periods per second"
        )
        _tell(f"WebSocket ws://{shown}:{doors.port}")
        _tell(f"OSC       {shown}:{doors.osc_port} (UDP)")
        if is_new:
            _tell(f"token     {token}")
        if exposure := describe_exposure(host, "the token is"):
            _tell(exposure)
        end = math.inf if arguments.seconds is None else time.monotonic() + arguments.seconds
        try:
            session, figures = run_session(
                session,
                doors,
                writer,
                arguments.part,
                lambda: stop() or time.monotonic() >= end,
                _tell,
            )
        finally:
            written = writer.finish() if writer else []
        figures |= {
            "counts": doors.close(),
            "takes": list(writer.efforts.values()) if writer else [],
        }
    if arguments.report is not None:
        arguments.report.parent.mkdir(parents=True, exist_ok=True)
        write_whole(arguments.report, format_json({**figures, "diverged": session.diverged}))
    if not arguments.quiet:
        for line in _summary(figures):
            _tell(line)
    for path, effort in zip(written, figures["takes"], strict=False):
        _tell(
            f"take written to {path}: {effort['simulated']:.1f} s in real time; {describe_errors(effort)}"
        )
    if writer and writer.failure:
        raise OutputError(writer.failure)
    return 0


def _within(least: float, most: float, unit: str) -> Callable[[str], float]:
    """Return a reader of numbers between two bounds."""

    def read(text: str) -> float:
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if not least <= number <= most:
            raise argparse.ArgumentTypeError(
                f"must be from {least:g} to {most:g} {unit} (got {text!r})"
            )
        return number

    return read


def _tell(line: str) -> None:
    """Print a line at once: other programs wait for the addresses."""
    print(line, flush=True)


def _summary(figures: Table) -> Iterator[str]:
    """Give the lines about a session that has ended."""
    elapsed, period, periods = figures["elapsed"], figures["period"], figures["periods"]
    shares = ", ".join(
        f"{name} {1e3 * elapsed[name]:.2f} ms" for name in ("p50", "p99", "p99.9", "longest")
    )
    missed = 100.0 * figures["missed"] / max(1, periods)
    yield (
        f"{periods} control periods of {1e3 * period:g} ms: {figures['missed']} late ({missed:.4g} %), "
        f"{figures['left_out']} of them left out; {shares}"
    )
    yield f"{figures['simulated']:.1f} s simulated since the last reset; {describe_errors(figures)}"
    counts = dict(sorted(figures["counts"].items()))
    flagged = {
        f"frames {name.replace('_', ' ')}": count for name, count in figures["flagged"].items()
    }
    for words in (flagged, counts):
        if words:
            yield ", ".join(f"{name}: {count}" for name, count in words.items())
