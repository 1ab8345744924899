"""`python -m ros2`: the ROS 2 side of a robot. It runs in an environment with rclpy (`make ros2`)."""

import sys
from importlib.util import find_spec

NEEDED = ("numpy", "pydantic", "zenoh")
"""rclpy is checked later, because a robot with rmw_zenoh does not need it."""

if __name__ == "__main__":
    missing = [name for name in NEEDED if find_spec(name) is None]
    if missing:
        print(
            f"ros2: {sys.executable} has no {', '.join(missing)}: create the environment with `make ros2`, or name the "
            "interpreter of one in [ros2] python",
            file=sys.stderr,
        )
        sys.exit(2)  # a restart changes nothing
    from ros2.program import main

    main()
