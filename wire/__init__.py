"""The contract between the processes: keys, messages, stamps, stop reasons and freshness. Start in `topics.py`.

`wire/zenoh` is how it travels, `wire/host` the process on its machine.
"""

import os

# Otherwise Pydantic searches all installed packages for plugins, which takes a tenth of a process's start.
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
