"""`python -m bench.peers`: compare the supervisor with bare relays of other transports. Always exit 0 unless one fails."""

import sys

from bench.peers.results import REFERENCE, Peers, sheets, verdicts, write
from bench.peers.run import Kind, kinds, measure
from bench.rig.options import CommandLine, count, failing_in_a_sentence, progress
from bench.rig.sheet import show
from bench.rig.stored import this_run

ROUNDS, COUNT, KILLS = 5, 40, 20


def main() -> None:
    line = CommandLine(
        "bench.peers",
        "Measure the round trip of a command and the time from a SIGKILL to its notice, through the supervisor and "
        "through bare relays over Zenoh, MQTT, CycloneDDS and rclpy, interleaved. Takes about four minutes.",
        "exit code: 0, even if a target is missed; 1 if a process fails; 130 after Ctrl-C",
    )
    line.option("rounds", count, ROUNDS, "number of rounds")
    line.option("count", count, COUNT, "commands per kind, rate and round")
    line.option("kills", count, KILLS, "kills per kind and round")
    line.file("json", "write all times as JSON lines")
    options = line.parse()

    present: list[Kind] = []
    for number, kind in enumerate(kinds()):
        missing = kind.missing()
        if missing is None:
            present.append(kind)
        elif number <= REFERENCE:
            sys.exit(f"bench.peers: {kind.name}: {missing}: run `make bench-peers`")
        else:
            progress(f"left out: {kind.name}: {missing}")

    with failing_in_a_sentence("bench.peers"):
        trips, deaths = measure(present, options.rounds, options.count, options.kills)
    peers = Peers(this_run(line.repeat(options)), tuple(trips), tuple(deaths))
    if options.json is not None:
        write(peers, options.json)
    show(sheets(peers), verdicts(peers), peers.run)


if __name__ == "__main__":
    main()
