"""The commands that check a configuration, judge a recording, prove the promises, grade programs and measure stops.

check, judge, demo, faults, fault-report, grade, passport.
"""

import sys
from pathlib import Path
from typing import Annotated

import typer

from deploy.stack.console import answer, note, say
from deploy.stack.errors import EXIT_REFUSED
from lifeline.command import Endpoint, Json, KeysPath, ResultJson, StatePath, argument, command, option
from wire.host.installation import require

app = typer.Typer()
passport_app = typer.Typer(
    help="Measure how far a robot moves after each fault, in front of a flat wall.", no_args_is_help=True
)
app.add_typer(passport_app, name="passport")


@command(app)
def check(
    *,
    file: Annotated[Path, argument("FILE", "Configuration file, such as robot.toml.")],
    as_json: Json = False,
) -> int:
    """Check a configuration: its lidars, stopping distance, permitted motions and risks.

    Exit 0 if all risks are measured or accepted, 1 if a setting creates another risk, 2 if the file is refused.
    Of a file without a sim section, each number that was not measured is a risk: `lifeline commission FILE` measures them.
    """
    from lifeline.check.check import check

    return check(file, as_json=as_json)


@command(app)
def judge(
    *,
    file: Annotated[
        Path,
        argument("FILE", "An .mcap file, a .db3 file or folder of rosbag2, or a black box (.jsonl.gz)."),
    ],
    scan: Annotated[
        list[str] | None,
        option(
            "--scan",
            "TOPIC",
            "Topic of a lidar's scans. Repeat it for each lidar, in the order of the configuration.",
        ),
    ] = None,
    odom: Annotated[str | None, option("--odom", "TOPIC", "Topic of the odometry.")] = None,
    cmd_vel: Annotated[
        str | None, option("--cmd-vel", "TOPIC", "Topic of the commands to the base (Twist or TwistStamped).")
    ] = None,
    estop: Annotated[
        list[str] | None,
        option(
            "--estop",
            "TOPIC",
            "Topic of an e-stop (Bool: true presses it, false resets it). Repeat it for each.",
        ),
    ] = None,
    config: Annotated[
        Path | None,
        option(
            "--config",
            "FILE",
            "Configuration with hull, lidars and limits. Default: assumptions, which are printed.",
        ),
    ] = None,
    as_json: ResultJson = False,
) -> int:
    """Judge a recording of any robot: where Lifeline would have stopped it, and which safety rules were broken.

    The recording needs laser scans, odometry and velocity commands, as ROS 2 messages. A topic is found by its type.

    Exit 1 if Lifeline would have stopped the robot, or if a rule was broken, 2 if the recording cannot be judged.
    """
    from deploy.stack.console import StatusLine, show
    from recordings.judge.choice import Named
    from recordings.judge.judge import judge as judge_it
    from recordings.judge.page import page, to_json

    named = Named(tuple(scan or ()), odom, cmd_vel, tuple(estop or ()))
    progress = StatusLine(sys.stderr)
    try:
        found = judge_it(file, config, named, progress.show)
    finally:
        progress.clear()
    show(to_json(found) if as_json else None, *(() if as_json else page(found)), as_json=as_json)
    return int(found.is_found) if found.is_judged else EXIT_REFUSED


@command(app)
def demo(
    *,
    quick: Annotated[bool, typer.Option("--quick", help="Repeat each fault less often.")] = False,
    viewer: Annotated[bool, typer.Option("--viewer", help="Open MuJoCo's window.")] = False,
    as_json: ResultJson = False,
) -> int:
    """Drive, inject faults, and print the measurements. Exit 1 if a promise was broken."""
    require("sim")  # before anything is announced
    from faults.real.demo import play

    return play(note if as_json else say, quick=quick, viewer=viewer, as_json=as_json)


def class_names(incomplete: str) -> list[str]:
    """Return the classes of faults, after the names that the word already has."""
    from faults.classes import real_classes

    before, comma, _ = incomplete.rpartition(",")
    return [f"{before}{comma}{one.name}" for one in real_classes()]


