"""The operator's side: what starts the processes, looks at them, and takes them down again.

cli.py             the command `lifeline`: its options, and nothing else
up.py              `lifeline up`: the stack, with teleop in this terminal
status.py          `lifeline status`: one look
demo.py            `lifeline demo`: the promises of the design, measured on the running stack
path.py            `lifeline path`: squares, circles, and what was recorded
record.py          `lifeline record`; recording.py the file, written and read
render.py          `lifeline render`; picture.py what is wanted; film.py its pictures; rehearsal.py robot, law and operator in simulated time
faults/            `lifeline faults`: everything broken at random moments, for real and in virtual time
soak.py            `lifeline soak`: hours of it, and what grows
check.py           `lifeline check`; check_motions.py what the law permits; check_risks.py what may happen
replay.py          `lifeline replay-decision`: the law once more over a black box
verdict.py         one promise with its bound and what was measured
preflight.py       the configuration and the scene, and whether they fit together, before anything starts
robot_file.py      every section of a robot.toml, against each other
stack.py           sim and supervisor as one thing: start, wait until alive, stop
supervisord.py     supervisord itself: fetched by uv, asked over its socket
processes.py       which processes belong to a state directory, and signals to them
statedir.py        the state directory: its files, its lock
launch.py          what the children are started with, checked before anything starts
keyboard.py        the real teleop on a pseudo-terminal, and a hand that types
samples.py         what the robot is told and does, as several of these see it (pure)
observe.py         what a client of the wire sees, with the time of each arrival
interrupts.py      SIGINT, SIGTERM and SIGHUP as one exception, once
errors.py          what is told in one sentence and ends with exit code 2
supervisord.conf   the programs under supervisord
robot.toml         every key of the configuration, with its default
examples/          configurations of real robots
"""
