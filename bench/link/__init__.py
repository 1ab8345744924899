"""Measures false stops over links that lose packets: `python -m bench.link` (root).

All conditions share one pair of network namespaces: each has its own addresses, by which the router
recognizes it.
"""
