"""How many robots one router serves: hubs that dial out, operators behind the router, certificates on every link.

__main__.py    the options
layout.py    a router and hubs in the place of single robots (bench.robots measures them)
table.py    the results as a table and as verdicts (pure)
"""
