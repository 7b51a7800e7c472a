"""A finger has the same force on every bed: its closed form, shares, cautions; parts of files."""

import itertools

import digiclay
import numpy as np
import pytest
from digiclay import DigiclayError
from digiclay.cli import main
from digiclay.core.session.plate import list_cautions

from tests.assemble import refused_in_a_line, table

BEDS = list(itertools.product(("aligned", "staggered", "hexagonal"), (2, 3, 4, 5, 6)))


def make_bed(arrangement, pitch, **more):
    """Return a bed that is larger than the finger; the pitch is in mm."""
    side = 2 * (12 // pitch) + 5
    plan = {
        "rows": side,
        "columns": side,
        "pitch": pitch * 1e-3,
        "arrangement": arrangement,
    }
    return digiclay.scene({"layout": plan, "control": "absent", **more})


def press_places(scene, depth):
    """Return the total force of a finger at the places of a grid over a pitch and two rows."""
    plan, low = scene.layout, scene.actuator.rest_height - depth
    x, y = (np.arange(count) / count for count in (6, 12))
    places = itertools.product(x * plan.pitch, 2.0 * y * plan.row_spacing)
    return np.array([digiclay.force(scene, (*place, low)).sum() for place in places])


@pytest.mark.parametrize("arrangement, pitch", BEDS)
def test_the_mean_force_is_that_on_a_plate_on_every_bed(arrangement, pitch):
    scene = make_bed(arrangement, pitch)
    plate = digiclay.plate_force(scene, (1e-3, 2e-3))
    # That of the bed of the paper; the share has six digits.
    wanted = digiclay.plate_force(make_bed("aligned", 3), (1e-3, 2e-3))
    np.testing.assert_allclose(plate, wanted, rtol=5e-6)
    means = [press_places(scene, depth).mean() for depth in (1e-3, 2e-3)]
    # The mean over these places has no harmonic of the lattice below the sixth; a pin enters with a kink.
    np.testing.assert_allclose(means, plate, rtol=0.01 if pitch == 6 else 0.003)


def test_the_closed_form_is_the_integral_of_the_law_and_no_multiple_of_it():
    scene = digiclay.scene({"contact": {"offset": "0.2 mm"}})
    tip, law = scene.section("fingertip"), scene.section("contact")
    for depth in (0.5e-3, 1.5e-3, 6e-3):
        inside = np.linspace(0.0, 1.0, 40_001)  # squared reduced radius; the middles of its parts
        middle = 0.5 * (inside[1:] + inside[:-1]) * min(1.0, 2.0 * depth / tip.height)
        under = depth - tip.height * (1.0 - np.sqrt(1.0 - middle))
        area = np.pi * tip.length * tip.width * min(1.0, 2.0 * depth / tip.height)
        summed = law.share / 9e-6 * area * law.tension(under).mean()
        assert digiclay.plate_force(scene, depth) == pytest.approx(summed, rel=1e-5)
    ratio = digiclay.plate_force(scene, (0.7e-3, 3.2e-3)) / law.tension(np.array((0.7e-3, 3.2e-3)))
    assert ratio[1] > 2.0 * ratio[0]
    assert digiclay.plate_force(scene, (-1.0, 0.1e-3)).tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    "ask, words",
    [
        (lambda scene: digiclay.plate_force(scene, 7e-3), "at most 0.0064 m .got 0.007 m"),
        (lambda scene: digiclay.plate_force(scene, np.nan), "must be finite"),
        (lambda scene: digiclay.plate_force(digiclay.scene("pinch_crease"), 1e-3), "must be one"),
        (lambda scene: digiclay.plate_force("tap", 1e-3), "scene must be a Scene"),
        (
            lambda scene: digiclay.plate_force(
                digiclay.scene(scene, {"fingertip": "absent"}), 1e-3
            ),
            "fingertip must be given",
        ),
        (lambda scene: digiclay.scene(scene, with_=3), "A file or folder must be a path"),
        (lambda scene: digiclay.scene(scene, with_="none.toml"), "none.toml cannot be read"),
    ],
)
def test_what_cannot_be_is_refused(ask, words):
    with refused_in_a_line(DigiclayError, words):
        ask(digiclay.scene({}))


@pytest.mark.parametrize(
    "arrangement, pitch, share, lines",
    [
        ("aligned", 3, None, []),
        ("hexagonal", 3, None, []),
        ("aligned", 4, None, ["± 1.26 % from place to place, 2 mm deep"]),
        ("aligned", 5, None, ["± 10.8 % from place to place, 2 mm deep"]),
        ("aligned", 6, None, ["mm deep"]),
        ("aligned", 7, None, ["the bed can show shapes, but cannot be sculpted"]),
        ("hexagonal", 4, None, []),
        ("aligned", 3, 0.34, []),
        ("aligned", 2, 0.34, ["contact.share 0.34 gives 2.25 of the finger's force"]),
        ("hexagonal", 3, 0.29, ["contact.share 0.29 gives 0.985 of the finger's force"]),
    ],
)
def test_what_changes_the_force_of_a_finger_is_said(arrangement, pitch, share, lines):
    scene = make_bed(arrangement, pitch, contact={"share": share} if share else {})
    found = list_cautions(scene)
    assert [one for one, line in zip(found, lines, strict=True) if line not in one] == []


