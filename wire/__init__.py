"""The interface between the processes: keys, messages, encoding and transport.

topics.py       every key, with its message type, writer and rate (one table)
message_types.py    Lifeline's own message types
ros.py          the standard ROS 2 message types in use
messages.py     CDR encoding of the messages (rosbags); msg/ has their definitions
reasons.py      the stop reasons, with their names and their texts on every screen
stamp.py        the attachment of each sample: sequence, source time, epoch
bearing.py      the words for a bearing, the same in every program (pure)
freshness.py    age of a command from its stamp, despite network delays (pure)
lease.py        challenges between the supervisor and an e-stop station (pure)
watchdog.py     the base's own command watchdog (pure), for sim and every base adapter
roles.py        the roles of the participants, and the common names of their certificates (pure)
foreign_nodes.py    ROS 2 nodes that use the keys of rmw_zenoh (pure)
limits.py       what the hub permits its clients (pure)
process_limits.py   open files, memory and closing sockets of this process
inbox.py        the inbox between the network's threads and asyncio
bus.py          the Bus that services use: messages
bus_config.py   how a process reaches the bus of one robot (pure)
connect.py      opens Zenoh's session of a hub, a client or a router, with its certificates
session.py      a Zenoh session: bytes; only connect.py, session.py and zenoh_calls.py import Zenoh
bundle.py       the certificates and the key of a participant, and their check
tls.py          endpoints with certificates, and Zenoh's settings for them (pure)
link_trouble.py    why a link is refused: Zenoh's log lines as sentences (pure); zenoh_log.py reads them; link_probe.py tries once
zenoh_bus.py    the Bus over a Zenoh session
config.py       robot.toml, strictly checked
quantities.py   bounds of the numbers in robot.toml
command_line.py shared parts of the processes' command lines
extras.py       the extras of an installation, and how to install a missing one
state_directory.py    where logs, black boxes and the e-stop record are
notify.py       reports to systemd: ready, running, stopping
process.py      guaranteed end of a process: signals, exceptions, a bounded close
memory_keeper.py    helper process, so that a killed process's sockets close immediately
"""
