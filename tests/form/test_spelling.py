"""Words: American spelling in code, texts and pages; names of modules that lead to one file."""

import re
from collections import Counter

from tests.form.test_architecture import ROOT, tracked
from tests.scene_files import read_text

BRITISH = re.compile(
    r"colour|behaviour|neighbour|favour|honour|vapour|centre|centring|fibre|litre|metre|grey|licence|defence"
    r"|travell(ed|ing)|labell(ed|ing)|modell(ed|ing)|signall(ed|ing)|catalogue|programme\b|artefact|judgement"
    r"|ageing|aluminium|plough|mould"
    r"|(quant|normal|initial|organ|optim|minim|maxim|recogn|summar|visual|special|random|real|general"
    r"|character|synchron|emphas|util|stabil|serial)is(e|es|ed|ing|ation)\b|analys(e|ed|ing)\b",
    re.IGNORECASE,
)
#: German, what former releases wrote (the samples too), and this file, which has the words
#: themselves.
UNREAD = ("de.toml", "CHANGELOG.md", "test_spelling.py")
#: Names in files, which stay what they are.
READ = re.compile(r'\bcentring_time\b|"(--)?colour"|"Colour by Force"|"Top Colour at \(N\)"')
#: Modules that may have the name of another or of their package, and why.
ALLOWED = {
    "__init__": "the front door of a package",
    "__main__": "what `python -m` runs",
    "live_session": "the kind of session that Blender and the server have",
    "scene_source": "what reads a scene, from whatever source",
}
#: Packages whose modules are named after what others contain, and why.
NAMED_AFTER_OTHERS = {
    "commands": "each module is the command of its name",
    "plots": "what a plot shows",
}


def test_no_word_is_spelled_the_british_way() -> None:
    files = [
        path
        for path in tracked("*.py", "*.md", "*.toml", "*.txt")
        if ROOT / "tests" / "samples" not in path.parents and path.name not in UNREAD
    ]
    texts = {str(path.relative_to(ROOT)): READ.sub("", read_text(path)) for path in files}
    found = {
        name: [match.group() for match in BRITISH.finditer(text)] for name, text in texts.items()
    }
    assert {name: words for name, words in found.items() if words} == {}


def test_no_module_has_the_name_of_its_package_or_of_another_module() -> None:
    beside = ("benchmarks", "tools", *(path.name for path in ROOT.glob("digiclay_*")))
    modules = [
        path
        for path in tracked("addon/*.py", *(f"{name}/*.py" for name in beside))
        if path.stem not in ALLOWED and path.parent.name not in NAMED_AFTER_OTHERS
    ]
    counts = Counter(path.stem for path in modules)
    wrong = [
        path
        for path in modules
        if counts[path.stem] > 1 or path.parent.name in path.stem.split("_")
    ]
    assert sorted(str(path.relative_to(ROOT)) for path in wrong) == []
