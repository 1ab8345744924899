"""The operator's side: one file for each command of `lifeline`, and the files of the configuration.

cli.py             the command `lifeline`: its options, and nothing else
up.py              `lifeline up` and `down`: the stack, with teleop in this terminal; estop.py what to know of an old e-stop
status.py          `lifeline status`: one look
demo.py            `lifeline demo`: the promises of the design, measured on the running stack; verdict.py one of them
path.py            `lifeline path`: squares, circles, and what was recorded
record.py          `lifeline record`; recording.py the file, written and read
render.py          `lifeline render`; picture.py what is wanted; film.py its pictures; rehearsal.py robot, law and operator in simulated time
check.py           `lifeline check`; check_motions.py what the law permits; check_risks.py what may happen
replay.py          `lifeline replay-decision`: the law once more over a black box
stack/             the running robot: started, found, observed, ended
campaign/          `lifeline faults`, `fault-report` and `soak`: everything broken at random moments, for real and in virtual time
supervisord.conf   the programs under supervisord
robot.toml         every key of the configuration, with its default
examples/          configurations of real robots

Commands use campaign/ and stack/, campaign/ uses stack/, and none the other way round.
"""
