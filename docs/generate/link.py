"""Write the measured parts of docs/link.md from docs/campaign/bench_link.jsonl: `python -m docs.generate.link`.

The parts between `<!-- NAME: generated -->` and `<!-- /NAME -->` are

    answer   the targets, and what was measured
    tables   false stops an hour, worst age and lost links: loss × round trip × link; and the rounds

`--check` writes nothing and fails if a part is out of date; tests/unit/test_docs.py does the same.
"""

import sys
from pathlib import Path

from bench.link.results import read, sheets, verdicts
from docs.generate import sections

DOCUMENT = Path(__file__).parents[1] / "link.md"


def regenerated(text: str) -> str:
    """Return the text with its generated parts updated.

    Raises:
        ValueError: a part has no place in the document.
    """
    results = read()
    parts = {
        "answer": lambda: "\n".join(f"* {one.sentence()}" for one in verdicts(results)),
        "tables": lambda: "\n\n".join(map(sections.markdown, sheets(results))),
    }
    return sections.regenerated(text, parts, str(DOCUMENT))


if __name__ == "__main__":
    sys.exit(sections.main("python -m docs.generate.link", DOCUMENT, regenerated))