@command(app)
def faults(
    *,
    virtual: Annotated[
        bool, typer.Option("--virtual", help="Run on a virtual clock, many times faster than real time.")
    ] = False,
    seeds: Annotated[
        int, option("--seeds", "N", "With --virtual: run the seeds from 0 to N-1.", min=1)
    ] = 200,
    seed: Annotated[
        int | None,
        option(
            "--seed",
            "K",
            "With --virtual: run only this seed and print every event. Otherwise: the seed of the first trial of each class.",
            min=0,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        option(
            "--out",
            "FILE.jsonl",
            "Append one line for each trial. Trials that are already in the file are not run again.",
        ),
    ] = None,
    jobs: Annotated[
        int | None,
        option("--jobs", "N", "With --virtual: number of processes. Default: one for each core.", min=1),
    ] = None,
    classes: Annotated[
        str,
        option(
            "--classes",
            "NAME,…",
            "Run only these classes; `teleop_*` selects by prefix.",
            autocompletion=class_names,
        ),
    ] = "",
    trials: Annotated[int, option("--trials", "N", "Trials of each class on real processes.", min=1)] = 3,
    minutes: Annotated[
        float | None,
        option(
            "--minutes",
            "M",
            "Start no trial on real processes after M minutes. Exit 1 if a class has not been tried by then.",
            min=0.1,
        ),
    ] = None,
    as_json: ResultJson = False,
) -> int:
    """Inject every fault at random moments, and check every promise.

    Exit 1 if a promise was broken, or if time ran out before every class of faults was tried.
    """
    require("sim")
    if not virtual:
        from faults.real import runner

        wanted = tuple(name.strip() for name in classes.split(",") if name.strip())
        return runner.run(runner.Orders(trials, wanted, seed or 0, out, minutes), as_json=as_json)
    require("station")
    from faults.simulated.runner import campaign, default_jobs, replay

    if seed is not None:
        return replay(seed, say, as_json=as_json)
    return campaign(seeds, jobs or default_jobs(), out, note if as_json else say, as_json=as_json)


@command(app)
def fault_report(
    *,
    files: Annotated[
        list[Path], argument("FILE.jsonl…", "Result files of `lifeline faults --out`, also compressed (.gz).")
    ],
    html: Annotated[Path, option("--html", "OUT.html", "The page to write.")],
    as_json: Json = False,
) -> None:
    """Render campaign results as an HTML page."""
    from faults.report.page import write_report

    written = write_report(files, html)
    answer(written._asdict(), written.sentence, as_json=as_json)


@command(app, context_settings={"allow_interspersed_args": False})
def grade(
    *,
    program: Annotated[
        list[str] | None,
        argument(
            "CMD", "After --: the program and its arguments. {endpoint} stands for the robot's endpoint."
        ),
    ] = None,
    keys: Annotated[
        str,
        option(
            "--keys", "KEYS", "Keys that make the robot drive forward. Default: the program drives by itself."
        ),
    ] = "",
    hold: Annotated[
        bool,
        typer.Option("--hold", help="Hold the last of the keys until the fault, instead of pressing them."),
    ] = False,
    stop_key: Annotated[
        str, option("--stop-key", "KEY", "Key to press before each attempt to drive. Default: none.")
    ] = "",
    ros2: Annotated[
        bool,
        typer.Option(
            "--ros2", help="The program is a ROS 2 node that publishes /cmd_vel; needs `make ros2`."
        ),
    ] = False,
    through_lifeline: Annotated[
        bool, typer.Option("--through-lifeline", help="Put Lifeline's supervisor between program and robot.")
    ] = False,
    whole_group: Annotated[
        bool,
        typer.Option(
            "--group", help="Kill and stop also what the program started, such as a node of `ros2 run`."
        ),
    ] = False,
    base_timeout: Annotated[
        float | None,
        option(
            "--base-timeout",
            "SECONDS",
            "The robot stops without commands after this time. Default: it keeps the last command.",
            min=0.05,
            max=10.0,
        ),
    ] = None,
    endpoint: Annotated[
        str, option("--endpoint", "tcp/HOST:PORT", "Where a Zenoh program finds the robot.")
    ] = "tcp/127.0.0.1:7447",
    rubric: Annotated[
        Path | None, option("--rubric", "FILE.toml", "Points and limits. Default: those of --print-rubric.")
    ] = None,
    print_rubric: Annotated[
        bool, typer.Option("--print-rubric", help="Print the default rubric and exit.")
    ] = False,
    html: Annotated[
        Path | None, option("--html", "FILE", "Write a page with the speed of the robot around each fault.")
    ] = None,
    junit: Annotated[Path | None, option("--junit", "FILE", "Write the marks as JUnit XML.")] = None,
    json: Annotated[
        Path | None, option("--json", "FILE", "Write the marks and measurements as JSON.")
    ] = None,
) -> int:
    """Grade a teleop program: kill, stop, unplug and disturb it while it drives the simulated robot.

    Exit 0 if the program passed, 1 if it did not, 2 if it could not be graded.
    """
    from faults.grade.rubric import DEFAULT, read

    if print_rubric:
        print(DEFAULT.read_text(encoding="utf-8"), end="")
        return 0
    require("sim")
    from faults.grade import command as grading
    from faults.grade.exam import Exam
    from faults.grade.robot import Setup

    setup = Setup(endpoint, lifeline=through_lifeline, timeout_s=base_timeout, ros2=ros2, hold=hold)
    exam = Exam(tuple(program or ()), setup, read(rubric), keys, stop_key, whole_group)
    return grading.run(exam, grading.Files(html, junit, json), note)


def cell_names(incomplete: str) -> list[str]:
    """Return the names of the faults of a passport."""
    from passport.cells import Fault

    return [fault for fault in Fault if fault.startswith(incomplete)]


@command(passport_app, "measure")
def passport_measure(
    *,
    file: Annotated[Path, argument("FILE", "The robot's configuration, such as robot.toml.")],
    out: Annotated[
        Path,
        option("--out", "FILE.json", "The record to write; one that exists is continued."),
    ] = Path("passport.json"),
    runs: Annotated[int, option("--runs", "N", "Number of runs of each cell.", min=1, max=1000)] = 10,
    load: Annotated[
        list[int] | None,
        option(
            "--load",
            "PERCENT",
            "Load to measure with, in percent of the payload; repeat it for several. Default: 0 and 100.",
            min=0,
            max=200,
        ),
    ] = None,
    fault: Annotated[
        list[str] | None,
        option(
            "--fault",
            "NAME",
            "Measure only this fault; repeat it for several. Default: all, and plain zeros from three speeds.",
            autocompletion=cell_names,
        ),
    ] = None,
    without: Annotated[
        bool,
        typer.Option(
            "--without",
            help="Measure the robot without Lifeline: the operator's program commands the base, and only an e-stop stops it.",
        ),
    ] = False,
    lidar: Annotated[
        str | None, option("--lidar", "NAME", "Lidar that sees the wall. Default: the first.")
    ] = None,
    source: Annotated[
        str,
        option("--source", "NAME", "Command source that drives back; no other program may use it meanwhile."),
    ] = "path",
    endpoint: Endpoint = None,
    keys_dir: KeysPath = None,
    state_dir: StatePath = None,
) -> None:
    """Drive a robot toward a flat wall, stop it by faults, and record each stop.

    Start the robot first, with `lifeline up --detach --config FILE`. Each run is written when it is done. Any key aborts a drive.

    Exit 1 if it was aborted, or if the robot did not stop.
    """
    from deploy.stack.launch import Launch
    from deploy.stack.statedir import StateDir
    from passport.cells import LOADS_PERCENT, faults_named
    from passport.measure import Orders, measure

    state = StateDir.choose(state_dir)
    launch = Launch.find(state, file, endpoint, keys_dir)
    loads = tuple(dict.fromkeys(load or LOADS_PERCENT))
    orders = Orders(source, lidar, out, runs, loads, faults_named(fault or ()), not without)
    measure(file, launch, state, Launch.running(state), orders)


RecordFile = Annotated[Path, argument("FILE", "A passport: the record of `measure`, or a page of `report`.")]


@command(passport_app, "report")
def passport_report(
    *,
    file: RecordFile,
    html: Annotated[Path, option("--html", "OUT.html", "The page to write.")] = Path("passport.html"),
    keys: Annotated[
        Path | None,
        option(
            "--keys",
            "DIR",
            "Sign with this bundle of the robot's computer (role supervisor). Default: do not sign.",
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Write a passport as one HTML page, for screen and paper, with the record inside."""
    from passport.reading import report

    written = report(file, html, keys)
    by = "not signed: give --keys" if written.signer is None else f"signed by {written.signer}"
    answer(written._asdict(), f"{written.page}, {by}. {written.shows}", as_json=as_json)


@command(passport_app, "verify")
def passport_verify(
    *,
    file: RecordFile,
    keys: Annotated[
        Path, option("--keys", "DIR", "A bundle, or another directory with the authority.pem that you trust.")
    ],
    as_json: Json = False,
) -> int:
    """Check who signed a passport, and that its page shows what was signed.

    Exit 1 if it is not signed, was changed, or is signed by another authority.
    """
    from deploy.keys.signatures import SignatureError
    from passport.reading import check

    try:
        found = check(file, keys)
    except SignatureError as error:
        answer({"page": str(file), "problem": str(error)}, f"{file} {error}", as_json=as_json)
        return 1
    sentence = f"{found.page}: signed by {found.signer}; SHA-256 of the record {found.sha256}. {found.shows}"
    answer(found._asdict(), sentence, as_json=as_json)
    return 0


@command(passport_app, "diff")
def passport_diff(
    *,
    old: Annotated[Path, argument("OLD", "The earlier passport.")],
    new: Annotated[Path, argument("NEW", "The later one.")],
    as_json: Json = False,
) -> int:
    """Compare the limits of two passports of the same cells.

    Exit 1 if a limit became worse or is no longer known, or if the robot did not stop, 2 if there is nothing to compare.
    """
    from passport.reading import compare

    return compare(old, new, as_json=as_json)
