"""Write the measured part of docs/lab.md, `stop`, which README.md has too: `python -m docs.generate.lab`.

`--check` writes nothing and fails if the part is out of date; tests/unit/test_docs.py does the same.
"""

import sys

from docs.generate import sections
from docs.generate.crash_safety import result
from docs.generate.readme import stop

DOCUMENT = sections.ROOT / "docs/lab.md"


def regenerated(text: str) -> str:
    """Return the document with its generated part updated.

    Raises:
        ValueError: the part has no place in the document.
        DeployError: a result is damaged.
    """
    return sections.regenerated(text, {"stop": lambda: stop(result("real"))}, "docs/lab.md")


if __name__ == "__main__":
    sys.exit(sections.main("python -m docs.generate.lab", DOCUMENT, regenerated))
