"""A module is found by its name: it has one of its own, and does not repeat that of its package."""

from __future__ import annotations

from collections import Counter

from tests.unit.test_architecture import CORE, ROOT, tracked

#: Names that several modules may have, and why.
SHARED_NAMES = {
    "__init__": "the front door of a package",
    "__main__": "what `python -m` runs",
    "conftest": "where pytest looks for fixtures",
}
#: Packages whose modules are named after what others hold, and why.
NAMED_AFTER_OTHERS = {"commands": "each module is the command of its name", "plots": "what a plot shows"}


def test_no_module_has_the_name_of_its_package_or_of_another_module() -> None:
    sources = tracked("addon/*.py", "benchmarks/*.py", "digiclay_paper/*.py", "tools/*.py")
    kept = [one for one in sources if one.stem not in SHARED_NAMES]
    kept = [one for one in kept if one.parent.name not in NAMED_AFTER_OTHERS]
    counts = Counter(one.stem for one in kept)
    wrong = [one for one in kept if counts[one.stem] > 1 or one.parent.name in one.stem.split("_")]
    wrong = [one for one in wrong if CORE not in one.parents and one.stem != "relief"]
    assert sorted(str(one.relative_to(ROOT)) for one in wrong) == []
