"""Sections through the session's relief, on surfaces whose shape is known."""

from __future__ import annotations

import numpy as np
import pytest
from digiclay.core.base.modes import Mode
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import Setting, find, load
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session.run_scene import Result
from numpy.typing import NDArray

from digiclay_paper.evidence import relief
from digiclay_paper.relief_sections import LIMITS, asked_for, blister_section, sections
from digiclay_paper.results import SESSION, Results, Session
from digiclay_paper.scenes import METHODS

Floats = NDArray[np.float64]
REST, RIDGE, MOUND, VALLEY = 40e-3, 13.5e-3, 23e-3, -10e-3


def session(method: str, followers: int) -> Session:
    """Return the paper's session as if the bed were still at rest, the finger a row every 5 ms."""
    scene = load(find(SESSION), [Setting("control.method", method)])
    drag, line = np.linspace(-21e-3, 21e-3, 43), np.ones(43)
    lift = np.linspace(RIDGE, MOUND, 11)
    tip = np.zeros((97, 7))
    tip[:, 0] = np.concatenate([drag, np.full(11, 21e-3), drag])
    tip[:, 1] = np.concatenate([-21e-3 * line, np.full(11, -21e-3), 21e-3 * line])
    tip[:, 2] = REST + np.concatenate([RIDGE * line, lift, VALLEY * line])
    place = assemble(scene).grid.positions
    history = {
        "total_force": np.full(97, 0.4), "set_point": np.full(97, 0.4), "following": np.full(97, followers),
        "fingertip": tip, "position": place, "height": np.full((1, len(place)), REST),
    }  # fmt: skip
    return Session(scene, history, {}, {}, [], 0.0, {})


def formed(bare: Session, over: Floats) -> Session:
    """Return the session with another final surface, heights over the bed at rest."""
    return bare._replace(history={**bare.history, "height": (REST + over)[None]})


@pytest.fixture(scope="module", params=[(METHODS[0], 8), (METHODS[1], 16)], ids=METHODS)
def bare(request: pytest.FixtureRequest) -> Session:
    """A session of each method, its bed at rest."""
    return session(*request.param)


def at(bare: Session, x: float, y: float) -> NDArray[np.bool_]:
    """Tell which cells are within half a pitch of a place, mm."""
    place: NDArray[np.bool_] = np.hypot(*(bare.history["position"] - (1e-3 * x, 1e-3 * y)).T) < 1.5e-3
    return place


def test_asked_for_is_the_blister_carried_along_the_path(bare: Session) -> None:
    asked = asked_for(bare)
    heights = [float(asked[at(bare, *spot)][0]) for spot in ((0, -21), (21, -21), (0, 21), (0, 0))]
    assert heights == pytest.approx([RIDGE, MOUND, VALLEY, 0.0], abs=1e-12)  # rounding


def test_the_flank_asked_for_is_that_of_the_method_s_own_profile() -> None:
    # 12 mm beside the ridge. Method I: flat to 6, down at 15 mm. Method II: flat to 3, down at 12 mm
    # from the outermost cell under the finger; a disc of 16 cells reaches 3 (sqrt(16/pi) - 0.5) mm.
    reach = 3.0 * (np.sqrt(16.0 / np.pi) - 0.5)
    for method, count, share in ((METHODS[0], 8, 3.0 / 9.0), (METHODS[1], 16, reach / 9.0)):
        one = session(method, count)
        assert asked_for(one)[at(one, 0, -9)][0] == pytest.approx(RIDGE * share, rel=1e-9)


def missed(bare: Session, over: Floats) -> list[str]:
    """Return the names of the sections that do not meet the limits."""
    return [one.name for one in sections(formed(bare, over)) if not one.meets(LIMITS)]


def test_the_relief_asked_for_meets_the_limits_in_every_section_and_less_of_it_in_none(bare: Session) -> None:
    found = list(sections(formed(bare, asked_for(bare))))
    assert len(found) == 6
    assert missed(bare, asked_for(bare)) == []
    assert max(one.largest for one in found) < 1e-12
    for share in (0.0, 0.5):
        assert missed(bare, share * asked_for(bare)) == [one.name for one in found]
    # Pins that press into the finger everywhere alike keep the shape.
    assert missed(bare, 1.1 * asked_for(bare)) == []
    levels = {one.part: one.level for one in sections(formed(bare, 1.1 * asked_for(bare)))}
    assert levels == pytest.approx({"ridge": 1.35e-3, "mound": 2.3e-3, "valley": 1e-3}, rel=1e-9)


