"""The interface between the processes: keys, messages, encoding and transport.

topics.py       every key, with its message type, writer and rate (one table)
message_types.py    Lifeline's own message types
ros.py          the standard ROS 2 message types in use
messages.py     CDR encoding of the messages (rosbags); msg/ has their definitions
cdr.py          encoding and decoding of the most frequent messages by offset
reasons.py      the stop reasons, with their names and their texts on every screen
stamp.py        the attachment of each sample: sequence, source time, epoch
standstill.py   the speeds below which a robot counts as standing (pure)
outline.py      the line at a distance from the hull, for every picture of it (pure)
text.py         text for screens: foreign text made printable, bearings in words (pure)
freshness.py    age of a command from its stamp, despite network delays (pure)
lease.py        challenges between the supervisor and an e-stop station (pure)
runs.py         which runs have ended with their sessions, and which samples count after a reconnection (pure)
watchdog.py     the base's own command watchdog (pure), for sim and every base adapter
roles.py        the roles of the participants, and the common names of their certificates (pure)
access.py       what the hub accepts from each role (pure)
bundle.py       the certificates and the key of a participant, and their check
tls.py          endpoints with certificates, and Zenoh's settings for them (pure)
inbox.py        the inbox between the network's threads and asyncio
bus.py          the Bus that services use: messages
bus_config.py   how a process reaches the bus of one robot (pure)
zenoh/          the transport: sessions, links, routers
host/           the process on its machine: configuration, limits, end
"""
