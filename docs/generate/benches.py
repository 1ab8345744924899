"""Write the measured parts of docs/bench.md, fleet.md and link.md from docs/campaign/bench*.jsonl.

bench.md  targets and tables of `make bench`, `make bench-peers` and `make bench-robots`
fleet.md  robots behind a router (curve), the same for ten minutes (soak), and what the picture shows (caption)
link.md   the targets (answer); false stops an hour, worst age and lost links, and the rounds (tables)
"""

from dataclasses import replace
from pathlib import Path

from bench.__main__ import PARTS as BENCHES
from bench.link import results as link
from bench.peers import results as peers
from bench.rig.stored import FOLDER, origin, read_rows
from bench.robots import results as robots
from docs.generate import sections

BENCH = FOLDER / "bench.jsonl"


def _bench() -> str:
    stored = read_rows(BENCH)
    found = {name: (part, stored.of(name, part.row)) for name, part in BENCHES.items()}
    verdicts = [one for part, rows in found.values() for one in part.verdicts(rows)]
    tables = [part.sheet(rows).markdown for part, rows in found.values()]
    return "\n\n".join([sections.targets(verdicts, stored.run), origin(stored.run), *tables])


def _peers() -> str:
    stored = peers.read()
    targets = sections.targets(peers.verdicts(stored), stored.run)
    return "\n\n".join([targets, *(sheet.markdown for sheet in peers.sheets(stored))])


def _robots(path: Path) -> str:
    return robots.sheet(robots.read(path)).markdown


def _caption() -> str:
    stored = robots.read(robots.ROUTER)
    first = stored.crowds[0]
    return (
        f"*{first.seconds:.0f} s of driving and at most {first.kills} kills for each number of robots; "
        f"{sections.load_of([stored.run['machine']])} before.*"
    )


def _soak() -> str:
    stored = robots.read(robots.SOAK)
    verdicts = [one for crowd in stored.crowds for one in robots.promises(crowd)]
    table = robots.sheet(stored)
    # The notes are those of the curve; the last one is the origin of the run.
    return f"{sections.targets(verdicts, stored.run)}\n\n{replace(table, notes=table.notes[-1:]).markdown}"


def _answer() -> str:
    results = link.read()
    return sections.targets(link.verdicts(results), results.run)


BENCH_PARTS: sections.Parts = {
    "bench": _bench,
    "peers": _peers,
    "robots": lambda: _robots(robots.STORED),
}
FLEET_PARTS: sections.Parts = {
    "caption": _caption,
    "curve": lambda: _robots(robots.ROUTER),
    "soak": _soak,
}
LINK_PARTS: sections.Parts = {
    "answer": _answer,
    "tables": lambda: "\n\n".join(sheet.markdown for sheet in link.sheets(link.read())),
}
