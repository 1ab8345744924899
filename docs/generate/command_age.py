"""Write the table of docs/decisions/0052-speed-follows-the-link.md: `python -m docs.generate.command_age`.

The part between `<!-- limits: generated -->` and `<!-- /limits -->` shows how often the age of the commands limits a robot. It takes a
minute, so that no test compares it.
"""

import sys
from pathlib import Path

from bench.command_age import sheet
from docs.generate import sections

DOCUMENT = Path(__file__).parents[1] / "decisions/0052-speed-follows-the-link.md"


def regenerated(text: str) -> str:
    """Return the text with its table updated.

    Raises:
        ValueError: the table has no place in the document.
    """
    return sections.regenerated(text, {"limits": lambda: sections.markdown(sheet())}, str(DOCUMENT))


if __name__ == "__main__":
    sys.exit(sections.main("python -m docs.generate.command_age", DOCUMENT, regenerated))
