"""`python -m bench.fleet`: measure how many robots one router serves. Exit 0, or 1 if a process fails or a promise is broken.

Hubs dial out to the router, operators are behind it, and every link has certificates. `bench.robots` measures the robots.
"""

import sys
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from bench.rig.options import CommandLine, count, failing_in_a_sentence, positive
from bench.rig.program import program
from bench.rig.sheet import Column, Sheet, Verdict, percentile, show
from bench.rig.stored import FOLDER, this_run
from bench.robots.feeder import namespace_of
from bench.robots.results import GAPS, Crowd, Robots, write
from bench.robots.run import KILLS_LIMIT_S, Site, measure
from deploy.keys.commands import init, issue
from deploy.keys.register import Request
from deploy.stack.launch import free_loopback_endpoint
from wire.roles import ANY, Role

CURVE, SOAK = FOLDER / "bench_fleet.jsonl", FOLDER / "bench_fleet_soak.jsonl"
"""The stored runs, in the form of bench.robots."""
ROBOTS = [1, 5, 10, 20, 50]
SECONDS, KILLS = 15.0, 30
SOAK_DRIVE_S = 30.0
"""How long all robots of a long run drive before the kills begin."""
STOP_LIMIT_MS = 220.0
"""The command timeout and a tick: what holds for each stop, even if every token were late."""
DAY_S = 86400.0
START_LIMIT_S = 60.0

COLUMNS: tuple[Column[Crowd], ...] = (
    ("robots", lambda one: f"{one.robots}"),
    ("CPU of the router", lambda one: f"{one.router_percent:.1f}"),
    ("of each hub", lambda one: f"{np.mean(one.cpu_percent):.1f}"),
    ("busy", lambda one: f"{one.busy_percent:.0f} / {one.kills_busy_percent:.0f}"),
    *GAPS,
    ("kills", lambda one: f"{len(one.stop_ms)} of {one.kills}"),
    ("stop p50", lambda one: one.stop_percentile(50)),
    ("p99", lambda one: one.stop_percentile(99)),
    ("max", lambda one: one.stop_percentile(100)),
    ("KB/s of each", lambda one: f"{one.crossing_bytes_s / 1000:.1f}"),
)


@contextmanager
def site(robots: int) -> Generator[Site]:
    """Run a router for a number of robots, and write their configurations, while the context is open."""
    with TemporaryDirectory() as folder:
        keys, names = Path(folder) / "keys", [namespace_of(number) for number in range(robots)]
        init(keys, replace=False)

        def bundle(name: str, role: Role, robot: str) -> Path:
            return Path(issue(keys, Request(name, role, robot, None), DAY_S * 30)["bundle"])

        endpoint = free_loopback_endpoint().replace("tcp", "tls")
        configs = [Path(folder) / f"{name}.toml" for name in names]
        for name, config in zip(names, configs, strict=True):
            config.write_text(
                f'[bus]\nnamespace = "{name}"\nkeys = "{bundle(name, Role.SUPERVISOR, name)}"\nrouters = ["{endpoint}"]\n'
            )
        words = ["router", "--listen", endpoint, "--keys", str(bundle("site", Role.ROUTER, ANY))]
        words += [f"--robot={name}" for name in names]
        with program("lifeline.cli.app", arguments=words) as router:
            while "routing for" not in router.line(START_LIMIT_S):
                pass
            yield Site(endpoint, router.pid, bundle("operator", Role.OPERATOR, ANY), configs)


def sheet(crowds: Sequence[Crowd]) -> Sheet:
    """Return one row for each number of robots."""
    return Sheet.of(
        "Robots behind one router, all on one machine: CPU in % of one core, times in ms",
        COLUMNS,
        crowds,
        "All robots drive. Their operators and their hubs connect to the router over TLS.",
        "busy: the machine, in % of all cores, during the drive / the kills.",
        "gap: between two messages on cmd_vel at the robot.",
        "stood: number of robots that stopped without cause, with their number for each reason.",
        "kills: those before which the robot drove. On a saturated machine, no further operator begins to drive.",
        "stop: from the SIGKILL of an operator behind the router to zero on cmd_vel, while the other robots drive.",
        "KB/s of each: what the router sends and receives for one robot and its operator, without odometry and scans.",
    )


def soak_verdicts(one: Crowd) -> list[Verdict]:
    """Return whether every promise was kept: each stop in time, and no stop of a robot whose operator lives."""
    what = f"{one.robots} robots behind one router for {one.seconds + one.kills_seconds:.0f} s,"
    return [
        Verdict(
            f"{what} SIGKILL to zero, longest of {len(one.stop_ms)}",
            percentile(one.stop_ms, 100),
            STOP_LIMIT_MS,
            "ms",
        ),
        Verdict(f"{what} kills of a driving operator without a stop", one.missed, 0.0, "kills"),
        Verdict(f"{what} robots that stopped without cause", one.stood + one.stood_in_kills, 0.0, "robots"),
    ]


def main() -> None:
    line = CommandLine(
        "bench.fleet",
        "Run several robots behind one router on this machine, with certificates on every link, and measure processor "
        "time, gaps of cmd_vel, stops without cause, and the time from the SIGKILL of an operator behind the router to zero. "
        "Takes about six minutes.",
        "exit code: 0; 1 if a process fails, or if a promise is broken with --soak; 130 after Ctrl-C",
    )
    line.option("robots", count, ROBOTS, "numbers of robots", many=True)
    line.option("seconds", positive, SECONDS, "duration of each drive, without --soak")
    line.option("kills", count, KILLS, "kills for each number of robots, without --soak")
    line.option(
        "soak",
        positive,
        None,
        "drive for this time [s] with each number, kill operators throughout, and check every promise",
    )
    line.file("json", "write the results as JSON lines")
    options = line.parse()
    drive_s, kills_limit_s = options.seconds, KILLS_LIMIT_S
    if options.soak is not None:
        options.seconds = options.kills = None
        drive_s = min(SOAK_DRIVE_S, options.soak / 2)
        kills_limit_s = options.soak - drive_s
    crowds: list[Crowd] = []
    with failing_in_a_sentence("bench.fleet"):
        for number in options.robots:
            with site(number) as made:
                crowds.append(measure(number, drive_s, options.kills, made, kills_limit_s=kills_limit_s))
            if options.json is not None:  # an interrupted run keeps what it has measured
                write(Robots(this_run(line.repeat(options)), tuple(crowds)), options.json)
    verdicts = [verdict for one in crowds for verdict in soak_verdicts(one)] if options.soak else []
    show([sheet(crowds)], verdicts)
    sys.exit(any(verdict.measured > verdict.target for verdict in verdicts))


if __name__ == "__main__":
    main()
