"""`python -m tests.fuzz`: exit 1 if anything was found. A million payloads take about four minutes."""

import argparse
import logging
import re
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.fuzz.decoding import Finding, Most
from tests.fuzz.files import fuzz_files
from tests.fuzz.run import Progress, Report, decode_one, drive, run, to_sim_of

SHOWN_CHARACTERS = 4000


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m tests.fuzz",
        description="Feed payloads that a stranger may send to the decoders, the supervisor, the sim and the dashboard, "
        "or damaged files to the commands that read them.",
        epilog="exit code: 1 where something was raised, came out beyond its limits, or took too much",
    )
    parser.add_argument(
        "--payloads", type=int, default=1_000_000, metavar="N", help="in all (default: %(default)s)"
    )
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="what is fed (default: %(default)s)")
    parser.add_argument("--number", type=int, metavar="I", help="this one payload alone, to the decoders")
    parser.add_argument("--scene", type=int, metavar="K", help="this scene of the supervisor's alone")
    parser.add_argument("--sim", type=int, metavar="N", help="the sim's payloads alone, so many of them")
    parser.add_argument("--files", type=int, metavar="N", help="damaged files alone, so many of each kind")
    arguments = parser.parse_args()
    logging.getLogger("wire").setLevel(logging.CRITICAL)
    logging.getLogger("sim").setLevel(logging.CRITICAL)
    if arguments.files is not None:
        sys.exit(_files(arguments.seed, arguments.files))
    if arguments.number is not None:
        decode_one(report := Report(arguments.seed), arguments.number)
    elif arguments.scene is not None:
        drive(report := Report(arguments.seed), arguments.scene)
    elif arguments.sim is not None:
        to_sim_of(report := Report(arguments.seed), arguments.sim)
    else:
        report = run(arguments.seed, arguments.payloads, _progress(arguments.payloads))
    _show(report)
    sys.exit(int(bool(report.all_findings)))


def _files(seed: int, count: int) -> int:
    with TemporaryDirectory() as directory:
        findings = fuzz_files(seed, count, Path(directory))
    for found in findings:
        print(f"{found.reader}: {found.what}\n    {found.content[:SHOWN_CHARACTERS]!r}")
    print(f"{count:,} damaged files of each kind (seed {seed}): {len(findings)} findings")
    return int(bool(findings))


def _progress(total: int) -> Progress:
    def show(done: int) -> None:
        if sys.stderr.isatty():
            print(f"\r{done:,} of {total:,}", end="\r", file=sys.stderr, flush=True)

    return show


def _show(report: Report) -> None:
    tally = report.decoding
    print(f"{report.payloads:,} payloads (seed {report.seed}) in {report.took_s:.0f} s")
    if tally.payloads:
        print(f"  decoders    {tally.payloads:,}: {tally.decoded:,} decoded, {tally.refused:,} refused")
        print(
            f"    slowest               {tally.slowest_s.value * 1000:.2f} ms of processor time{_of(tally.slowest_s)}"
        )
        print(f"    most memory           {tally.largest_bytes.value / 1e6:.2f} MB{_of(tally.largest_bytes)}")
        print(
            f"    of less than 8 KiB    {tally.largest_small_bytes.value / 1e3:.1f} kB{_of(tally.largest_small_bytes)}"
            f"; memory counted for {tally.traced:,}"
        )
    if report.driving:
        print(
            f"  supervisor  {report.driving:,}, {report.while_driving:,} of them while it was free to move; "
            f"{report.commands:,} on cmd_vel, longest status {report.longest_status_bytes:,} bytes"
        )
    if report.simulated:
        print(f"  sim         {report.simulated:,}")
    print(f"  the process grew by {report.rss_growth_bytes / 1e6:.1f} MB at most")
    for line in sorted(report.warned):
        print(f"  warned      {line}")
    findings = report.all_findings
    print(f"{len(findings)} findings")
    kinds: dict[str, list[Finding]] = {}
    for finding in findings:
        kinds.setdefault(re.sub(r"\d+", "#", finding.what), []).append(finding)
    for alike in kinds.values():
        _tell(min(alike, key=lambda finding: len(finding.payload)), len(alike))


def _of(most: Most) -> str:
    return (
        f" for {most.payload_bytes:,} bytes of {most.name} (--number {most.number})"
        if most.number >= 0
        else ""
    )


def _tell(finding: Finding, count: int) -> None:
    """Return the shortest of each group of similar findings."""
    shown = finding.payload
    if len(shown) > SHOWN_CHARACTERS:
        shown = f"{shown[:SHOWN_CHARACTERS]}… ({len(finding.payload)} characters)"
    print(f"* {count} like this: {finding.what}\n  {shown}\n  again: {finding.replay}")


if __name__ == "__main__":
    main()
