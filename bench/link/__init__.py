"""Measures false stops over links that lose packets: `python -m bench.link` (root).

All conditions share one pair of network namespaces: each has addresses of its own, by which the router recognizes it.
"""
