"""``paper.md``: figures, claims, and Method II's transitions as a table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from digiclay.core.base.modes import MEANINGS, Mode
from digiclay.core.control.transitions import BY_FORCE, BY_PLACE, VIRTUAL_SPRING, Arrow

from .claim import Claim
from .method_three import compare_methods
from .results import Results

#: The chain of Fig. 3, from the finger to the pins.
CHAIN = (
    ("VM Locate", "centroid of the forces within r_VM of the master's last place (equation 13)"),
    ("VM Control", "virtual spring until the force reaches F_trig, then force control to F_ref"),
    ("VM Model", "a cylinder and valve like a real cell's turn the effort into the master's height"),
    ("Blister Creation", "edge + profile(r) (master - edge) for the cells around; cells left behind freeze"),
    ("Cells", "proportional control of height, K_p"),
)


def page(results: Results, found: list[Claim], pictures: Mapping[str, str], took: float, version: str) -> str:
    """Return the page.

    `pictures`: name of the files, without an ending, to caption; `took`: time of all simulations, s.
    """
    return "\n".join(_lines(results, found, pictures, took, version)) + "\n"


def _lines(
    results: Results, found: list[Claim], pictures: Mapping[str, str], took: float, version: str
) -> Iterator[str]:
    yield "# The paper's results, and ours\n"
    yield (
        "After Askins and Book, *Digital Clay: User Interaction Model for Control of a Fluidically Actuated "
        "Haptics Device* (Georgia Tech, 2003). What stands under *Measured here* and *Remarks* was measured "
        f"by the run that wrote this page: `digiclay paper`, digiclay {version}, {took:.0f} s of simulation. "
        "What a metric means: docs/metrics.md.\n"
    )
    yield (
        f"A finger counts as followed when {results.criterion}. The paper's own limits are not known to this "
        "project. These are a pitch, and half of Method I's set point. Method II's set point is F_ref times "
        "the cells that follow at the moment.\n"
    )
    yield "## Claims\n"
    yield "| The paper | Measured here | | Remarks |"
    yield "| --- | --- | --- | --- |"
    for claim in found:
        measured = claim.measured.replace("; ", ";<br>")
        yield f"| {claim.printed} | {measured} | **{claim.verdict}** | {claim.why} |"
    yield "\n## Figures\n"
    for name, caption in pictures.items():
        yield f"![{caption}]({name}.svg)\n"
        yield f"*{caption}.* [Data]({name}.csv)\n"
    yield "Fig. 7, pins, forces and modes in motion, is the view in Blender.\n"
    if results.third is not None:
        yield "## Method III\n"
        yield (
            "The paper's conclusion asks for regional height *and* force commands; docs/hybrid.md derives "
            "this method. The session is the one of Fig. 10, and the figures above show it beside the other "
            "two. At rest its blister is as wide as its skirt, for drags to come; what stays behind is the "
            "nominal blister (Fig. 6). JND: just noticeable differences, docs/perception.md.\n"
        )
        yield from compare_methods(results.compared())
        yield ""
    yield "## Fig. 3: Method I, the virtual master\n"
    yield "| Stage | What it does |"
    yield "| --- | --- |"
    for stage, what in CHAIN:
        yield f"| {stage} | {what} |"
    yield "\n## Fig. 5: Method II, the states of a cell\n"
    yield "Made from the table the controller itself follows. *Virtual spring* stands for: " + (
        "; ".join(f"{_word(mode)} ({MEANINGS[mode]})" for mode in VIRTUAL_SPRING) + ".\n"
    )
    yield "| From | To | When | Decided by |"
    yield "| --- | --- | --- | --- |"
    for arrows, by in ((BY_FORCE, "its own force"), (BY_PLACE, "the nearest cell under the finger")):
        for arrow in arrows:
            yield _row(arrow, by)


def _row(arrow: Arrow, by: str) -> str:
    """Return an arrow as a row of the table."""
    source = list(arrow.source)
    if set(VIRTUAL_SPRING) <= set(source):
        words = ["virtual spring", *(_word(mode) for mode in source if mode not in VIRTUAL_SPRING)]
    else:
        words = [_word(mode) for mode in source]
    return f"| {', '.join(words)} | {_word(arrow.goal)} | {arrow.condition.replace('_', ' ')} | {by} |"


def _word(mode: Mode) -> str:
    return mode.name.lower().replace("_", " ")
