"""Messages name the `lifeline` of this environment, the first on the PATH; the sockets of a test process have a directory of their own.

A hub that starts removes what ended hubs have left in its directory: those of other tests too, which may still look at it.
"""

import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from wire.zenoh import local_socket

os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
_sockets = TemporaryDirectory(prefix="lifeline-run-", ignore_cleanup_errors=True)
os.environ[local_socket.ENVIRONMENT] = _sockets.name
