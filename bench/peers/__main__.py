"""`python -m bench.peers`: compare the supervisor with bare relays of other transports. Always exit 0 unless one fails."""

import argparse
import sys

from bench.peers import death, round_trip
from bench.peers.kinds import REFERENCE, Kind, kinds
from bench.peers.results import Peers, write
from bench.peers.table import sheets, verdicts
from bench.rig.options import count, failing_in_a_sentence, output_file
from bench.rig.sheet import show
from bench.rig.stored import this_run

ROUNDS, COUNT, KILLS = 5, 40, 20


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m bench.peers",
        description="Measure the round trip of a command and the time from a SIGKILL to its notice, through the supervisor and "
        "through bare relays over Zenoh, MQTT, CycloneDDS, rclpy and TCP, interleaved. Takes about four minutes.",
        epilog="exit code: 0, even if a target is missed; 1 if a process fails; 130 after Ctrl-C",
    )
    parser.add_argument(
        "--rounds", type=count, default=ROUNDS, help="number of rounds (default: %(default)s)"
    )
    parser.add_argument(
        "--count", type=count, default=COUNT, help="commands per kind, rate and round (default: %(default)s)"
    )
    parser.add_argument(
        "--kills", type=count, default=KILLS, help="kills per kind and round (default: %(default)s)"
    )
    parser.add_argument("--json", type=output_file, metavar="FILE", help="write all times as JSON lines")
    options = parser.parse_args()

    present: list[Kind] = []
    for number, kind in enumerate(kinds()):
        missing = kind.missing()
        if missing is None:
            present.append(kind)
        elif number <= REFERENCE:
            sys.exit(f"bench.peers: {kind.name}: {missing}: run `make bench-peers`")
        else:
            print(f"left out: {kind.name}: {missing}", file=sys.stderr)

    def tell(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    with failing_in_a_sentence("bench.peers"):
        trips = round_trip.measure(present, options.rounds, options.count, tell)
        watched = [kind for kind in present if kind.has_presence]
        deaths = death.measure(watched, options.rounds, options.kills, tell)
    command = (
        f"python -m bench.peers --rounds {options.rounds} --count {options.count} --kills {options.kills}"
    )
    peers = Peers(this_run(command), tuple(trips), tuple(deaths))
    if options.json is not None:
        write(peers, options.json)
    show(sheets(peers), verdicts(peers))


if __name__ == "__main__":
    main()
