"""The drawing of a robot as Foxglove's messages. Pure."""

from collections.abc import Iterable

from foxglove.messages import (
    Color,
    FrameTransform,
    FrameTransforms,
    KeyValuePair,
    LinePrimitive,
    LinePrimitiveLineType,
    Point3,
    Quaternion,
    SceneEntity,
    SceneUpdate,
    Timestamp,
    Vector3,
)

from lifeline.robot_drawing import Outline, Transform
from wire.messages import Time

COLOURS = {
    "hull": Color(r=0.35, g=0.65, b=1.0, a=1.0),
    "stop": Color(r=0.95, g=0.2, b=0.2, a=1.0),
    "warning": Color(r=1.0, g=0.75, b=0.1, a=1.0),
}
THICKNESS_M = 0.02
NS_IN_S = 1_000_000_000


def transforms_message(transforms: Iterable[Transform]) -> FrameTransforms:
    """Return the transforms as one message."""
    return FrameTransforms(
        transforms=[
            FrameTransform(
                timestamp=_timestamp(one.time),
                parent_frame_id=one.parent,
                child_frame_id=one.child,
                translation=Vector3(x=one.translation.x, y=one.translation.y, z=one.translation.z),
                rotation=Quaternion(x=one.rotation.x, y=one.rotation.y, z=one.rotation.z, w=one.rotation.w),
            )
            for one in transforms
        ]
    )


def scene_message(outlines: Iterable[Outline], frame: str, time_ns: int) -> SceneUpdate:
    """Return the outlines as entities that move with a frame."""
    return SceneUpdate(
        entities=[
            SceneEntity(
                timestamp=Timestamp(*divmod(time_ns, NS_IN_S)),
                frame_id=frame,
                frame_locked=True,
                id=outline.name,
                metadata=[KeyValuePair(key="distance_m", value=f"{outline.distance_m:g}")],
                lines=[
                    LinePrimitive(
                        type=LinePrimitiveLineType.LineLoop,
                        thickness=THICKNESS_M,
                        points=[Point3(x=x_m, y=y_m, z=0.0) for x_m, y_m in outline.points.tolist()],
                        color=COLOURS[outline.name],
                    )
                ],
            )
            for outline in outlines
        ]
    )


def _timestamp(time: Time) -> Timestamp:
    """Return the nearest valid timestamp: that of a foreign message may be negative, or have too many nanoseconds."""
    return Timestamp(max(0, time.sec), min(time.nanosec, NS_IN_S - 1))
