"""``digiclay features``: list of the bosses and creases of a run."""

from __future__ import annotations

import argparse
import json
from typing import Any

from ..core.mesh_io.export_model import find_features
from ..core.session.finished_run import read_run
from ..core.surface.features import make_table, summarize
from ..core.surface.formed import make_formed
from .arguments import add_run, seconds
from .export import add_surface, finding_of, former_of, model_of, row_of
from .progress import table as aligned
from .stop import require_surface

EXAMPLES = """\
examples:
  digiclay features ridge_mound_valley
  digiclay features ridge_mound_valley --time 13.3 --former 10.3 --threshold "1 mm"
  digiclay features ridge_mound_valley --json > features.json

Areas are in plan, lengths of crests in space. --json writes SI units, with the pins of each feature and the
points of its crests.
"""


def add(commands: Any) -> None:
    """Add the command."""
    parser = add_run(commands, "features", "list the bosses and creases of a run", EXAMPLES)
    add_surface(parser)
    parser.add_argument("--time", metavar="T", type=seconds, help="instant, s; default: the end")
    parser.add_argument("--json", action="store_true", help="write JSON")
    parser.set_defaults(carry_out=carry_out)


def carry_out(arguments: argparse.Namespace) -> int:
    """List the features."""
    run = read_run(arguments.run, "height", "position", "force", "mode")
    require_surface(run.scene, "features")
    formed = make_formed(run.history, row_of(run, arguments.time), former_of(run, arguments.former))
    found = find_features(formed, model_of(arguments, run.scene, "surface"), finding_of(arguments))
    if arguments.quiet:
        return 0
    if arguments.json:
        print(json.dumps([one.figures() for one in found], indent=1))
        return 0
    print(summarize(found))
    if found:
        head, *rows = make_table(found)
        print("\n".join(aligned(head, rows)))
    return 0