def test_a_small_finger_and_a_coarse_bed_are_judged_together():
    small = digiclay.scene("tap", {"fingertip": {"length": 5e-3, "width": 4e-3, "height": 4e-3}})
    assert "coarse" in list_cautions(small)[0]
    assert (
        list_cautions(digiclay.scene("tap", {"fingertip.width": 0.1, "fingertip.length": 0.1}))
        == []
    )


def test_what_is_true_of_each_finger_is_said_once():
    bed, widths = {"layout": {"arrangement": "hexagonal"}}, (16e-3, 20e-3)
    fingers = [{"contact": {"share": 0.29}, "fingertip": {"width": width / 2}} for width in widths]
    assert len(list_cautions(digiclay.scene({**bed, "finger": fingers}))) == 1


PUSH_PULL = {"method": "push_pull"}
CREEP, ALIAS = "corrects only those near it", "they run away"


@table(
    "drive, control, words",
    {
        "gates": ({"line_lag": 1e-3}, {}, [CREEP]),
        "no method": ({"line_lag": 1e-3}, "absent", []),
        "no gates": ({}, {}, []),
        "a cycle of two periods, lines in turn": ({"policy": "round_robin"}, PUSH_PULL, [ALIAS]),
        "needed lines": ({"policy": "needed"}, PUSH_PULL, [ALIAS]),
        "pressed lines first": ({}, PUSH_PULL, []),
        "a valve per cell": ({"policy": "needed", "sections": 11}, PUSH_PULL, []),
    },
)
def test_what_a_drive_does_to_pins_is_said(drive, control, words):
    layout = {"rows": 11, "columns": 11}
    found = list_cautions(
        digiclay.scene("tap", {"layout": layout, "drive": drive, "control": control})
    )
    assert [line for line, word in zip(found, words, strict=True) if word not in line] == []


@pytest.mark.parametrize(
    "text, shares",
    [
        ('[layout]\npitch = "4 mm"', [0.34]),
        ('[layout]\narrangement = "hexagonal"', [0.29]),
        ('format = 2\n[layout]\npitch = "4 mm"', [0.604444]),
        ('format = 1\n[layout]\npitch = "4 mm"', [0.34]),
        ('[layout]\npitch = "4 mm"\n[contact]\nshare = 0.5', [0.5]),
        ('[layout]\npitch = "4 mm"\n[[finger]]\n[[finger]]\ncontact.share = 0.5', [0.34, 0.5]),
        ('[layout]\npitch = "4 mm"\n[[finger]]\n', [0.34]),
        ("[layout]\nrows = 30", [0.34]),
        ('name = "plain"', [0.34]),
    ],
)
def test_an_older_file_keeps_the_finger_that_it_meant(tmp_path, text, shares):
    path = tmp_path / "file.toml"
    path.write_text(text)
    scene = digiclay.scene(path)
    assert [finger.contact.share for finger in scene.fingers] == shares
    wider = digiclay.scene(path, {"layout.pitch": "5 mm"})
    given = [
        0.944444 if share == 0.604444 or "layout]\npitch" not in text else share for share in shares
    ]
    given = [0.29 if "hexagonal" in text else share for share in given]
    assert [finger.contact.share for finger in wider.fingers] == given


@pytest.mark.parametrize(
    "text, words",
    [
        ("[contact]\nstifness = 3", "part.toml: contact.stifness must be a known key"),
        ("[contact]\nstiffness = -3", "part.toml: contact.stiffness must be above 0"),
        ("[trajectory]\nwaypoints = []", "part.toml: trajectory must be a known key"),
        ("contact = 3", "part.toml: contact must be a section"),
        ("[contact", "part.toml, line 1: "),
        ("format = 3", "format must be 1 or 2"),
        ("format = true", "format must be 1 or 2"),
    ],
)
def test_a_file_of_parts_is_checked_as_a_scene(tmp_path, monkeypatch, capsys, text, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "part.toml").write_text(text)
    taken = ["tap", "--with", "part.toml"] if "format" not in text else ["part.toml"]
    assert main(["describe", *taken]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1


def test_a_scene_takes_parts_of_a_file_and_later_changes_come_last(tmp_path):
    path = tmp_path / "part.toml"
    path.write_text(
        'name = "mine"\nconduit = "absent"\n[contact]\nstiffness = "300 N/m"\nexponent = 1500\n'
        "[uncertainty]\nkeys = []\n"
    )
    scene = digiclay.scene("pinch_crease", {"contact.exponent": 1800}, with_=path)
    laws = [(finger.contact.stiffness, finger.contact.exponent) for finger in scene.fingers]
    assert laws == [(300.0, 1800.0)] * 2
    assert (scene.name, scene.conduit) == ("pinch_crease", None)
    assert digiclay.scene(path).section("contact").stiffness == 300.0