def test_a_raised_rim_is_no_mound_and_a_crease_with_a_hump_no_valley(bare: Session) -> None:
    mound = ["along ridge and mound", "across the mound", "slantwise across the mound"]
    # What Method II leaves: arms along the bed's sides, their ends higher than the middle.
    over, place = asked_for(bare), bare.history["position"] - (21e-3, -21e-3)
    near, arms = np.hypot(*place.T) < 12e-3, np.abs(place).min(axis=1) < 2e-3
    over[near & ~arms] = RIDGE
    over[near & arms & (np.hypot(*place.T) > 5e-3)] = MOUND + 4.5e-3
    assert set(mound) <= set(missed(bare, over))
    # A rim alone fails however small the deviation is on the whole.
    over = asked_for(bare)
    over[at(bare, 15, -21)] = MOUND + 1.5e-3
    (one,) = (one for one in sections(formed(bare, over)) if one.name == mound[0])
    assert (one.rms < LIMITS.rms * one.relief, one.largest < LIMITS.largest * one.relief) == (True, True)
    assert not one.meets(LIMITS)
    # 9 mm to the left of the mound's middle and 3 mm off the ridge, where no section goes.
    over = asked_for(bare)
    over[at(bare, 12, -24)] = MOUND + 1.5e-3
    assert missed(bare, over) == mound
    (across,) = (one for one in sections(formed(bare, over)) if one.name == mound[1])
    assert across.pins == pytest.approx(1.5e-3, rel=1e-9)
    over = asked_for(bare)
    over[at(bare, 12, 21)] = -4e-3
    assert "along the valley" in missed(bare, over)


def blister(method: str, rim: float, sign: float) -> Result:
    """Return a blister 15 mm high or deep under the finger, cells on its flat top `rim` beyond it."""
    scene = resolve({"control": {"method": method}, "layout": {"rows": 17, "columns": 17}})
    place = assemble(scene).grid.positions
    away = np.hypot(*place.T)
    mode = np.where(away < 4.3e-3, Mode.FORCE_FOLLOW, Mode.BLISTER)[None]
    reach = 3e-3 * (np.sqrt(9.0 / np.pi) - 0.5) if method == METHODS[1] else 0.0
    assert scene.blister is not None
    flat, wide = scene.blister.flat_radius, scene.blister.radius
    over = 15e-3 * np.clip((wide - (away - reach)) / (wide - flat), 0.0, 1.0)
    over[(away > 2e-3) & (away < 4e-3)] += rim
    tip = np.array([[0.0, 0.0, REST + sign * 13.5e-3, 1.0, 0.0, 0.0, 0.0]])
    history = {"height": (REST + sign * over)[None], "position": place, "fingertip": tip, "mode": mode}
    return Result(scene, history, 1, 1.0, {})


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["convex", "concave"])
def test_a_blister_with_a_rim_is_not_the_one_asked_for(method: str, sign: float) -> None:
    even, rimmed = (blister_section(blister(method, rim, sign)) for rim in (0.0, 2e-3))
    assert even.meets(LIMITS)
    assert (even.rms, even.level, even.middle) == pytest.approx((0.0, 1.5e-3, 13.5e-3), abs=1e-12)
    assert rimmed.rim == pytest.approx(2e-3, rel=1e-9)
    assert not rimmed.meets(LIMITS)


def test_the_claim_names_the_sections_that_are_missed() -> None:
    one, two = session(METHODS[0], 8), session(METHODS[1], 16)
    over = asked_for(two)
    over[at(two, 12, 21)] = -4e-3
    claim = relief(Results(session={METHODS[0]: formed(one, asked_for(one)), METHODS[1]: formed(two, over)}))
    assert claim.verdict == "holds in part"
    assert "Method II misses along the valley:" in claim.why
    both = {METHODS[0]: formed(one, asked_for(one)), METHODS[1]: formed(two, asked_for(two))}
    assert relief(Results(session=both)).verdict == "holds"
