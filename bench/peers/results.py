"""The stored measurements, one JSON object a line: the run, then each round trip and each death."""

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

from bench.peers.death import Death
from bench.peers.round_trip import RoundTrip

STORED = Path(__file__).resolve().parents[2] / "docs/campaign/bench_peers.jsonl"


@dataclass(frozen=True)
class Peers:
    """One run of `python -m bench.peers`."""

    run: dict[str, str]
    """Command, date, machine and commit."""
    trips: tuple[RoundTrip, ...]
    deaths: tuple[Death, ...]

    @property
    def names(self) -> list[str]:
        """The kinds in their order."""
        return list(dict.fromkeys(trip.kind for trip in self.trips))


def write(peers: Peers, path: Path) -> None:
    rows: Iterable[dict[str, object]] = (
        {"row": "run", **peers.run},
        *({"row": "trip", **asdict(trip)} for trip in peers.trips),
        *({"row": "death", **asdict(death)} for death in peers.deaths),
    )
    path.write_text("".join(json.dumps(row, ensure_ascii=False) + "\n" for row in rows))


def read(path: Path = STORED) -> Peers | None:
    """Return the stored run; None if there is none."""
    if not path.exists():
        return None
    run: dict[str, str] = {}
    trips: list[RoundTrip] = []
    deaths: list[Death] = []
    for line in path.read_text().splitlines():
        row = json.loads(line)
        match row.pop("row"):
            case "trip":
                trips.append(RoundTrip(**row | {"times_ms": tuple(row["times_ms"])}))
            case "death":
                deaths.append(Death(**row | {"times_ms": tuple(row["times_ms"])}))
            case _:
                run = row
    return Peers(run, tuple(trips), tuple(deaths))
