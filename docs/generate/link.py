"""Write the measured parts of docs/link.md from docs/campaign/bench_link.jsonl: `python -m docs.generate.link`.

The parts between `<!-- NAME: generated -->` and `<!-- /NAME -->` are

    answer   the targets, and what was measured
    tables   false stops an hour, worst age and lost links: loss × round trip × link; and the rounds

`--check` writes nothing and fails if a part is out of date; tests/unit/test_docs.py does the same.
"""

import sys
from pathlib import Path

from bench.link.results import Results, read, sheets, verdicts
from docs.generate import sections

DOCUMENT = Path(__file__).parents[1] / "link.md"
NONE = "Not measured yet: `make bench-link`."


def regenerated(text: str) -> str:
    """Return the text with its generated parts updated.

    Raises:
        ValueError: a part has no place in the document.
    """
    results = read()
    parts = {"answer": lambda: _answer(results), "tables": lambda: _tables(results)}
    return sections.regenerated(text, parts, str(DOCUMENT))


def _answer(results: Results | None) -> str:
    found = [] if results is None else verdicts(results)
    return "\n".join(f"* {one.sentence()}" for one in found) or NONE


def _tables(results: Results | None) -> str:
    return NONE if results is None else "\n\n".join(sections.markdown(one) for one in sheets(results))


if __name__ == "__main__":
    sys.exit(sections.main("python -m docs.generate.link", DOCUMENT, regenerated))
