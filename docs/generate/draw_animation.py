"""Draws docs/images/demo.webp, the animation of the README: `python -m docs.generate.draw_animation`; about a minute.

The plant and the law are the real ones: the robot is driven at someone who walks in its aisle, it slows, rests at
30 cm while the key is still held, and backs out.
"""

import sys
from pathlib import Path

from deploy.stack.errors import DeployError
from lifeline.render.render import Wanted, film, parse_size
from sim.gl import NoGlError
from sim.render import View

IMAGES = Path(__file__).parents[1] / "images"
WANTED = Wanted(
    out=IMAGES / "demo.webp",
    scene=str(Path(__file__).with_name("animation.toml")),
    size="800x450",
    seconds=8.6,
    fps=15.0,
    drive=True,
)
VIEW = View((0.05, 0.12, 0.36), 3.75, 14.0, -26.0)


def main() -> int:
    """Writes it; 1 with one sentence on stderr where it cannot be."""
    try:
        film(WANTED, *parse_size(WANTED.size), VIEW, pillar=False)
    except (DeployError, NoGlError) as error:
        print(f"The animation cannot be drawn: {error}.", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
