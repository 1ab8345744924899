"""The contract between the processes: keys, messages, stamps, stop reasons and freshness. Start in `topics.py`.

`wire/zenoh` is how it travels, `wire/host` the process on its machine.
"""
