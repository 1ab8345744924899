"""Compares the supervisor with other transports: `python -m bench.peers`.

It measures the round trip of a command and the detection of a death. A *relay* passes each message on. A
*driver* sends messages and receives what the relay passes on. A *holder* is present until it is killed, and a
*watcher* detects its end. Links and programs run in the environment `.peers` (`make bench-peers`), so they
import nothing of Lifeline, except for `links/lifeline_link.py`, which runs in `.venv`.
"""
