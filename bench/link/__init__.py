"""Measures false stops over links that lose packets: `python -m bench.link` (root).

* relay.py: loses, delays and reorders packets; a pure router and its program
* stops.py: counts the stops of a flow with the verdicts of the law, and how late the bench itself is (pure)
* namespaces.py: two network namespaces whose only connection is the router
* flows.py: the programs of the operators and the robots, with real Zenoh sessions
* run.py: one round, all conditions at once
* results.py: the conditions, the stored measurements, their tables and targets (pure)

All conditions share one pair of namespaces: each has addresses of its own, by which the router recognizes it.
"""
