"""Compares the supervisor with other ways to pass a command on and to notice a death: `python -m bench.peers`.

A *relay* passes each message on. A *driver* sends messages and receives what the relay passes on. A *holder* is present until it
is killed, and a *watcher* notices its end. Links and programs run in the environment `.peers` (`make bench-peers`), so they import
nothing of Lifeline but `links/lifeline_link.py`, which runs in `.venv`.
"""
