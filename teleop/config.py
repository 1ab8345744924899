"""`[teleop]` of robot.toml."""

from teleop.setpoint import Steps
from wire import topics
from wire.config import Name, Positive, Section


class TeleopSection(Section):
    """Who this source is, how often it speaks, and what one key press changes."""

    source: Name = topics.TELEOP
    rate_hz: Positive = 20.0
    linear_step_m_s: Positive = 0.1
    angular_step_rad_s: Positive = 0.2
    max_linear_m_s: Positive = 1.0
    max_angular_rad_s: Positive = 2.0

    def to_steps(self) -> Steps:
        return Steps(
            self.linear_step_m_s, self.angular_step_rad_s, self.max_linear_m_s, self.max_angular_rad_s
        )
