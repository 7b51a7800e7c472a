"""Files of older versions: scenes, kept states and takes are what they were; see tests/samples."""

import tomllib

import numpy as np
import pytest
from digiclay.core.base.quantity import list_quantities
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import load
from digiclay.core.scene.schema import LATER, SECTIONS
from digiclay.core.scene.toml_table import ABSENT, format_scene
from digiclay.core.session import snapshot
from digiclay.core.session.take import from_bytes

from tests.assemble import assert_near
from tests.renew import SAMPLES, go_on

#: m and N: other processors and versions of numpy take sums in another order. On those of the
#: samples' README all numbers are the same.
ROUNDING = 1e-11
#: The same, of forces that are some kN where a pin is driven to its stop.
RELATIVE = 1e-12
WRITTEN = sorted(
    path
    for folder in ("scenes", "states")
    for path in (SAMPLES / folder).glob("*.toml")
    if not path.name.startswith("by_hand")
)
BY_HAND = sorted(SAMPLES.glob("scenes/by_hand_*.toml"))
STATES = sorted(SAMPLES.glob("states/*.state"))
TAKES = sorted(SAMPLES.glob("takes/*.take"))


def values(scene):
    """Return a scene's values as the tables of a TOML file that spells out all that older versions know."""
    table = {name: getattr(scene, name) for name in ("name", "description", "preset")}
    for section in SECTIONS:
        part = scene.section(section)
        if part is not None:
            table[section] = {
                name: listed(value) for name, value in vars(part).items() if known(part, name)
            }
        elif section not in ("contact", "blister", *LATER):
            table[section] = ABSENT
    if scene.control is not None:
        table["control"]["method"] = scene.method
    path = scene.section("trajectory")
    points = [
        {name: listed(value) for name, value in vars(point).items()} for point in path.waypoints
    ]
    table["trajectory"] = {"interpolation": path.interpolation, "waypoints": points}
    return table


def known(part, name):
    """Tell whether an older version knows a parameter; a later one counts where it is not the default."""
    default = type(part).__dataclass_fields__[name].default
    later = list_quantities(part)[name].later or name in part.list_idle()
    return not later or getattr(part, name) != default


def listed(value):
    """Return a tuple as TOML has it."""
    return list(value) if isinstance(value, tuple) else value


def without_notes(text):
    """Return the lines of a written scene without the notes that say what the values are."""
    return [line.partition("  # ")[0] for line in text.splitlines()]


def test_there_are_samples_of_each_format():
    assert (len(WRITTEN), len(BY_HAND), len(STATES), len(TAKES)) == (30, 3, 8, 7)


@pytest.mark.parametrize("path", WRITTEN, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_a_scene_of_an_older_version_is_what_it_was_and_written_as_older_versions_read_it(path):
    text = path.read_text(encoding="utf-8")
    scene = load(path)
    assert values(scene) == tomllib.loads(text)
    assert without_notes(format_scene(scene)) == without_notes(text)


@pytest.mark.parametrize("path", BY_HAND, ids=lambda path: path.stem)
def test_a_scene_written_by_hand_still_resolves_to_the_same_values(path):
    written = values(load(path.with_name(path.name.replace("by_hand", "written"))))
    found, stated = values(load(path)), tomllib.loads(path.read_text(encoding="utf-8"))
    for section, own in stated.items():  # what is left out are defaults, which may change
        if isinstance(own, dict):
            assert {key: found[section][key] for key in own} == {
                key: written[section][key] for key in own
            }
        else:
            assert found[section] == written[section]


@pytest.mark.parametrize("path", STATES, ids=lambda path: path.stem)
def test_a_kept_state_of_an_older_version_is_what_it_was_and_the_session_goes_on_as_it_did(path):
    system, known = assemble(load(path.with_suffix(".toml"))), np.load(path.with_suffix(".npz"))
    state = snapshot.load(system, path.read_bytes())
    assert state.period == known["period"]
    np.testing.assert_array_equal(
        [state.row(index) for index in range(len(state.rows))], known["rows"]
    )
    np.testing.assert_array_equal(state.mode(), known["mode"])
    np.testing.assert_array_equal(state.aged, known["aged"])
    found = go_on(path)
    assert_near(found["height"], known["height"], ROUNDING)
    np.testing.assert_allclose(found["force"], known["force"], rtol=RELATIVE, atol=ROUNDING)
    # Its heights are taken up by another session.
    state = snapshot.transfer_heights(system, path.read_bytes())
    np.testing.assert_array_equal(state.row(0), known["carried_height"])
    np.testing.assert_array_equal(state.mode(), known["carried_mode"])


@pytest.mark.parametrize("path", TAKES, ids=lambda path: path.stem)
def test_a_take_of_an_older_version_is_played_as_it_was(path):
    take, known = from_bytes(path.read_bytes()), np.load(path.with_suffix(".npz"))
    np.testing.assert_array_equal(take.poses, known["poses"][:, None])
    assert_near(go_on(path)["height"], known["height"], ROUNDING)
