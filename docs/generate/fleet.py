"""Write the measured parts of docs/fleet.md from docs/campaign/bench_fleet*.jsonl: `python -m docs.generate.fleet`.

The parts between `<!-- NAME: generated -->` and `<!-- /NAME -->` are

    caption what the picture shows
    curve   one row for each number of robots behind a router
    soak    the promises of the long run

`--check` writes nothing and fails if a part is out of date; tests/unit/test_docs.py does the same.
"""

import sys
from pathlib import Path

from bench.fleet import CURVE, SOAK, sheet, soak_verdicts
from bench.rig.stored import origin
from bench.robots.results import read
from docs.generate import sections

DOCUMENT = Path(__file__).parents[1] / "fleet.md"


def regenerated(text: str) -> str:
    """Return the text with its generated parts updated.

    Raises:
        ValueError: a part has no place in the document.
    """
    return sections.regenerated(text, {"caption": _caption, "curve": _curve, "soak": _soak}, str(DOCUMENT))


def _caption() -> str:
    stored = read(CURVE)
    first = stored.crowds[0]
    return (
        f"*{first.seconds:.0f} s of driving and at most {first.kills} kills for each number of robots; "
        f"{sections.load_of([stored.run['machine']])} before.*"
    )


def _curve() -> str:
    stored = read(CURVE)
    return sections.markdown(sheet(stored.crowds).with_note(origin(stored.run)))


def _soak() -> str:
    stored = read(SOAK)
    found = [verdict.sentence() for one in stored.crowds for verdict in soak_verdicts(one)]
    return "\n".join(f"* {sentence}" for sentence in [*found, origin(stored.run)])


if __name__ == "__main__":
    sys.exit(sections.main("python -m docs.generate.fleet", DOCUMENT, regenerated))
