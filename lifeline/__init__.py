"""The command `lifeline`: what an operator starts, looks at, understands and proves.

`cli/` has the options of every command, and each other file or folder has one command or one group of commands.
"""
