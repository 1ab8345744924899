"""All results of `python -m bench`: their tables, verdicts and JSON lines."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path

from bench import heartbeat, law, process, sim, start
from bench.rig.sheet import Sheet, Verdict, commit, machine, now


@dataclass(frozen=True)
class Results:
    """All measurements."""

    timings: tuple[law.Timing, ...]
    memory: tuple[law.Memory, ...]
    loads: tuple[process.Load, ...]
    heartbeats: tuple[heartbeat.Heartbeat, ...]
    paces: tuple[sim.Pace, ...]
    imports: tuple[start.Imports, ...]
    starts: tuple[start.Start, ...]

    def verdicts(self) -> list[Verdict]:
        return [
            *law.verdicts(self.timings),
            *process.verdicts(self.loads),
            *heartbeat.verdicts(self.heartbeats),
            *sim.verdicts(self.paces),
            *start.verdicts(self.starts),
        ]

    def sheets(self) -> list[Sheet]:
        sheets = [
            law.timing_sheet(self.timings),
            law.memory_sheet(self.memory),
            process.load_sheet(self.loads),
            heartbeat.heartbeat_sheet(self.heartbeats),
            sim.pace_sheet(self.paces),
            start.imports_sheet(self.imports),
            start.starts_sheet(self.starts),
        ]
        return [sheet for sheet in sheets if sheet.rows]


def write_json(results: Results, path: Path) -> None:
    """Write one JSON object a line: first the run, then one for each row and each target."""
    lines: list[dict[str, object]] = [
        {"kind": "run", "date": now(), "machine": machine(), "commit": commit()},
        *({"kind": "step", **asdict(timing)} for timing in results.timings),
        *({**asdict(memory), "kind": "memory", "step": memory.kind} for memory in results.memory),
        *({"kind": "process", **asdict(load)} for load in results.loads),
        *({"kind": "heartbeat", **asdict(beat)} for beat in results.heartbeats),
        *({"kind": "sim", **asdict(pace)} for pace in results.paces),
        *({"kind": "import", **asdict(one)} for one in results.imports),
        *({"kind": "start", **asdict(one)} for one in results.starts),
        *({"kind": "target", **asdict(verdict)} for verdict in results.verdicts()),
    ]
    path.write_text("".join(json.dumps(line, ensure_ascii=False) + "\n" for line in lines))
