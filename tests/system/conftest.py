"""Messages name `lifeline` as it is found on the PATH, and the sockets of a test process have a directory of their own.

A hub that starts removes what ended hubs have left in its directory: those of other tests too, which may still look at it.
"""

import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from wire.zenoh import local_socket

os.environ["PATH"] += f"{os.pathsep}{Path(sys.executable).parent}"
_sockets = TemporaryDirectory(prefix="lifeline-run-", ignore_cleanup_errors=True)
os.environ[local_socket.ENVIRONMENT] = _sockets.name
