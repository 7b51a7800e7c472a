"""A module is found by its name: it has one of its own, and does not repeat that of its package."""

from __future__ import annotations

from collections import Counter

from tests.unit.test_architecture import ROOT, tracked

#: Names that several modules may have, or that repeat their package's, and why.
ALLOWED = {
    "__init__": "the front door of a package",
    "__main__": "what `python -m` runs",
    "scene_source": "what reads a scene, from whatever source",
}
#: Packages whose modules are named after what others hold, and why.
NAMED_AFTER_OTHERS = {"commands": "each module is the command of its name", "plots": "what a plot shows"}


def test_no_module_has_the_name_of_its_package_or_of_another_module() -> None:
    beside = (
        f"{package}/*.py"
        for package in ("benchmarks", "digiclay_paper", "digiclay_serve", "digiclay_study", "tools")
    )
    sources = tracked("addon/*.py", *beside)
    kept = [one for one in sources if one.stem not in ALLOWED]
    kept = [one for one in kept if one.parent.name not in NAMED_AFTER_OTHERS]
    counts = Counter(one.stem for one in kept)
    wrong = [one for one in kept if counts[one.stem] > 1 or one.parent.name in one.stem.split("_")]
    assert sorted(str(one.relative_to(ROOT)) for one in wrong) == []
