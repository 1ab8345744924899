"""Messages name `lifeline` as it is found on the PATH."""

import os
import sys
from pathlib import Path

os.environ["PATH"] += f"{os.pathsep}{Path(sys.executable).parent}"
