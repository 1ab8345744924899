"""Benchmarks of time and memory: the law, the supervisor, teleop and the sim. They are not tests and never fail.

law.py         step(): time and memory, compared with plain numpy on the same arrays
process.py     the real supervisor process over real Zenoh: CPU, memory, rate and gaps of cmd_vel
heartbeat.py   the real teleop in a terminal: lateness of its heartbeat while it draws
soak.py        drive for hours: growth of memory, descriptors, threads and latency; stops without a cause
relay.py       reference for process.py: the supervisor's traffic without a law
sim.py         the simulated robot, unpaced, compared with MuJoCo alone
start.py       imports of each process, `lifeline up`, and the restart of a killed supervisor
report.py      the results as tables, verdicts and JSON lines
__main__.py    python -m bench

peers/           the supervisor beside bare relays over Zenoh, MQTT, DDS, rclpy and TCP
robots/          many robots on one machine
fleet.py         many robots behind one router
link/            false stops over links that lose packets
ros2_crash/      kill, stop and unplug the keyboard node of a ROS 2 robot, without and with Lifeline
rig/             what all of them share
"""
