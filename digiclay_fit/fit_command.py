"""``digiclay fit``: parameters of a scene from measured data, with intervals, or why they cannot be known."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from digiclay import __version__
from digiclay.commands.arguments import (
    QUIET,
    add_command,
    add_options,
    add_scene,
    say,
    scene_of,
    told_as_options,
)
from digiclay.commands.progress import table as aligned
from digiclay.commands.refusals import refuse_without
from digiclay.core.base.errors import OutputError
from digiclay.core.base.quantity import list_quantities, parse
from digiclay.core.files.run_folder import Content, claim_folder, make_folder, write_whole
from digiclay.core.files.tables import Record, format_value
from digiclay.core.scene.schema import Scene
from digiclay.core.scene.toml_table import UNCERTAINTY

from . import cell, pulp
from .estimation import USELESS
from .experiment import LIMITS, Limits, Task, design
from .records import find_records, read_records
from .verdicts import Findings, fit, split_trials

EXAMPLES = """\
examples:
  digiclay fit fingertip --part pulp --holdout 3 --out finger
  digiclay fit mine.csv --part pulp --free contact,relaxation,lag --out finger
  digiclay fit valve --part cell --set actuator.bore="2 mm" --out cell
  digiclay run tap --with finger/fitted.toml
  digiclay fit --design --part pulp --max-speed "32 mm/s" --max-force "2 N" --out press

