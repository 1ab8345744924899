"""MuJoCo with types: the only file that imports it, because MuJoCo has no types that a strict checker can read.

Array shapes are MuJoCo's: nq positions, nv velocities, nu controls; lengths in m, angles in rad, world frame.
"""

import importlib
import os
import sys
from enum import IntEnum
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray


def _import_without_gl() -> Any:  # noqa: ANN401 - untyped
    """Import MuJoCo without loading a GL backend, which takes 0.1 s: on Linux, gl.py loads it where it is needed."""
    if sys.platform != "linux":
        return importlib.import_module("mujoco")
    asked = os.environ.get("MUJOCO_GL")
    os.environ["MUJOCO_GL"] = "disable"
    try:
        return importlib.import_module("mujoco")
    finally:
        del os.environ["MUJOCO_GL"]
        if asked is not None:
            os.environ["MUJOCO_GL"] = asked


mujoco: Any = _import_without_gl()

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


class Shape(IntEnum):
    """The geom types in use."""

    PLANE = int(mujoco.mjtGeom.mjGEOM_PLANE)
    SPHERE = int(mujoco.mjtGeom.mjGEOM_SPHERE)
    ELLIPSOID = int(mujoco.mjtGeom.mjGEOM_ELLIPSOID)
    CYLINDER = int(mujoco.mjtGeom.mjGEOM_CYLINDER)
    BOX = int(mujoco.mjtGeom.mjGEOM_BOX)
    TRIANGLE = int(mujoco.mjtGeom.mjGEOM_TRIANGLE)  # visual only


FAR_M = 100.0
"""Distances beyond this are not computed."""

ELLIPTIC = int(mujoco.mjtCone.mjCONE_ELLIPTIC)


class Model(Protocol):
    """The attributes of `mujoco.MjModel` in use."""

    ngeom: int
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
    geom_rbound: Floats
    body_pos: Floats
    body_mass: Floats
    body_mocapid: Ints
    body_rootid: Ints
    body_weldid: Ints
    jnt_qposadr: Ints
    jnt_dofadr: Ints
    sensor_adr: Ints


Camera = Any
"""An `MjvCamera`, or the name of a camera in the model."""


class Data(Protocol):
    """The attributes of `mujoco.MjData` in use; its arrays are views that stay valid and can be kept."""

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
"""A `mujoco.MjSpec`: a model before compilation."""


def load_spec(path: Path) -> Spec:
    """Read an MJCF file and the files that it includes.

    Raises:
        ValueError: The file is not valid MJCF.
    """
    return mujoco.MjSpec.from_file(str(path))


def compile_spec(spec: Spec) -> Model:
    """Compile a spec to a model that can be simulated.

    Raises:
        ValueError: The spec is inconsistent.
    """
    try:
        return spec.compile()
    except mujoco.FatalError as error:
        raise ValueError(str(error)) from error


def one_line(error: Exception) -> str:
    """Return the message of an exception without line breaks."""
    return " ".join(str(error).split()).removeprefix("Error: ")


def make_data(model: Model) -> Data:
    return mujoco.MjData(model)


def geom_label(model: Model, geom: int) -> str:
    """Return a readable name of a geom: its own name, else its body's, else its number."""
    for kind, index in (("geom", geom), ("body", int(model.geom_bodyid[geom]))):
        name: str | None = mujoco.mj_id2name(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), index)
        if name and name != "world":
            return name
    return f"geom {geom}"


def id_of(model: Model, kind: str, name: str) -> int:
    """Return the number of a named element: a body, geom, joint, actuator, sensor or camera."""
    found = int(mujoco.mj_name2id(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), name))
    if found < 0:
        raise ValueError(f"The model has no {kind} named {name!r}.")
    return found


def reset(model: Model, data: Data) -> None:
    """Reset the data to the first keyframe, or to the model's default poses if there is none."""
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    else:
        mujoco.mj_resetData(model, data)


_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)


def get_state(model: Model, data: Data) -> Floats:
    """Return the full integration state: time, positions, velocities, controls, mocap poses, warm start."""
    state = np.empty(mujoco.mj_stateSize(model, _STATE))
    mujoco.mj_getState(model, data, state, _STATE)
    return state


def set_state(model: Model, data: Data, state: Floats) -> None:
    """Restore a state from `get_state`, and update the poses of bodies and geoms."""
    mujoco.mj_setState(model, data, state, _STATE)
    mujoco.mj_kinematics(model, data)


forward = mujoco.mj_forward
"""Update all derived quantities (poses, contacts, sensors) from the positions."""
kinematics = mujoco.mj_kinematics
"""Update the poses of bodies and geoms from the positions."""
step = mujoco.mj_step
multi_ray = mujoco.mj_multiRay
geom_distance = mujoco.mj_geomDistance


def reach_m(model: Model, data: Data) -> float:
    """Return the largest extent [m] of the solids along x or y from the origin, without those far below the floor."""
    near = (np.abs(data.geom_xpos[:, 2]) < FAR_M / 2) & (model.geom_rbound < FAR_M)
    return float((np.abs(data.geom_xpos[near, :2]) + model.geom_rbound[near, None]).max(initial=1.0))


def camera_names(model: Model) -> list[str]:
    """Return the names of the model's cameras."""
    names = (mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_CAMERA, camera) for camera in range(model.ncam))
    return [name for name in names if name]


def free_camera(
    look_at_m: tuple[float, float, float], distance_m: float, azimuth_deg: float, elevation_deg: float
) -> Camera:
    """Return a camera that looks at a point in the world."""
    camera = mujoco.MjvCamera()
    camera.lookat[:] = look_at_m
    camera.distance, camera.azimuth, camera.elevation = distance_m, azimuth_deg, elevation_deg
    return camera


def fixed_camera(model: Model, name: str) -> Camera:
    """Return a camera of the model."""
    camera = mujoco.MjvCamera()
    camera.type = int(mujoco.mjtCamera.mjCAMERA_FIXED)
    camera.fixedcamid = id_of(model, "camera", name)
    return camera


def add_geom(scene: Any, shape: Shape, size: Floats, emission: float) -> None:  # noqa: ANN401 - untyped there
    """Append a visual geom without shadow to an `MjvScene`."""
    geom = scene.geoms[scene.ngeom]
    mujoco.mjv_initGeom(geom, shape, size, np.zeros(3), np.eye(3).ravel(), np.ones(4, np.float32))
    geom.emission, geom.castshadow = emission, False
    scene.ngeom += 1


class GeomArrays:
    """The geoms of an `MjvScene` as writable arrays; writing them one by one takes a hundred times as long.

    MuJoCo keeps them contiguous in memory during the lifetime of the scene.

    Args:
        scene: The scene.
        first: The first geom.
        count: Number of geoms.

    Attributes:
        pos: Positions in m, world frame, shape (count, 3).
        mat: Rotation matrices, shape (count, 3, 3).
        rgba: Colours, 0 to 1, shape (count, 4).
    """

    def __init__(self, scene: Any, first: int, count: int) -> None:  # noqa: ANN401 - untyped there
        self._scene = scene  # keeps the memory alive
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
