"""Draws docs/images/warehouse.png, the warehouse of docs/how-to/view.md: `python -m docs.generate.draw_warehouse`."""

import argparse
import math
import sys
from pathlib import Path

from sim.config import Build, SceneError
from sim.gl import NoGlError, choose
from sim.overlay import Mode, Shown
from sim.plant import Plant
from sim.render import Studio, View
from sim.video import OutputError, Pixels, refuse_bad_output, write

IMAGE = Path(__file__).parents[1] / "images" / "warehouse.png"

# Camera, the robot's drive to its place (v in m/s, ω in rad/s, duration in s), and time of the picture, which shows the
# forklift and a person.
_VIEW = View((-2.2, -1.3, 0.45), 4.7, -42.0, -26.0)
_DRIVE_OUT = ((0.0, 0.0, 3.7), (0.8, 0.0, 1.5), (0.8, 0.3, 1.1))


def main(arguments: list[str] | None = None) -> int:
    """Write the picture; return 1 if this machine cannot render, 2 for wrong arguments."""
    parser = argparse.ArgumentParser(prog="python -m docs.generate.draw_warehouse", description=__doc__)
    parser.add_argument("--out", type=Path, default=IMAGE, help="the PNG file to write")
    parser.add_argument("--width", type=int, default=1280, help="in pixels, default 1280")
    parser.add_argument("--height", type=int, default=720, help="in pixels, default 720")
    options = parser.parse_args(arguments)
    try:
        choose()
        refuse_bad_output(options.out, options.width, options.height, frames=1)
        write(options.out, [_warehouse(options.width, options.height)], fps=1.0)
    except (OutputError, SceneError) as error:
        print(f"The picture cannot be written: {error}", file=sys.stderr)
        return 2
    except NoGlError as error:
        print(f"The warehouse cannot be drawn here: {error}.", file=sys.stderr)
        return 1
    return 0


def _warehouse(width: int, height: int) -> Pixels:
    """Return a picture of the warehouse with the robot in its aisle."""
    plant = Plant(options=Build(moving=True, scenery=True))
    for linear_m_s, angular_rad_s, duration_s in _DRIVE_OUT:
        plant.step((linear_m_s, angular_rad_s), round(duration_s / plant.timestep_s))
    with Studio(plant, width, height) as studio:
        shown = Shown(Mode.DRIVING, (), plant.true_velocity.linear_m_s, math.nan, (plant.scan(),))
        return studio.picture(_VIEW, shown)


if __name__ == "__main__":
    sys.exit(main())
