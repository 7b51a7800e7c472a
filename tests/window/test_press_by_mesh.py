"""A mesh is dragged into the bed with Blender's own G, live, as a user does."""

import numpy as np

PLAYED = {"script": "press_by_mesh.py"}


def test_a_dragged_mesh_presses_the_bed_while_it_is_dragged(seen):
    assert seen["added"] == ["FINISHED"]
    lowest = [seen[f"pressing {step}"]["heights"][0] for step in range(1, 7)]
    assert (np.diff(lowest[1:]) < 0.0).all()
    assert seen["pressed"]["force"] > 0.5
    assert not any(seen[name]["waits"] for name in ("pressed", "lifted", "rewound"))
    assert (seen["lifted"]["force"], seen["lifted"]["gestures"]) == (0.0, 1)
    # What was pressed stays, by 0.1 mm, until the gesture is taken back.
    assert abs(seen["lifted"]["heights"][0] - lowest[-1]) < 1e-4
    assert seen["rewound"]["heights"][0] > 39.9e-3
    assert seen["stopped"]["sessions"] == 0


def test_a_session_is_started_and_goes_on_in_pose_mode_of_an_armature_that_moves_the_mesh(seen):
    assert seen["mode"] == "POSE"
    assert (seen["posed"]["sessions"], seen["posed"]["waits"]) == (1, "")
    assert seen["posed"]["heights"][0] < 38e-3
    assert seen["left"]["sessions"] == 0
