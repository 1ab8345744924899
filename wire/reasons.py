"""The stop reasons: their names in SafetyStatus, and their texts on every screen."""

from collections.abc import Mapping
from enum import StrEnum
from typing import NamedTuple


class StopReason(StrEnum):
    """Why the robot is stopped, most severe first; the status lists the reasons in this order."""

    ESTOP = "ESTOP"
    ESTOP_STATION_LOST = "ESTOP_STATION_LOST"
    ESTOP_UNRECORDED = "ESTOP_UNRECORDED"
    BASE_RUNAWAY = "BASE_RUNAWAY"
    OVERRUN = "OVERRUN"
    SENSOR_CONFLICT = "SENSOR_CONFLICT"
    SENSOR_MISMATCH = "SENSOR_MISMATCH"
    BASE_UNRESPONSIVE = "BASE_UNRESPONSIVE"
    ODOM_STALE = "ODOM_STALE"
    SCAN_INVALID = "SCAN_INVALID"
    SCAN_STALE = "SCAN_STALE"
    SOURCE_LOST = "SOURCE_LOST"
    COMMAND_INVALID = "COMMAND_INVALID"
    COMMAND_STALE = "COMMAND_STALE"
    COMMAND_TIMEOUT = "COMMAND_TIMEOUT"
    NO_COMMAND = "NO_COMMAND"
    SCAN_BLIND = "SCAN_BLIND"
    OBSTACLE = "OBSTACLE"


class Limit(StrEnum):
    """What reduces the speed, beside the barrier, without a stop: named in the status after the causes."""

    COMMAND_AGE = "COMMAND_AGE"
    BASE_UNMEASURED = "BASE_UNMEASURED"
    BASE_WEAK = "BASE_WEAK"
    IN_THE_OPEN = "IN_THE_OPEN"
    MOUNT_UNCONFIRMED = "MOUNT_UNCONFIRMED"


SEVERITY = {reason: rank for rank, reason in enumerate(StopReason)}


class Words(NamedTuple):
    """The texts for one stop reason."""

    now: str
    """Text while the cause holds; WHO stands for the command source."""
    over: str
    """Text after the cause has ended, while a neutral command is still required."""
    caption: str
    """A short form, for pictures and videos."""
    step: str
    """What to do next; NEUTRAL stands for how the display asks for a neutral command."""


