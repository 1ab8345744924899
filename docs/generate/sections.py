"""Documents with parts that a program writes, between `<!-- NAME: generated -->` and `<!-- /NAME -->`."""

import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from bench.rig.sheet import Verdict, sentences
from bench.rig.stored import loads

ROOT = Path(__file__).parents[2]
Parts = Mapping[str, Callable[[], str]]


def regenerated(text: str, parts: Parts, document: str) -> str:
    """Return the text with its generated parts updated.

    Args:
        text: of the document.
        parts: by name.
        document: its name, for people.

    Raises:
        ValueError: a part has no place in the document.
    """
    for name, part in parts.items():
        place = re.compile(rf"(<!-- {name}: generated -->\n).*?(<!-- /{name} -->)", re.DOTALL)
        if place.search(text) is None:
            raise ValueError(f"{document} has no place for the part {name!r}")
        body = part()
        text = place.sub(lambda match, body=body: f"{match[1]}\n{body}\n\n{match[2]}", text)
    return text


def load_of(machines: Iterable[str]) -> str:
    """Return the load average, or its range, from descriptions of the machines of some runs.

    Raises:
        ValueError: no description has one.
    """
    found = [load for machine in machines for load in loads(machine)]
    least, most = min(found), max(found)
    return f"load average {least:.1f}" + (f" to {most:.1f}" if most > least else "")


def targets(verdicts: Iterable[Verdict], run: Mapping[str, str]) -> str:
    """Return a list of the targets of a run; none is judged if the machine was not idle."""
    return "\n".join(f"* {sentence}" for sentence in sentences(verdicts, run))
