"""The operator's side: one file for each command of `lifeline`, and the files of the configuration.

cli.py             the command `lifeline`: its options, and nothing else
up.py              `lifeline up`: the stack, with teleop in this terminal; down.py ends it; estop.py reports an e-stop that is still latched
status.py          `lifeline status`: print the status once
demo.py            `lifeline demo`: a few trials of the real campaign and a drive at a rack; verdict.py one promise, bound and measurement
path.py            `lifeline path`: squares, circles, and what was recorded
record.py          `lifeline record`; recording.py the file, written and read
render.py          `lifeline render`; picture.py what is wanted; film.py its pictures; rehearsal.py robot, law and operator in simulated time
check.py           `lifeline check`; check_motions.py what the law permits; check_risks.py what may happen
replay.py          `lifeline replay-decision`: run the law again over a black box
stack/             the running robot: started, found, observed, ended
campaign/          `lifeline faults`, `fault-report` and `soak`: fault injection at random moments, on real processes and in virtual time
supervisord.conf   the programs under supervisord
robot.toml         every key of the configuration, with its default
examples/          configurations of real robots

Commands use campaign/ and stack/, campaign/ uses stack/, never the reverse.
"""
