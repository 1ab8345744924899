"""The command `lifeline`: what an operator starts, looks at, understands and proves.

`cli/` declares the options of every command, with the decorators of `command.py`; each other file or folder has one command or
one group of commands.
"""
