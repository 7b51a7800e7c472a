"""Sobol indices against the analytic ones of Ishigami's function, and runs without a value."""

from argparse import Namespace

import numpy as np
import pytest
from digiclay.commands.evaluation_pool import Evaluation
from digiclay.commands.stop import Stop
from digiclay.core.base.errors import DigiclayError, OutputError
from digiclay.core.scene.scene_source import find, load
from digiclay.core.studies.axes import Point

pytest.importorskip("SALib", reason="digiclay[study] is not installed")

from digiclay_study.indices import (
    compute_indices,
    count_points,
    find_excess_losses,
    make_response,
    sample_shares,
)
from digiclay_study.point_series import Range, Subject

#: Ishigami's function sin x1 + A sin² x2 + B x3⁴ sin x1 on [-π, π]³, and its indices by
#: integration.
A, B = 7.0, 0.1
BY_FIRST, BY_SECOND = 0.5 * (1.0 + B * np.pi**4 / 5.0) ** 2, A**2 / 8.0
BY_PAIR = B**2 * np.pi**8 * (1.0 / 18.0 - 1.0 / 50.0)
VARIANCE = BY_FIRST + BY_SECOND + BY_PAIR
FIRST = np.array([BY_FIRST, BY_SECOND, 0.0]) / VARIANCE
TOTAL = np.array([BY_FIRST + BY_PAIR, BY_SECOND, BY_PAIR]) / VARIANCE
ANGLES = tuple(Range(f"x.{name}", -np.pi, np.pi) for name in "abc")


def evaluate_with(task, folder, bundles):
    """Evaluate bundles in this process with a task in place of sessions."""
    here = Namespace(quiet=True, scheduler=None, workers=1)
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr(
            "digiclay.commands.evaluation_pool.evaluate_bundle", lambda bundle, **_: task(bundle)
        )
        with Evaluation(here, "study", folder, 10_000, Stop()) as evaluation:
            evaluation.finish(bundles, [one.key for one in ANGLES])
    return evaluation


def analyze_ishigami(seed, *, second):
    """Have Ishigami's function sampled and analyzed."""
    x, y, z = np.pi * (2.0 * sample_shares(128, 3, seed, second=second) - 1.0).T
    values = np.sin(x) + A * np.sin(y) ** 2 + B * z**4 * np.sin(x)
    return compute_indices(values, 3, seed, second=second)


def is_within(found, order, wanted, part=slice(None)):
    """Return whether indices are within their intervals, which are narrow enough to exclude something."""
    index, interval = (values[part] for values in found[order])
    return bool(np.all(np.abs(index - wanted) <= interval) and interval.max() < 0.45)


def test_the_indices_of_ishigami_are_within_their_intervals():
    # 95 % intervals: with these seeds each index is within its own.
    found = analyze_ishigami(1, second=True)
    assert is_within(found, "first", FIRST)
    assert is_within(found, "total", TOTAL)
    assert is_within(
        found, "second", np.array([0.0, BY_PAIR, 0.0]) / VARIANCE, np.triu_indices(3, 1)
    )
    alone = analyze_ishigami(2, second=False)
    assert list(alone) == ["first", "total"]
    assert is_within(alone, "first", FIRST)
    assert is_within(alone, "total", TOTAL)
    # What does not vary has none.
    for size in (0.0, 1e-12):
        noise = np.random.default_rng(1).normal(0.0, size, 40)
        assert compute_indices(5.0 + noise, 3, 1, second=False) is None


def test_points_that_no_worker_survives_are_told_and_tried_again(tmp_path):
    def work(bundle):
        return [{"figures": {"rfd": 1.0}} for _ in bundle]

    def die(bundle):
        if bundle[0].index == 1:
            raise DigiclayError("A worker died twice of this.")
        return work(bundle)

    points = [Point(index, ("0.5", "0.5", "0.5"), None) for index in range(1, 5)]
    bundles = [points[:2], points[2:]]
    subject = Subject(find("slow_press"), (), load(find("slow_press")), ANGLES, ("rfd",))
    with subject.open_folder(tmp_path / "out", "study", {}) as folder:
        failed = evaluate_with(die, folder, bundles).failed
        assert failed == {index: {"error": "A worker died twice of this."} for index in (1, 2)}
        assert set(folder.read_records()) == {3, 4}
        assert evaluate_with(work, folder, bundles).failed == {}
        assert set(folder.read_records()) == {1, 2, 3, 4}


def test_a_design_has_a_block_of_points_a_sample_and_depends_on_its_seed_alone():
    for second, points in ((False, 40), (True, 64)):
        shape = sample_shares(8, 3, 1, second=second).shape
        assert shape == (count_points(8, 3, second=second), 3) == (points, 3)
    one, same, other = (sample_shares(16, 2, seed, second=False) for seed in (3, 3, 4))
    assert np.array_equal(one, same)
    assert not np.array_equal(one, other)
    values = one[:, 0] + one[:, 1] ** 2
    found = [compute_indices(values, 2, seed, second=False) for seed in (3, 3, 4)]
    intervals = [indices["first"][1].tolist() for indices in found if indices is not None]
    assert intervals[0] == intervals[1] != intervals[2]


def record(rfd, loss=0.0):
    share = None if loss is None else 1.0 - loss
    return {"figures": {"rfd": rfd, "contact_loss_share": loss, "contact_share": share}}


#: Runs: two that keep the fingertip, one that failed, one without contact, one that loses the
#: fingertip.
RUNS = [
    record(0.2),
    record(0.5, 0.04),
    {"error": "no memory"},
    record(None, None),
    record(0.01, 0.3),
]


@pytest.mark.parametrize(
    "name, usual, values, counts",
    [
        ("rfd", 0.0, [0.2, 0.5, 0.5, 0.5, 0.5], (2, 1)),
        # What the unchanged scene loses is no loss.
        (
            "rfd",
            0.26,
            [0.2, 0.5, 0.5, 0.5, 0.01],
            (2, 0),
        ),
        ("contact_loss_share", 0.0, [0.0, 0.04, 0.3, 0.3, 0.3], (2, 0)),  # the loss keeps its value
        ("contact_share", 0.0, [1.0, 0.96, 0.7, 0.7, 0.7], (2, 0)),  # of which less is worse
    ],
)
def test_runs_without_a_value_or_the_fingertip_have_the_worst_of_the_others(
    name, usual, values, counts
):
    found = make_response(name, RUNS, find_excess_losses(RUNS, record(0.1, usual)))
    assert (found.values.tolist(), (found.absent, found.lost)) == (values, counts)
    runs = [record(None), {"error": "There is not enough memory."}]
    with pytest.raises(
        OutputError, match=r"has the metric rfd; the first error: There is not enough memory"
    ):
        make_response("rfd", runs, find_excess_losses(runs, record(0.1)))
