"""The claims on runs with one thing changed, on results made by hand; and a figure's letters and data."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from digiclay.core.scene.toml_table import resolve
from digiclay.core.studies.speed_limits import Follows
from digiclay.plots.figure import canvas, save

from digiclay_paper.claims_variants import ahead, escape, gaussian, radius, rise, staggered
from digiclay_paper.panel import COLUMNS, NAMED, curves, letter, table
from digiclay_paper.results import AS_IT_IS, Dragged, Located, Results, Session, Swing
from digiclay_paper.scenes import METHODS
from digiclay_paper.variants import GAUSSIAN, NO_RISE, STAGGERED, located

SURFACE = "in the surface"
GOOD = Follows(speed=15e-3, losses=0, loss_share=0.0, lag=1e-3, rfd=0.02)
EASY = Dragged(GOOD, force=0.4, deviation=0.02, followers=10.0, unevenness=1e-4, ahead=-1e-3)
HARD = EASY._replace(force=0.8, follows=replace(GOOD, rfd=0.08))
BAD = EASY._replace(follows=replace(GOOD, lag=5e-3))


def dragged(**found: Dragged) -> dict[tuple[str, str, str], Dragged]:
    """Return drags in the surface, by variant ("it": as it is) and method ("I", "II")."""
    variants = {"it": AS_IT_IS, "rise": NO_RISE, "staggered": STAGGERED, "gaussian": GAUSSIAN}
    keys = (name.split("_") for name in found)
    known = [(variants[what], METHODS[len(which) - 1], SURFACE) for what, which in keys]
    return dict(zip(known, found.values(), strict=True))


def swing(gain: float, amplitude: float) -> Swing:
    """Return a hold that swings if the force's amplitude is above the least that counts."""
    return Swing(gain, 500.0, amplitude, 60.0, None)


def two_methods() -> dict[str, Session]:
    """Return sessions of which only the scenes count."""
    return {
        method: Session(resolve({"control": {"method": method}}), {}, {}, {}, [], 0.0, {})
        for method in METHODS
    }


def test_a_rise_that_raises_force_and_rfd_causes_them() -> None:
    claim = rise(Results(dragged=dragged(it_II=HARD, rise_II=EASY)))
    assert claim.verdict == "holds"
    assert "0.80 N with the rise and 0.40 N without" in claim.measured


def test_a_rise_that_changes_nothing_causes_nothing() -> None:
    assert rise(Results(dragged=dragged(it_II=HARD, rise_II=HARD))).verdict == "differs"
    louder = HARD._replace(force=0.4)
    assert rise(Results(dragged=dragged(it_II=louder, rise_II=EASY))).verdict == "holds in part"


def test_cells_ahead_that_stay_up_are_not_lowered() -> None:
    assert ahead(Results(dragged=dragged(it_I=EASY))).verdict == "holds"
    stays = EASY._replace(ahead=-0.4e-3)  # less than a tenth of 4.5 mm
    assert ahead(Results(dragged=dragged(it_I=stays, it_II=EASY))).verdict == "differs"
    assert ahead(Results(dragged=dragged(it_I=EASY._replace(ahead=None)))).verdict == "differs"
    shallow = {(AS_IT_IS, METHODS[0], "less deep"): EASY._replace(ahead=0.0)}
    assert ahead(Results(dragged=dragged(it_I=EASY) | shallow)).verdict == "holds in part"


def test_a_method_that_swings_at_some_gain_has_not_escaped() -> None:
    calm = Results(cell_swings=[swing(15.0, 0.001), swing(50.0, 0.002)], printed=two_methods())
    assert escape(calm).verdict == "holds"
    wild = Results(cell_swings=[swing(15.0, 0.001), swing(90.0, 0.4)], printed=two_methods())
    assert escape(wild).verdict == "holds in part"
    assert "above 15, at 90 1/N, 6.0 times that" in escape(wild).why


@pytest.mark.parametrize(
    ("near", "known", "verdict"),
    [(0.1, 0.1, "holds"), (0.1, 0.2, "holds in part"), (0.2, 0.3, "differs"), (None, 0.2, "differs")],
)
def test_a_search_radius_has_to_halve_the_scatter_with_and_without_thresholds(
    near: float | None, known: float, verdict: str
) -> None:
    found = [
        Located(1e-3, 8e-3, False, near, 7), Located(1e-3, 1.0, False, 0.3, 0),
        Located(1e-3, 8e-3, True, known, 0), Located(1e-3, 1.0, True, 0.3, 0),
    ]  # fmt: skip
    claim = radius(Results(located=found))
    assert claim.verdict == verdict
    assert claim.why.endswith("lost with and without the radius: 1 mN, no such thresholds: 7 and 0 times.")


