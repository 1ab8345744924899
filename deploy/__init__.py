"""The command-line tool `lifeline`, one file for each command, and the configuration files.

entry.py           the entry point of `lifeline`
cli.py             the options of every command; cli_inspection.py those of topic, node, graph and doctor; cli_ros2.py those of ros2; cli_keys.py those of keys; command.py what they share
up.py              `lifeline up`: start the stack, with teleop in this terminal; down.py stops it; estop.py reports a latched e-stop
estop_press.py     `lifeline estop`: press the emergency stop once; estop_station.py `lifeline estop --name`: be an e-stop station
status.py          `lifeline status`: print the status once
demo.py            `lifeline demo`: a few trials of the real campaign and a drive at a rack; verdict.py one promise, bound and measurement
path.py            `lifeline path`: drive squares, circles and recorded paths
ros2_exec.py       `lifeline ros2 exec`: run a ROS 2 program with a token; ros2_run.py run the ROS 2 process
record.py          `lifeline record`: record all messages
render.py          `lifeline render`: draw the robot; picture.py the options; film.py the frames; rehearsal.py robot, law and operator in simulated time
check.py           `lifeline check`: check a configuration; check_motions.py permitted motions; check_risks.py risks; check_ros2.py the ROS 2 side
incidents.py       `lifeline incidents`: list, show and export black boxes
replay.py          `lifeline replay-decision`: run the law again over a black box recording
keys/              `lifeline keys`: an authority, its certificates, and the bundles for other computers
stack/             start, find, observe and stop the running robot
campaign/          `lifeline faults` and `fault-report`: fault injection at random moments, on real processes and in virtual time
supervisord.conf   the programs that supervisord runs
robot.toml         every key of the configuration, with its default
systemd/           the units that start a real robot at boot
examples/          configurations of real robots and of zenoh-bridge-ros2dds

Commands use campaign/, keys/ and stack/, campaign/ and keys/ use stack/, never the reverse.
"""
