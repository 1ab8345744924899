"""The stored measurements, one JSON object a line: the run, then each round trip and each death."""

from dataclasses import asdict, dataclass
from pathlib import Path

from bench.peers.death import Death
from bench.peers.round_trip import RoundTrip
from bench.rig.stored import read_rows, write_rows

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
    trips = (("trip", asdict(trip)) for trip in peers.trips)
    deaths = (("death", asdict(death)) for death in peers.deaths)
    write_rows(path, peers.run, (*trips, *deaths))


def read(path: Path = STORED) -> Peers | None:
    """Return the stored run; None if there is none."""
    stored = read_rows(path)
    if stored is None:
        return None
    run, rows = stored
    for _, fields in rows:
        fields["times_ms"] = tuple(fields["times_ms"])
    trips = (RoundTrip(**fields) for kind, fields in rows if kind == "trip")
    deaths = (Death(**fields) for kind, fields in rows if kind == "death")
    return Peers(run, tuple(trips), tuple(deaths))
