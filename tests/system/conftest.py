"""Messages name the `lifeline` of this environment, the first on the PATH; the sockets of a test process have a directory of their own.

A hub that starts removes what ended hubs have left in its directory: those of other tests too, which may still look at it.
"""

import os
import signal
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.marks import pytest_configure
from wire.zenoh import local_socket

__all__ = ["pytest_configure"]

# A background job of a shell ignores SIGINT, and one of nohup SIGHUP; so would every program that a test starts.
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)

os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
_sockets = TemporaryDirectory(prefix="lifeline-run-", ignore_cleanup_errors=True)
os.environ[local_socket.ENVIRONMENT] = _sockets.name