FILE is a sample's name or a CSV file: names of the columns, a row of their units, then numbers.
pulp: time, position (or indentation, or commanded), force; cell: time, command, height, perhaps load;
both perhaps trial. The folder has fit.html, fit.png and, with exit code 0, fitted.toml. Exit code 1:
NO_IMPROVEMENT on the scene, or NOT_IDENTIFIABLE.
With --design the folder has protocol.csv, which lacks the measured column, and protocol.png.
"""
#: Groups of parameters of each part, and those that are free unless others are asked for.
GROUPS = {"pulp": pulp.GROUPS, "cell": cell.GROUPS}
USUAL = {"pulp": "contact,relaxation", "cell": "lag,delay"}
#: Sections of a scene that the fitted values of a part belong to.
SECTIONS = {
    "pulp": ("fingertip", "contact", "relaxation"),
    "cell": ("actuator", "supply", "fluid", "valve", "conduit", "valve_lag", "delay"),
}
#: What those sections have of a scene, and not of device or finger.
OF_SCENE = {("contact", "share"), ("contact", "offset"), ("actuator", "rest_height")}
#: Content of the folder, columns of the table, and the exit code of a refusal.
FIT, REFUSED = Content("fit", ("fit.html", "fit.png")), 1
DESIGN = Content("design", ("protocol.csv",))
HEAD = ("parameter", "value", "95 % interval", "verdict", "most correlated with")


def add(commands: Any) -> None:
    """Add the command."""
    description = "Fit the parameters of a cell or of the pulp to measured data, with intervals."
    purpose = "fit device or finger to measured data"
    parser = add_command(commands, "fit", purpose, EXAMPLES, description, carry_out=carry_out)
    add_options(
        parser,
        {
            "files FILE": {"nargs": "*", "help": "CSV files or samples of one part"},
            "--part PART": {"choices": tuple(GROUPS), "required": True, "help": "cell or pulp"},
            "--law LAW": (("plate", "pin"), "whole finger on a plate, or on one pin", "plate"),
            "--free GROUP,...": (
                None,
                f"what is unknown: {', '.join(pulp.GROUPS)}; beside an orifice {', '.join(cell.GROUPS)}",
            ),
            "--holdout TRIAL,...": (None, "trials to predict, not to fit", ""),
            "--design": "design a measurement instead, from the scene and these limits",
            **{
                f"{_option(name)} SIZE": (None, f"design: {each.doc}; default {each.show(usual)}")
                for (name, each), usual in zip(
                    list_quantities(Limits).items(), vars(Limits()).values(), strict=True
                )
            },
            "--out DIR": (Path, "folder; default: fit", Path("fit")),
            "--overwrite": "replace an older fit",
            "--quiet": QUIET,
        },
    )
    add_scene(parser, "tap")


def read_groups(text: str | None, part: str) -> tuple[str, ...]:
    """Return the groups of parameters that are free, in their order."""
    words = [word.strip() for word in (USUAL[part] if text is None else text).split(",")]
    for word in words:
        if word not in GROUPS[part]:
            rule = f"must be of {', '.join(GROUPS[part])} for the part {part}"
            raise OutputError(f"--free {rule} (got {word[:40]!r}).")
    return tuple(name for name in GROUPS[part] if name in words)


def carry_out(arguments: Namespace) -> int:
    """Fit, judge and write; return the exit code."""
    refuse_without("digiclay fit", "fit", "scipy", "matplotlib")
    from .fit_page import draw, write_page

    part, groups = arguments.part, read_groups(arguments.free, arguments.part)
    limits = read_limits(arguments)
    scene, _ = scene_of(arguments)
    if arguments.design:
        return write_design(arguments, Task(part, scene, groups, arguments.law, limits))
    paths = [find_records(word) for word in arguments.files]
    fitted, held = split_trials(read_records(paths, part), arguments.holdout)
    with claim_folder(arguments.out, overwrite=arguments.overwrite, content=FIT):
        found = fit(part, scene, fitted, held, groups, arguments.law)
        rows, folder = list(list_rows(found)), make_folder(arguments.out)
        (folder / "fitted.toml").unlink(missing_ok=True)
        draw(found, part, folder / "fit.png")
        write_whole(folder / "fit.html", write_page(found, part, HEAD, rows).encode())
        if found.code == "OK":
            text = "\n".join(write_parts(found, part, scene, groups)) + "\n"
            write_whole(folder / "fitted.toml", text.encode())
    say(arguments, *aligned(HEAD, rows), *found.cautions, f"written to {folder}")
    if found.code != "OK":
        print(found.message, file=sys.stderr)
        return REFUSED
    say(arguments, found.message)
    return 0


def _option(name: str) -> str:
    """Return the option of a limit."""
    return f"--{name.replace('_', '-')}"


def read_limits(arguments: Namespace) -> Limits:
    """Return the limits of a design; refused where measured files are to be fitted."""
    kind, values = LIMITS[arguments.part], {}
    if arguments.design == bool(arguments.files or arguments.holdout):
        shown = "both" if arguments.design else "neither"
        raise OutputError(f"digiclay fit must have a measured FILE or --design (got {shown}).")
    for name, declared in list_quantities(kind).items():
        option, text = _option(name), getattr(arguments, name)
        if text is None:
            continue
        if not arguments.design or (name.startswith("max") and arguments.part == "cell"):
            rule = "must be with --design, and a limit of force or path with --part pulp"
            raise OutputError(f"{option} {rule} (got {text[:40]!r}).")
        try:
            values[name] = parse(text, declared.unit)
        except ValueError as error:
            raise OutputError(f"{option} {error} (got {text[:40]!r}).") from None
    with told_as_options(kind.__name__):
        return kind(**values)


def write_design(arguments: Namespace, task: Task) -> int:
    """Design a measurement and write it."""
    from .fit_page import DRIVEN, draw_protocol

    with claim_folder(arguments.out, overwrite=arguments.overwrite, content=DESIGN):
        best, plain = design(task)
        folder = make_folder(arguments.out)
        factor, unit, name = DRIVEN[task.part]
        lines = [f"time,{name}", f"s,{unit}"]
        for number, drive in enumerate(factor * best.drive):
            lines.append(f"{number * task.limits.step:.9g},{drive:.7g}")
        other = "one ramp" if task.part == "pulp" else "one step"
        write_whole(folder / "protocol.csv", ("\n".join(lines) + "\n").encode())
        draw_protocol(best, plain, task, other, folder / "protocol.png")
    widths = zip(best.derived, 100.0 * best.widths, 100.0 * plain.widths, strict=True)
    rows = [[each.key, f"± {ours:.2g} %", f"± {theirs:.2g} %"] for each, ours, theirs in widths]
    low, high = best.answer.min(), best.answer.max()
    caution = f"this pin moves from {1e3 * low:.3g} to {1e3 * high:.3g} mm, others farther"
    if task.part == "pulp":
        caution = (
            f"position 0 is the first contact; this finger is pressed with {high:.2f} N, a stiffer one may "
            f"exceed {task.limits.max_force:g} N: the machine needs a force stop"
        )
    head = ("parameter", "95 %, designed", other)
    say(arguments, *aligned(head, rows), f"caution: {caution}", f"written to {folder}")
    return 0


def list_rows(found: Findings) -> Iterator[list[str]]:
    """Give the rows of the table, as `HEAD`: values of a scene, then what belongs to the measurement."""
    made, derived = found.made, found.derived
    judged = dict(zip((each.key for each in made.model.parameters), made.judgments, strict=True))
    correlation = found.correlation
    for number, each in enumerate(derived):
        half, judgment = found.half_widths[number], judged.get(each.key)
        ends = each.value - half, each.value + half
        verdict = judgment.verdict if judgment else "follows from others"
        if half > (USELESS if each.log else USELESS * abs(each.value)):
            verdict = verdict if judgment and verdict != "bounded" else "flat"
        if judgment and verdict == "one-sided":
            ends = judgment.low, judgment.high
        value, low, high = (
            np.exp(np.clip((each.value, *ends), -700.0, 700.0)) if each.log else (each.value, *ends)
        )
        # Of a stroke the knee is judged, which has a row.
        hidden = verdict == "flat" or (verdict == "one-sided" and each.key == cell.STROKE)
        interval = "none" if hidden else f"{low:.4g} to {high:.4g}"
        other = int(np.abs(correlation[number] * (np.arange(len(derived)) != number)).argmax())
        near = f"{derived[other].key} ({correlation[number, other]:+.2f})"
        yield [
            each.key,
            f"{value:.5g} {each.unit}".strip(),
            interval,
            verdict,
            near if len(derived) > 1 else "",
        ]
    pairs = zip(made.model.parameters, made.judgments, made.free, made.widths, strict=True)
    for parameter, judgment, value, half in pairs:
        if parameter.beside:
            low, high = np.exp((judgment.low, judgment.high))
            shown = f"{low:.3g} to {high:.3g}"
            yield ["knee of the flow", f"{np.exp(value):.3g} Pa", shown, judgment.verdict, ""]
        elif not parameter.wanted:
            shown = f"{value - half:.5g} to {value + half:.5g}"
            fitted = f"{value:.5g} {parameter.unit}"
            yield [parameter.key, fitted, shown, "of the measurement", ""]


def write_parts(found: Findings, part: str, scene: Scene, groups: Sequence[str]) -> Iterator[str]:
    """Give the lines of the file of parts: what was held, what was fitted, and its uncertainty."""
    tables: dict[str, Record] = {}
    for section in SECTIONS[part]:
        content = scene.section(section)
        if content is not None and (part == "cell" or section == "fingertip" or section in groups):
            names = [name for name in vars(content) if (section, name) not in OF_SCENE]
            tables[section] = {name: getattr(content, name) for name in names if name[0] != "_"}
    for each in found.derived:
        section, name, *number = each.key.split(".")
        value = float(f"{np.exp(each.value) if each.log else each.value:.7g}")
        table = tables.setdefault(section, {})
        if number:
            values = list(table[name])
            values[int(number[0]) - 1] = value
            table[name] = values
        else:
            table[name] = value
    yield f"# Fitted by digiclay {__version__}: digiclay run SCENE --with THIS_FILE"
    yield f'description = "Fitted {part}: {found.message}"'
    for section, table in tables.items():
        yield f"\n[{section}]"
        yield from (f"{name} = {format_value(value)}" for name, value in table.items())
    yield f"\n[{UNCERTAINTY}]"
    yield f"keys = {format_value([each.key for each in found.derived])}"
    yield f"logarithms = {format_value([each.log for each in found.derived])}"
    rows = [[float(f"{value:.8g}") for value in row] for row in found.covariance]
    yield f"covariance = {format_value(rows)}"