def test_without_noise_the_finger_is_located_where_it_is_held() -> None:
    one = located(0.0, None, thresholds=True)
    assert (one.radius, one.losses) == (8e-3, 0)
    assert one.scatter == pytest.approx(0.0, abs=1e-9)  # rounding in places of millimeters, and far below one


def test_a_search_radius_lowers_the_scatter_of_noisy_sensors_and_thresholds_do_as_well() -> None:
    near, everywhere = (located(1e-3, one, thresholds=False).scatter for one in (None, 1.0))
    known = located(1e-3, 1.0, thresholds=True).scatter
    assert near is not None
    assert everywhere is not None
    assert known is not None
    # Noise of the 61 cells in reach, or of the 21 within 8 mm, with arms in proportion: 0.18 and 0.06 mm.
    assert 0.0 < near < 0.5 * everywhere
    assert 0.0 < known < 0.5 * everywhere


@pytest.mark.parametrize(("claim", "called"), [(staggered, "staggered"), (gaussian, "gaussian")])
def test_a_variant_holds_where_it_is_followed_as_the_scene_is(claim: object, called: str) -> None:
    assert callable(claim)
    same = dragged(**{"it_I": EASY, "it_II": BAD, f"{called}_I": EASY, f"{called}_II": BAD})
    assert claim(Results(dragged=same)).verdict == "holds"  # what fails anyway says nothing of the variant
    worse = dragged(**{"it_I": EASY, "it_II": EASY, f"{called}_I": EASY, f"{called}_II": BAD})
    found = claim(Results(dragged=worse))
    assert found.verdict == "holds in part"
    assert "Not so: Method II, in the surface." in found.why
    assert claim(Results(dragged=dragged(**{"it_I": BAD, f"{called}_I": BAD}))).verdict == "differs"


def test_panels_are_lettered_and_their_named_curves_are_the_data(tmp_path: Path) -> None:
    with canvas(6.0, 3.0) as (figure, place):
        one, two = place("one", 0.5, 0.5, 2.0, 2.0), place("two", 3.5, 0.5, 2.0, 2.0)
        one.plot([1.0, 2.0], [3.0, np.nan], label="$K_f$ low")
        one.plot([1.0], [9.0])
        one.axhline(0.5, label="limit")
        one.set(title="left", xlabel="time (s)", ylabel="force (N)")
        two.plot([4.0], [1.0 / 3.0], label="b")
    letter(figure)
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["(a) left", "(b)"]
    rows = list(curves(figure))
    # No unnamed curve, no line across the panel, nothing that is no number.
    assert rows == [
        ("a", "K_f low", 1.0, "time (s)", 3.0, "force (N)"), ("b", "b", 4.0, "", pytest.approx(1 / 3), "")
    ]  # fmt: skip
    lines = table(rows).splitlines()
    assert lines == [",".join(COLUMNS), "a,K_f low,1,time (s),3,force (N)", "b,b,4,,0.333333,"]


def test_the_data_of_named_places_have_their_names_and_shared_axes_their_label() -> None:
    with canvas(6.0, 3.0) as (figure, place):
        one, two = place("one", 0.5, 0.5, 2.0, 2.0), place("two", 3.5, 0.5, 2.0, 2.0)
        one.plot([-0.0, 2.0], [0.1, -0.9], label="force")
        one.set_yticks([0.0, -1.0], ["in the surface", "a valley"])
        one.set_gid(NAMED)
        two.plot([0.0], [5.0], label="b")
        one.set(xlim=(0.0, 3.0))
        two.set(xlim=(0.0, 3.0), xlabel="force (N)")
    letter(figure)
    assert table(curves(figure)).splitlines()[1:] == [
        "a,force,0,force (N),in the surface,", "a,force,2,force (N),a valley,", "b,b,0,force (N),5,"
    ]  # fmt: skip


def test_a_vector_file_is_the_same_every_time(tmp_path: Path) -> None:
    files = []
    for name in ("one.svg", "two.svg"):
        with canvas(3.0, 2.0, "title") as (figure, place):
            place("a", 0.5, 0.5, 2.0, 1.0).plot([0.0, 1.0], [0.0, 1.0])
        files.append(save(figure, tmp_path / name).read_bytes())
    assert files[0].startswith(b"<?xml")
    assert files[0] == files[1]
