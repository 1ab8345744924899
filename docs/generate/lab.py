"""Write the measured parts of docs/lab.md.

stop      as in README.md
grades    the marks of three programs: docs/campaign/grade_*.json, each written by `lifeline grade --json`
"""

import json

from bench.rig.sheet import markdown_table
from bench.rig.stored import FOLDER
from docs.generate import sections
from docs.generate.crash_safety import result
from docs.generate.readme import stop
from faults.grade.marks import TITLES, Fault, Mark, cm
from faults.grade.report import from_json, points

GRADES = {
    "lab_alone": "the lab's node",
    "keys_alone": "`key_teleop`",
    "lab_lifeline": "the lab's node, with Lifeline",
    "keys_lifeline": "`key_teleop` held, with Lifeline",
    "teleop_lifeline": "Lifeline's teleop and supervisor",
}
STOPPING = (Fault.KILLED, Fault.STOPPED, Fault.UNPLUGGED)


def grades() -> str:
    """Return the marks of each program for each fault, with time and distance to standstill where the robot must stop."""
    texts = [(FOLDER / f"grade_{name}.json").read_text() for name in GRADES]
    found, runs = [from_json(text) for text in texts], [json.loads(text)["run"] for text in texts]
    columns = [{one.fault: one for one in grade.marks} for grade in found]
    loads = sections.load_of(run["machine"] for run in runs)
    rows = [(title, *(_cell(marks[fault]) for marks in columns)) for fault, title in TITLES.items()]
    rows.append(("total", *(f"**{grade.points:g} of {grade.of}**" for grade in found)))
    commands = ", ".join(f"`{_command(run['command'])}`" for run in runs)
    origin = f"{runs[0]['date']} to {runs[-1]['date']}, {loads}, commit {runs[-1]['commit']}"
    return (
        f"{markdown_table(('fault', *GRADES.values()), rows)}\n\nOne run each (n = 1), {origin}: {commands}."
    )


def _command(command: str) -> str:
    """Return the command without the files that it wrote."""
    words = command.split()
    files = {
        number + more for number, word in enumerate(words) if word in {"--json", "--html"} for more in (0, 1)
    }
    return " ".join(word for number, word in enumerate(words) if number not in files)


def _cell(mark: Mark) -> str:
    seen = mark.observed
    if seen is None or mark.fault not in STOPPING:
        return points(mark)
    if seen.standstill_s is None:
        return f"{points(mark)}: more than {cm(seen.distance_m)}"
    return f"{points(mark)}: {seen.standstill_s:.2f} s, {cm(seen.distance_m)}"


PARTS: sections.Parts = {"grades": grades, "stop": lambda: stop(result("real"))}
