"""Documents with parts that a program writes, between `<!-- NAME: generated -->` and `<!-- /NAME -->`."""

import argparse
import re
import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from bench.rig.sheet import Sheet

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
    loads = [float(load) for machine in machines for load in re.findall(r"load average ([\d.]+)", machine)]
    least, most = min(loads), max(loads)
    return f"load average {least:.1f}" + (f" to {most:.1f}" if most > least else "")


def markdown(sheet: Sheet) -> str:
    """Return a sheet as a section."""
    return "\n".join(sheet.section("###"))


def main(program: str, document: Path, regenerate: Callable[[str], str]) -> int:
    """`python -m docs.generate.NAME [--check]`."""
    name = str(document.relative_to(ROOT))
    parser = argparse.ArgumentParser(prog=program, description=f"Update the generated parts of {name}.")
    parser.add_argument("--check", action="store_true", help="write nothing; exit 1 if out of date")
    arguments = parser.parse_args()
    before = document.read_text()
    after = regenerate(before)
    if arguments.check and after != before:
        print(f"{name} is out of date: make docs", file=sys.stderr)
        return 1
    if not arguments.check:
        document.write_text(after)
    return 0
