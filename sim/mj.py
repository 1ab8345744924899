"""MuJoCo, with types: the one file that imports it, because it ships none that a strict checker can read.

Shapes are MuJoCo's: nq positions, nv velocities, nu controls; lengths in m, angles in rad, world frame.
"""

import importlib
from enum import IntEnum
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.lib.stride_tricks import as_strided
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
    TRIANGLE = int(mujoco.mjtGeom.mjGEOM_TRIANGLE)  # to be looked at only


FAR_M = 100.0
"""Distances beyond this are of no interest."""

ELLIPTIC = int(mujoco.mjtCone.mjCONE_ELLIPTIC)


class Model(Protocol):
    """What we use of `mujoco.MjModel`."""

    ngeom: int
    nbody: int
    nkey: int
    ncam: int
    opt: Any
    vis: Any
    stat: Any
    geom_type: Ints
    geom_group: Ints
    geom_conaffinity: Ints
    geom_bodyid: Ints
    geom_size: Floats
    geom_pos: Floats
    geom_quat: Floats
    geom_friction: Floats
    geom_rbound: Floats
    body_pos: Floats
    body_quat: Floats
    body_mass: Floats
    body_inertia: Floats
    body_mocapid: Ints
    body_rootid: Ints
    body_weldid: Ints
    jnt_qposadr: Ints
    jnt_dofadr: Ints
    sensor_adr: Ints


Camera = Any
"""An `MjvCamera`, or the name of one of a model's own."""


class Data(Protocol):
    """What we use of `mujoco.MjData`; its arrays are views that stay valid, so keep them."""

    time: float
    qpos: Floats
    qvel: Floats
    ctrl: Floats
    sensordata: Floats
    mocap_pos: Floats
    mocap_quat: Floats
    contact: Any
    geom_xpos: Floats
    geom_xmat: Floats


Spec = Any
"""A `mujoco.MjSpec`: a model that can still be changed."""


def load_spec(path: Path) -> Spec:
    """Reads an MJCF file, with what it includes.

    Raises:
        ValueError: The file is no valid MJCF.
    """
    return mujoco.MjSpec.from_file(str(path))


def compile_spec(spec: Spec) -> Model:
    """Makes the model that can be simulated.

    Raises:
        ValueError: What is in the spec does not fit together.
    """
    try:
        return spec.compile()
    except mujoco.FatalError as error:
        raise ValueError(str(error)) from error


def one_line(error: Exception) -> str:
    """What an exception says, without its line breaks."""
    return " ".join(str(error).split()).removeprefix("Error: ")


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


def geom_label(model: Model, geom: int) -> str:
    """What a person calls a geom: by its own name, or by its body's, or by its number."""
    for kind, index in (("geom", geom), ("body", int(model.geom_bodyid[geom]))):
        name: str | None = mujoco.mj_id2name(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), index)
        if name and name != "world":
            return name
    return f"geom {geom}"


def _id(model: Model, kind: str, name: str) -> int:
    found = int(mujoco.mj_name2id(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), name))
    if found < 0:
        raise ValueError(f"The model has no {kind} named {name!r}.")
    return found


def reset(model: Model, data: Data) -> None:
    """Back to the first keyframe, or to the model's own poses where there is none."""
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    else:
        mujoco.mj_resetData(model, data)


def forward(model: Model, data: Data) -> None:
    """Makes everything derived (poses, contacts, sensors) agree with the positions."""
    mujoco.mj_forward(model, data)


def kinematics(model: Model, data: Data) -> None:
    """Makes the poses of bodies and geoms agree with the positions."""
    mujoco.mj_kinematics(model, data)


_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)


def get_state(model: Model, data: Data) -> Floats:
    """All that the next step depends on: time, positions, velocities, controls, mocap poses, warm start."""
    state = np.empty(mujoco.mj_stateSize(model, _STATE))
    mujoco.mj_getState(model, data, state, _STATE)
    return state


def set_state(model: Model, data: Data, state: Floats) -> None:
    """Puts back what `get_state` gave, and makes the poses of bodies and geoms agree with it."""
    mujoco.mj_setState(model, data, state, _STATE)
    mujoco.mj_kinematics(model, data)


step = mujoco.mj_step
multi_ray = mujoco.mj_multiRay
geom_distance = mujoco.mj_geomDistance


def reach_m(model: Model, data: Data) -> float:
    """How far along x or y the solid things reach from the origin; what is far below the floor does not count."""
    near = (np.abs(data.geom_xpos[:, 2]) < FAR_M / 2) & (model.geom_rbound < FAR_M)
    return float((np.abs(data.geom_xpos[near, :2]) + model.geom_rbound[near, None]).max(initial=1.0))


def camera_names(model: Model) -> list[str]:
    """The cameras that a model brings."""
    names = (mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_CAMERA, camera) for camera in range(model.ncam))
    return [name for name in names if name]


def free_camera(
    look_at_m: tuple[float, float, float], distance_m: float, azimuth_deg: float, elevation_deg: float
) -> Camera:
    """A camera that looks at a point of the world."""
    camera = mujoco.MjvCamera()
    camera.lookat[:] = look_at_m
    camera.distance, camera.azimuth, camera.elevation = distance_m, azimuth_deg, elevation_deg
    return camera


def fixed_camera(model: Model, name: str) -> Camera:
    """One of a model's own cameras."""
    camera = mujoco.MjvCamera()
    camera.type = int(mujoco.mjtCamera.mjCAMERA_FIXED)
    camera.fixedcamid = _id(model, "camera", name)
    return camera


def add_geom(scene: Any, shape: Shape, size: Floats, emission: float) -> None:  # noqa: ANN401 - untyped there
    """Appends something to be looked at to an `MjvScene`; it casts no shadow."""
    geom = scene.geoms[scene.ngeom]
    mujoco.mjv_initGeom(geom, shape, size, np.zeros(3), np.eye(3).ravel(), np.ones(4, np.float32))
    geom.emission, geom.castshadow = emission, False
    scene.ngeom += 1


class GeomArrays:
    """The geoms of an `MjvScene` as arrays, for writing: one by one takes a hundred times as long.

    MuJoCo keeps them side by side in one block for as long as the scene lives.

    Args:
        scene: The scene.
        first: The first geom.
        count: How many.

    Attributes:
        pos: In m, world frame, shape (count, 3).
        mat: Frames, shape (count, 3, 3).
        rgba: 0 to 1, shape (count, 4).
    """

    def __init__(self, scene: Any, first: int, count: int) -> None:  # noqa: ANN401 - untyped there
        self._scene = scene  # whose memory this is
        geom, following = (
            scene.geoms[first],
            scene.geoms[first + 1 if first + 1 < scene.maxgeom else first - 1],
        )
        stride = abs(_address(following.pos) - _address(geom.pos))
        self.pos = as_strided(geom.pos, (count, 3), (stride, 4))
        self.mat = as_strided(geom.mat, (count, 3, 3), (stride, 12, 4))
        self.rgba = as_strided(geom.rgba, (count, 4), (stride, 4))


def _address(array: NDArray[Any]) -> int:
    return int(array.__array_interface__["data"][0])
