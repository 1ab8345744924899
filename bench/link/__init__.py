"""Measures false stops over links that lose packets: `python -m bench.link` (root).

* conditions.py: links, loss and round trip (pure)
* router.py: loses, delays and reorders packets (pure)
* stops.py: counts the stops of a flow with the verdicts of the law (pure)
* lateness.py: how late a part of the bench itself acts (pure)
* namespaces.py: two network namespaces whose only connection is the router
* sessions.py: the Zenoh sessions, with mutual TLS
* children.py: a process for each operator and each robot
* relay.py, sender.py, receiver.py: the programs of a round; relay.py is the router's shell
* run.py: one round, all conditions at once
* results.py, table.py: the stored measurements, their tables and targets

All conditions share one pair of namespaces: each has addresses of its own, by which the router recognizes it.
"""
