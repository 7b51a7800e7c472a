"""Control methods of one's own in Python: classes in memory, files, what their runs can be restored to."""

import pickle
from functools import partial
from pathlib import Path

import digiclay
import numpy as np
import pytest
from digiclay import DigiclayError

from tests.assemble import refused_in_a_line
from tests.other_process import finish, start
from tests.own_methods import PAD, Mine, forgotten, write_method
from tests.scene_files import read_text, write_text

pytestmark = pytest.mark.usefixtures("here", "no_methods")
run = partial(digiclay.run, errors=False)


def make_again():
    """Return another class of the same name, with half the parameters' effect."""

    class Other(Mine):
        def command(self, memory, cells, device):
            return memory, digiclay.Orders(height=cells.target)

    Other.__name__ = "Mine"
    return Other


def test_a_class_in_memory_runs_as_the_same_one_in_a_file(tap):
    write_method(Path())
    changes = {"control.yield_force": "20 mN"}
    mine, filed = (
        run(digiclay.scene(tap, {**changes, "control.method": method}))
        for method in (Mine, "pad.py:SoftPad")
    )
    np.testing.assert_array_equal(mine.history["height"], filed.history["height"])
    assert np.ptp(mine.history["height"]) > 1e-4
    assert mine.metrics["versions"]["method"].startswith("Mine in memory:")


def test_a_saved_run_of_a_class_in_memory_says_what_is_missing_and_is_never_reloaded_wrongly(tap):
    mine = run(digiclay.scene(tap, {"control.method": Mine}))
    with pytest.warns(
        UserWarning, match=r"^out has parameters and results of Mine, but not its code"
    ) as said:
        mine.save("out")
    assert "\n" not in str(said[0].message)
    assert not Path("out/method.py").exists()
    assert digiclay.load("out").scene == mine.scene
    other = make_again()
    digiclay.scene("tap", {"control.method": other})
    with pytest.warns(UserWarning, match="^out was not run with the code of mine that is loaded"):
        digiclay.load("out")
    np.testing.assert_array_equal(
        digiclay.run(mine.scene).history["height"], mine.history["height"]
    )
    for ask in (
        lambda scene: digiclay.scene(scene, {}),
        lambda scene: digiclay.sweep(scene, {"layout.rows": [11]}, "lag"),
    ):
        with refused_in_a_line(
            DigiclayError, "^The scene's method mine must be of the code that was loaded"
        ):
            ask(mine.scene)


def test_a_run_whose_method_is_not_loaded_keeps_its_results_and_is_not_simulated_without_it(tap):
    write_method(Path())
    scene = digiclay.scene(tap, {"control.method": "pad.py:SoftPad"})
    with forgotten():
        run(scene).save("out")
    assert read_text(Path("out/method.py")) == PAD
    code = """
import digiclay
run = digiclay.load("out")
print(run.scene.control, run.scene.method, run.metrics["method"], run.history["height"].shape)
print(run.scene)
for ask in (digiclay.run, digiclay.steps, digiclay.scene, lambda scene: run.save("copy")):
    try:
        ask(run.scene)
    except digiclay.DigiclayError as error:
        print(error)
digiclay.scene("tap", {"control.method": "out/method.py:SoftPad"})
again = digiclay.run(digiclay.load("out").scene, errors=False)
print(again.history["height"].tobytes() == run.history["height"].tobytes())
"""
    _, said, wrong = finish(start(code))
    lines = said.splitlines()
    assert lines[0] == f"None soft_pad soft_pad {digiclay.load('out').history['height'].shape}", (
        wrong
    )
    assert "method: soft_pad, which is not loaded" in said
    assert [line[:35] for line in lines[7:-1]] == ["control.method must be one of virtu"] * 4
    assert lines[-1] == "True"


def test_a_changed_file_replaces_its_method_and_scenes_of_the_former_code_keep_theirs(tap):
    path = write_method(Path())
    scene = digiclay.scene(tap, {"control.method": "pad.py:SoftPad"})
    write_text(path, PAD.replace("self.step", "0.5 * self.step"))
    changed = digiclay.scene(tap, {"control.method": "pad.py:SoftPad"})
    with refused_in_a_line(
        DigiclayError, "^The scene's method soft_pad must be of the code that was loaded"
    ):
        digiclay.scene(scene, {"layout.rows": 9})
    # A scene of the former code runs with it, and is saved with it.
    runs = [run(scene), run(changed)]
    codes = [read_text(done.save(f"run{i}") / "method.py") for i, done in enumerate(runs)]
    assert codes[0] == PAD != codes[1]
    assert len({done.metrics["versions"]["method"] for done in runs}) == 2
    assert np.abs(runs[0].history["height"] - runs[1].history["height"]).max() > 1e-5


def test_a_class_that_is_only_in_memory_is_no_value_of_another_process(tap):
    scene = digiclay.scene(tap, {"control.method": Mine})
    assert pickle.loads(pickle.dumps(scene)) == scene
    code = """
import pickle
try:
    pickle.load(open("scene", "rb"))
except Exception as error:
    print(error)
"""
    Path("scene").write_bytes(pickle.dumps(scene))
    assert finish(start(code))[1] == (
        "Mine: the class must be in a file for other processes, by its name file.py:Mine.\n"
    )


def test_a_script_defines_and_runs_its_own_method():
    text = """
import digiclay
import numpy as np

class Mine(digiclay.Method):
    def command(self, memory, cells, device):
        return memory, digiclay.Orders(height=np.where(cells.force > 0.03, cells.height - 5e-5, cells.target))

if __name__ == "__main__":
    scene = digiclay.scene("tap", {"control.method": Mine, "simulation.duration": 0.2})
    print(digiclay.run(scene, errors=False).metrics["method"])
"""
    write_text(Path("mine.py"), text)
    assert (
        finish(start("import runpy; runpy.run_path('mine.py', run_name='__main__')"))[1] == "mine\n"
    )
