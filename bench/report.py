"""The results of `python -m bench` as tables, verdicts and JSON lines."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from bench import heartbeat, law, process, sim, start, wakeup
from bench.rig.sheet import Sheet, Verdict, commit, machine, now


@dataclass(frozen=True)
class Results:
    """All measurements."""

    timings: tuple[law.Timing, ...]
    memory: tuple[law.Memory, ...]
    loads: tuple[process.Load, ...]
    """The first is that of the relay."""
    heartbeats: tuple[heartbeat.Heartbeat, ...]
    paces: tuple[sim.Pace, ...]
    sections: tuple[wakeup.Section, ...]
    imports: tuple[start.Imports, ...]
    starts: tuple[start.Start, ...]

    def verdicts(self) -> list[Verdict]:
        verdicts: list[Verdict] = []
        for timing in self.timings:
            if timing.beams == law.TARGET_BEAMS:
                what = f"a step with a new scan of {timing.beams} beams, median,"
                verdicts.append(Verdict(what, timing.scan_median_us, law.TARGET_US, "µs"))
            else:
                what = f"time for each beam at {timing.beams:,} beams"
                verdicts.append(Verdict(what, timing.per_beam_to_360, 1.0, f"× that at {law.TARGET_BEAMS}"))
        for load in self.loads[1:]:
            verdicts += [
                Verdict(f"CPU, {load.phase},", load.cpu_percent, process.TARGET_CPU_PERCENT, "% of one core"),
                Verdict(f"resident memory, {load.phase},", load.rss_mb, process.TARGET_RSS_MB, "MB"),
            ]
        for beat in self.heartbeats:
            what = f"the heartbeat's lateness, p99, {beat.screen} at {beat.columns}×{beat.rows},"
            verdicts.append(Verdict(what, beat.sent_p99_ms, heartbeat.TARGET_P99_MS, "ms"))
        for pace in self.paces:
            what = f"a simulated second of {pace.what}"
            verdicts += [
                Verdict(f"{what}, processor time,", pace.plant_ms, sim.TARGET_MS, "ms"),
                Verdict(f"{what}, times MuJoCo alone,", pace.plant_to_bare, sim.TARGET_TO_BARE, "×"),
            ]
        if self.starts:
            up_s = float(np.median([one.up_s for one in self.starts]))
            drivable_s = float(np.median([one.drivable_s for one in self.starts]))
            verdicts += [
                Verdict("`lifeline up --detach`, median,", up_s, start.TARGET_UP_S, "s"),
                Verdict(
                    "from SIGKILL of the supervisor to drivable, median,",
                    drivable_s,
                    start.TARGET_DRIVABLE_S,
                    "s",
                ),
            ]
        return verdicts

    def sheets(self) -> list[Sheet]:
        sheets = [
            _timing_sheet(self.timings),
            _memory_sheet(self.memory),
            _load_sheet(self.loads),
            _heartbeat_sheet(self.heartbeats),
            _pace_sheet(self.paces),
            _wakeup_sheet(self.sections),
            _imports_sheet(self.imports),
            _starts_sheet(self.starts),
        ]
        return [sheet for sheet in sheets if sheet.rows]


def _timing_sheet(timings: Iterable[law.Timing]) -> Sheet:
    return Sheet(
        "step() in µs, driving at a wall with the barrier active",
        (
            "beams",
            "scan p50",
            "scan p99",
            "tick p50",
            "tick p99",
            "numpy p50",
            "scan / numpy",
            "per beam",
            "cold p50",
            "cold numpy p50",
        ),
        tuple(
            (
                f"{t.beams:,}",
                f"{t.scan_median_us:.0f}",
                f"{t.scan_p99_us:.0f}",
                f"{t.tick_median_us:.0f}",
                f"{t.tick_p99_us:.0f}",
                f"{t.numpy_median_us:.0f}",
                f"{t.scan_to_numpy:.1f}",
                f"{t.per_beam_to_360:.2f}",
                f"{t.cold_median_us:.0f}",
                f"{t.cold_numpy_us:.0f}",
            )
            for t in timings
        ),
        (
            (
                "scan: a step with a new scan, odometry and a command. tick: a step with odometry and a command, "
                "the points moved by odometry."
            ),
            (
                "numpy: ranges → points → distances from the hull → the smallest, in plain numpy on the same arrays, "
                "alternating with the steps. scan / numpy is the median of the ratios of each round, since a slow machine "
                "slows both."
            ),
            (
                "Scans of all sizes alternate, as other work does between two real ticks; "
                "one size alone in a tight loop is faster by about a tenth."
            ),
            "per beam: the time of a scan step for each beam, relative to that at 360; 1 is linear.",
            f"cold: a scan step, and the plain numpy, immediately after {1000 * law.COLD_SLEEP_S:.0f} ms of sleep.",
        ),
    )


def _memory_sheet(memory: Iterable[law.Memory]) -> Sheet:
    return Sheet(
        "step() and memory",
        ("beams", "step", "peak kB", "left in the state kB", "growth, blocks per step"),
        tuple(
            (
                f"{m.beams:,}",
                m.kind,
                f"{m.peak_bytes / 1000:.1f}",
                f"{m.state_bytes / 1000:.1f}",
                f"{m.growth_blocks:.2f}",
            )
            for m in memory
        ),
        (
            (
                f"Means of {law.MEMORY_STEPS} steps. peak: the maximum memory during a step beyond that held before. "
                "left: the memory kept after the step, which replaces the previous state (both by tracemalloc)."
            ),
            (
                "growth: of the interpreter's memory blocks from the first step to the last "
                "(sys.getallocatedblocks); zero means no leak."
            ),
        ),
    )


def _load_sheet(loads: Sequence[process.Load]) -> Sheet:
    return Sheet(
        "The supervisor process over Zenoh: 20 Hz scans of 360 beams, 20 Hz commands, 50 Hz odometry",
        (
            "phase",
            "mode",
            "s",
            "CPU %",
            "/ relay",
            "loop %",
            "Zenoh %",
            "RSS MB",
            "cmd_vel Hz",
            "gap p50 ms",
            "p99",
            "max",
        ),
        tuple(
            (
                load.phase,
                load.mode,
                f"{load.seconds:.0f}",
                f"{load.cpu_percent:.1f}",
                f"{load.cpu_percent / loads[0].cpu_percent:.2f}",
                f"{load.loop_percent:.1f}",
                f"{load.zenoh_percent:.1f}",
                f"{load.rss_mb:.0f}",
                f"{load.cmd_vel_hz:.1f}",
                f"{load.gap_p50_ms:.1f}",
                f"{load.gap_p99_ms:.1f}",
                f"{load.gap_max_ms:.1f}",
            )
            for load in loads
        ),
        (
            (
                "CPU: of one core, user and system, from /proc/<pid>/stat. loop: the thread with the event loop, the "
                "law, encoding and decoding. Zenoh: all other threads."
            ),
            (
                "relay: the same traffic through a process without a law, bench/relay.py. If a core sleeps between "
                "ticks its caches grow cold, and on some machines the same code takes several times as long as in a "
                "loop; / relay compares both under the same conditions."
            ),
            ("topic echo: another process prints every message as YAML, on the same two cores."),
            (
                "cmd_vel and its gaps are measured by the driver; under the barrier the output also changes between "
                "ticks, and each change is sent immediately."
            ),
        ),
    )


def _heartbeat_sheet(heartbeats: Iterable[heartbeat.Heartbeat]) -> Sheet:
    return Sheet(
        "Teleop's heartbeat while it draws: lateness in ms against a grid of 50 ms",
        (
            "screen",
            "size",
            "mode",
            "s",
            "beats",
            "missed",
            "sent p50",
            "p99",
            "max",
            "arrival p50",
            "p99",
            "max",
            "kB/s",
        ),
        tuple(
            (
                beat.screen,
                f"{beat.columns}×{beat.rows}",
                beat.mode,
                f"{beat.seconds:.0f}",
                f"{beat.beats}",
                f"{beat.missed}",
                f"{beat.sent_p50_ms:.1f}",
                f"{beat.sent_p99_ms:.1f}",
                f"{beat.sent_max_ms:.1f}",
                f"{beat.arrival_p50_ms:.1f}",
                f"{beat.arrival_p99_ms:.1f}",
                f"{beat.arrival_max_ms:.1f}",
                f"{beat.output_kb_s:.1f}",
            )
            for beat in heartbeats
        ),
        (
            (
                "The real teleop in a pseudo-terminal that reads all its output, with scans at 20 Hz, odometry at 50 Hz "
                "and the supervisor's status at 10 Hz, all of which change; at full speed, with three key presses a second."
            ),
            (
                "sent: by the source time in each command's stamp. arrival: at this program, through the hub; it "
                "includes this program's delays. The grid goes through the earliest beat."
            ),
            "kB/s: teleop's output to the terminal.",
        ),
    )


def _pace_sheet(paces: Iterable[sim.Pace]) -> Sheet:
    return Sheet(
        "The simulated robot, unpaced, with a scan of 360 beams 20 times a simulated second, on one core",
        ("scene", "geoms", "× real time", "ms", "ms p90", "MuJoCo alone ×", "ms", "rate / MuJoCo's"),
        tuple(
            (
                pace.what,
                f"{pace.geoms}",
                f"{pace.real_time_factor:.0f}",
                f"{pace.plant_ms:.2f}",
                f"{pace.plant_p90_ms:.2f}",
                f"{pace.bare_factor:.0f}",
                f"{pace.bare_ms:.2f}",
                f"{1.0 / pace.plant_to_bare:.2f}",
            )
            for pace in paces
        ),
        (
            (
                "ms: CPU time of the thread for a simulated second of 500 steps and 20 scans, median of the rounds. "
                "The robot drives; the target of 10 ms is a hundred times real time."
            ),
            (
                "MuJoCo alone: mj_step and mj_multiRay in a loop on the same model, alternating with the robot; the target "
                "is 80 % of its rate, which is 1.25 times its time."
            ),
        ),
    )


def _wakeup_sheet(sections: Iterable[wakeup.Section]) -> Sheet:
    return Sheet(
        "Sections of a supervisor's wake-up, CPU time in µs, in a loop and after sleep",
        ("section", "Hz", "hot p50", "cold p50", "cold / hot", "hot % of a core", "cold % of a core"),
        tuple(
            (
                s.section,
                f"{s.rate_hz:.0f}",
                f"{s.hot_us:.1f}",
                f"{s.cold_us:.1f}",
                f"{s.cold_to_hot:.1f}",
                f"{s.hot_percent:.2f}",
                f"{s.cold_percent:.2f}",
            )
            for s in sections
        ),
        (
            (
                f"hot: in a loop; waits of {1000 * wakeup.HOT_WAIT_S:g} ms. cold: immediately after "
                f"{1000 * law.COLD_SLEEP_S:.0f} ms of sleep; waits of that duration. All sections alternate."
            ),
            (
                "Hz: the robot's rate; the shares of a core are the medians at that rate. free and limited are "
                "alternatives. The reference is a thread that only sleeps and wakes: the minimum for a wake-up on this machine."
            ),
            (
                "Each section alone pays for cold caches. a whole tick (odometry) and a whole scan are a sequence after one "
                "sleep: decode, step(), encode cmd_vel, record. They therefore take less than the sum of their sections."
            ),
            "decode: push into the subscription, take, and convert to the law's input. encode: with conversion and stamp.",
        ),
    )


def _imports_sheet(imports: Iterable[start.Imports]) -> Sheet:
    return Sheet(
        "Imports: a new interpreter that imports the modules of one program and ends, in ms",
        ("program", "p50", "p90", "/ numpy and zenoh", "runs"),
        tuple(
            (
                one.program,
                f"{one.median_ms:.0f}",
                f"{one.p90_ms:.0f}",
                f"{one.to_libraries:.2f}",
                f"{one.runs}",
            )
            for one in imports
        ),
        (
            "With warm caches and compiled byte code. / numpy and zenoh: the median of the ratios of each round.",
            "lifeline up: the imports of the command itself, not of the processes that it starts.",
        ),
    )


def _starts_sheet(starts: Sequence[start.Start]) -> Sheet:
    rows = (
        ("lifeline up --detach, until every node is alive", [one.up_s for one in starts]),
        ("SIGKILL of the supervisor until its restart", [one.respawned_s for one in starts]),
        ("SIGKILL of the supervisor until drivable", [one.drivable_s for one in starts]),
    )
    return Sheet(
        "Start and restart under supervisord, in s",
        ("what", "p50", "min", "max", "runs"),
        tuple(
            (
                what,
                f"{np.median(taken_s):.2f}",
                f"{min(taken_s):.2f}",
                f"{max(taken_s):.2f}",
                f"{len(taken_s)}",
            )
            for what, taken_s in rows
            if taken_s
        ),
        (
            (
                "drivable: the first status READY, while a source sends zero velocity at 20 Hz. It includes the timeouts of "
                "0.2 s and 0.24 s for which the supervisor observes a command source and a lidar before it trusts them."
            ),
            "The time of the restart is rounded down to 10 ms, and may therefore appear to be before the kill.",
        ),
    )


def write_json(results: Results, path: Path) -> None:
    """Write one JSON object a line: first the run, then one for each row and each target."""
    lines: list[dict[str, object]] = [
        {"kind": "run", "date": now(), "machine": machine(), "commit": commit()},
        *({"kind": "step", **asdict(timing)} for timing in results.timings),
        *({**asdict(memory), "kind": "memory", "step": memory.kind} for memory in results.memory),
        *({"kind": "process", **asdict(load)} for load in results.loads),
        *({"kind": "heartbeat", **asdict(beat)} for beat in results.heartbeats),
        *({"kind": "sim", **asdict(pace)} for pace in results.paces),
        *({"kind": "wakeup", **asdict(section)} for section in results.sections),
        *({"kind": "import", **asdict(one)} for one in results.imports),
        *({"kind": "start", **asdict(one)} for one in results.starts),
        *({"kind": "target", **asdict(verdict)} for verdict in results.verdicts()),
    ]
    path.write_text("".join(json.dumps(line, ensure_ascii=False) + "\n" for line in lines))
