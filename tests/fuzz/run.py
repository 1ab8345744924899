"""A complete run: most payloads go to the decoders, a share to the services in virtual time."""

import asyncio
import resource
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from tests.fuzz import payloads
from tests.fuzz.decoding import Finding, Tally, fuzz_decoders
from tests.fuzz.driving import SCENE_PAYLOADS, scene
from tests.fuzz.simulated import SIM_PAYLOADS, simulate
from tests.fuzz.warned import Warned, warned

DRIVING_SHARE = 0.12
BATCH = 10_000
ENOUGH_FINDINGS = 20
"""After this many findings, the run ends, because one cause appears many times."""

Progress = Callable[[int], None]
"""Called with the number of finished payloads."""


@dataclass(slots=True)
class Report:
    """The results of a run."""

    seed: int
    decoding: Tally = field(default_factory=Tally)
    driving: int = 0
    """Number of payloads on the supervisor's keys."""
    while_driving: int = 0
    """Number of them that arrived while the robot was ready or moving."""
    commands: int = 0
    longest_status_bytes: int = 0
    simulated: int = 0
    took_s: float = 0.0
    rss_growth_bytes: int = 0
    """Growth of the process's peak memory."""
    findings: list[Finding] = field(default_factory=list[Finding])
    warned: Warned = field(default_factory=set[str])

    @property
    def payloads(self) -> int:
        return self.decoding.payloads + self.driving + self.simulated

    @property
    def all_findings(self) -> list[Finding]:
        return [*self.decoding.findings, *self.findings]


def run(seed: int, count: int, progress: Progress) -> Report:
    """Feed this number of payloads; the same seed feeds the same payloads."""
    report = Report(seed)
    payloads.large_payloads()
    began_s, began_rss = time.monotonic(), _rss_bytes()
    to_sim = min(SIM_PAYLOADS, count // 20)
    to_supervisor = int(count * DRIVING_SHARE)
    asyncio.run(_decode(report, count - to_sim - to_supervisor, progress))
    for number in range(-(-to_supervisor // SCENE_PAYLOADS)):
        if len(report.all_findings) >= ENOUGH_FINDINGS:
            break
        size = min(SCENE_PAYLOADS, to_supervisor - number * SCENE_PAYLOADS)
        drive(report, number, size)
        progress(report.payloads)
    to_sim_of(report, to_sim)
    report.took_s = time.monotonic() - began_s
    report.rss_growth_bytes = _rss_bytes() - began_rss
    return report


def drive(report: Report, number: int, count: int = SCENE_PAYLOADS) -> None:
    """Run one scene of the supervisor."""
    met = scene(report.seed, number, count, _replay(report.seed, "scene", number))
    report.driving += met.payloads
    report.while_driving += met.while_driving
    report.commands += met.steps
    report.longest_status_bytes = max(report.longest_status_bytes, met.longest_status_bytes)
    report.findings += met.findings
    report.warned |= met.warned


def decode_one(report: Report, number: int) -> None:
    """Run one payload of the decoders."""
    asyncio.run(_numbers(report, range(number, number + 1)))


def to_sim_of(report: Report, count: int = SIM_PAYLOADS) -> None:
    """Run the sim's payloads."""
    fed, findings, warnings = simulate(report.seed, count, _replay(report.seed, "sim", count))
    report.simulated += fed
    report.findings += findings
    report.warned |= warnings


async def _decode(report: Report, count: int, progress: Progress) -> None:
    for first in range(0, count, BATCH):
        await _numbers(report, range(first, min(count, first + BATCH)))
        progress(report.payloads)
        if len(report.all_findings) >= ENOUGH_FINDINGS:
            return


async def _numbers(report: Report, numbers: range) -> None:
    with warned() as warnings:
        fuzz_decoders(report.seed, numbers, report.decoding, _replay(report.seed, "number", "{}"))
    report.warned |= warnings


def _replay(seed: int, what: str, which: object) -> str:
    return f"python -m tests.fuzz --seed {seed} --{what} {which}"


def _rss_bytes() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
