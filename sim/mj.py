"""MuJoCo, with types: the one file that imports it, because it ships none that a strict checker can read.

Shapes are MuJoCo's: nq positions, nv velocities, nu controls; lengths in m, angles in rad, world frame.
"""

import importlib
from enum import IntEnum
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

mujoco: Any = importlib.import_module("mujoco")

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


class Shape(IntEnum):
    """The geom types that we build with."""

    PLANE = int(mujoco.mjtGeom.mjGEOM_PLANE)
    SPHERE = int(mujoco.mjtGeom.mjGEOM_SPHERE)
    ELLIPSOID = int(mujoco.mjtGeom.mjGEOM_ELLIPSOID)
    CYLINDER = int(mujoco.mjtGeom.mjGEOM_CYLINDER)
    BOX = int(mujoco.mjtGeom.mjGEOM_BOX)


class Model(Protocol):
    """What we use of `mujoco.MjModel`."""

    ngeom: int
    opt: Any
    vis: Any
    geom_type: Ints
    geom_group: Ints
    geom_conaffinity: Ints
    geom_bodyid: Ints
    geom_size: Floats
    body_pos: Floats
    body_mocapid: Ints
    body_rootid: Ints
    jnt_qposadr: Ints
    jnt_dofadr: Ints
    sensor_adr: Ints


class Data(Protocol):
    """What we use of `mujoco.MjData`; its arrays are views that stay valid, so keep them."""

    time: float
    qpos: Floats
    qvel: Floats
    ctrl: Floats
    sensordata: Floats
    mocap_pos: Floats
    geom_xpos: Floats
    geom_xmat: Floats


def load(path: Path) -> Model:
    """Compiles an MJCF file.

    Raises:
        ValueError: The file is missing or no valid model.
    """
    return mujoco.MjModel.from_xml_path(str(path))


def load_string(xml: str) -> Model:
    """Compiles MJCF text, for tests."""
    return mujoco.MjModel.from_xml_string(xml)


def make_data(model: Model) -> Data:
    return mujoco.MjData(model)


def body_id(model: Model, name: str) -> int:
    return _id(model, "body", name)


def geom_id(model: Model, name: str) -> int:
    return _id(model, "geom", name)


def joint_id(model: Model, name: str) -> int:
    return _id(model, "joint", name)


def actuator_id(model: Model, name: str) -> int:
    return _id(model, "actuator", name)


def sensor_id(model: Model, name: str) -> int:
    return _id(model, "sensor", name)


def _id(model: Model, kind: str, name: str) -> int:
    found = int(mujoco.mj_name2id(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), name))
    if found < 0:
        raise ValueError(f"The model has no {kind} named {name!r}.")
    return found


def reset_to_keyframe(model: Model, data: Data, index: int) -> None:
    mujoco.mj_resetDataKeyframe(model, data, index)


def forward(model: Model, data: Data) -> None:
    """Makes everything derived (poses, contacts, sensors) agree with the positions."""
    mujoco.mj_forward(model, data)


def kinematics(model: Model, data: Data) -> None:
    """Makes the poses of bodies and geoms agree with the positions."""
    mujoco.mj_kinematics(model, data)


step = mujoco.mj_step
multi_ray = mujoco.mj_multiRay
geom_distance = mujoco.mj_geomDistance
