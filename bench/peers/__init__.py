"""Compares the supervisor with other ways to pass a command on and to notice a death: `python -m bench.peers`.

* links/: one file for each transport, with the same functions, and the message
* relay.py, driver.py, holder.py, watcher.py, feeder.py: the processes
* kinds.py: what is compared, and how it is started
* round_trip.py, death.py: the measurements
* table.py: statistics and the document

A *relay* passes each message on. A *driver* sends messages and receives what the relay passes on. A *holder* is present
until it is killed, and a *watcher* notices its end. Links and processes run in the environment `.peers` (`make bench-peers`), so they
import nothing of Lifeline but `links/lifeline_link.py`, which runs in `.venv`.
"""