WORDS: Mapping[StopReason, Words] = {
    StopReason.ESTOP: Words(
        now="the emergency stop is latched",
        over="the emergency stop was pressed, and has been reset",
        caption="emergency stop",
        step="NEUTRAL, then r to reset",
    ),
    StopReason.ESTOP_STATION_LOST: Words(
        now="a required e-stop station is missing, or was lost",
        over="a required e-stop station was missing",
        caption="e-stop station lost",
        step="start it, NEUTRAL, then r if still stopped",
    ),
    StopReason.ESTOP_UNRECORDED: Words(
        now="an emergency stop could not be recorded on disk",
        over="an emergency stop could not have been recorded on disk",
        caption="e-stop cannot be recorded",
        step="free or repair the state directory, NEUTRAL",
    ),
    StopReason.BASE_RUNAWAY: Words(
        now="the base moves although zero is commanded",
        over="the base moved although zero was commanded",
        caption="the base moves by itself",
        step="cut the robot's power",
    ),
    StopReason.OVERRUN: Words(
        now="the supervisor was late, or its machine was suspended",
        over="the supervisor was late",
        caption="the supervisor was late",
        step="NEUTRAL to re-arm",
    ),
    StopReason.SENSOR_CONFLICT: Words(
        now="two programs publish on one sensor's key",
        over="two programs published on one sensor's key",
        caption="two writers on one sensor's key",
        step="stop one of the two programs, NEUTRAL",
    ),
    StopReason.SENSOR_MISMATCH: Words(
        now="the scans contradict the measured motion",
        over="the scans contradicted the measured motion",
        caption="lidar or odometry contradicts the configuration",
        step="correct yaw_rad, flip or odometry, and restart",
    ),
    StopReason.BASE_UNRESPONSIVE: Words(
        now="the base does not follow its commands",
        over="the base did not follow its commands",
        caption="the base does not follow",
        step="check the base and its e-stop, NEUTRAL",
    ),
    StopReason.ODOM_STALE: Words(
        now="odometry was lost",
        over="there was no odometry",
        caption="no odometry",
        step="wait for odometry, NEUTRAL",
    ),
    StopReason.SCAN_INVALID: Words(
        now="the lidar's scan proves nothing",
        over="the lidar's scans proved nothing",
        caption="the lidar's scans prove nothing",
        step="check the lidar, NEUTRAL",
    ),
    StopReason.SCAN_STALE: Words(
        now="there is no fresh scan",
        over="there was no fresh scan",
        caption="no fresh scan",
        step="check the lidar, NEUTRAL",
    ),
    StopReason.SOURCE_LOST: Words(
        now="the connection to WHO was lost",
        over="the connection to a command source was lost",
        caption="command source lost",
        step="NEUTRAL to re-arm",
    ),
    StopReason.COMMAND_INVALID: Words(
        now="WHO sent an invalid command",
        over="a command was invalid",
        caption="invalid command",
        step="NEUTRAL to re-arm",
    ),
    StopReason.COMMAND_STALE: Words(
        now="the commands of WHO arrive too late or out of order",
        over="commands arrived too late or out of order",
        caption="commands come too late",
        step="NEUTRAL to re-arm",
    ),
    StopReason.COMMAND_TIMEOUT: Words(
        now="WHO was silent for too long",
        over="commands were missing for too long",
        caption="no fresh command",
        step="NEUTRAL to re-arm",
    ),
    StopReason.NO_COMMAND: Words(
        now="no source commands the robot",
        over="no source commanded the robot",
        caption="no command source",
        step="NEUTRAL to arm",
    ),
    StopReason.SCAN_BLIND: Words(
        now="the motion would enter unseen space",
        over="the motion would have entered unseen space",
        caption="would enter unseen space",
        step="NEUTRAL, or drive where the lidar sees",
    ),
    StopReason.OBSTACLE: Words(
        now="too close for this motion",
        over="something was too close",
        caption="obstacle too close",
        step="NEUTRAL, or drive away from it",
    ),
}

LIMIT_WORDS: Mapping[Limit, Words] = {
    Limit.COMMAND_AGE: Words(
        now="the commands of WHO come too rarely for this speed",
        over="commands came too rarely for the speed",
        caption="commands too rare for this speed",
        step="slow down, or mend the connection",
    ),
    Limit.BASE_UNMEASURED: Words(
        now="the brakes of the base are unknown",
        over="the brakes of the base were unknown",
        caption="base not measured",
        step="stop once from 0.4 m/s or more, or set deceleration_m_s2",
    ),
    Limit.BASE_WEAK: Words(
        now="the base brakes worse, or reacts later, than configured",
        over="the base braked worse, or reacted later, than configured",
        caption="weak or late brakes",
        step="reduce the load, or set deceleration_m_s2 and base_dead_time_s to what the base shows",
    ),
    Limit.IN_THE_OPEN: Words(
        now="a lidar has hardly any return",
        over="a lidar had hardly any return",
        caption="hardly any return",
        step="drive slowly, or where the lidar has returns",
    ),
    Limit.MOUNT_UNCONFIRMED: Words(
        now="no motion has confirmed yet where the lidars look",
        over="no motion had confirmed where the lidars look",
        caption="lidar mounting not confirmed",
        step="drive straight on and turn, with walls in sight",
    ),
}

_BY_NAME = {str(reason): words for reason, words in (*WORDS.items(), *LIMIT_WORDS.items())}


def words_of(name: str) -> Words | None:
    """Return the texts for a reason's name in a status; None if this version does not know the name."""
    return _BY_NAME.get(name)
