"""Measure the clearance of the robot's hull, and how much of its change is due to the robot's own motion."""

import math

from faults.seen import Motion
from sim import mj
from sim.floorplan import Circle, FloorPlan, Outline, Standing, survey
from sim.plant import Plant
from sim.scene import Scene

FAR_M = 0.5
"""Larger clearances are not measured at every sample."""
FASTEST_M_S, FASTEST_ALONE_M_S = 3.0, 2.0
"""Upper bounds of the closing speed: of robot and mover together, and of the robot alone."""


class Witness:
    """Samples the true state of a plant.

    Args:
        plant: the robot in its world.
        scene: what its world was built from.
    """

    def __init__(self, plant: Plant, scene: Scene) -> None:
        self._plant = plant
        self._standing = FloorPlan(scene.standing)
        pillar = mj.id_of(plant.model, "geom", "pillar")  # its geom follows at the next step only
        self._moving = [geom for geom in scene.moving_geoms if geom != pillar]
        self._fastest_m_s = FASTEST_M_S if self._moving else FASTEST_ALONE_M_S
        self.start(0.0)

    def start(self, now_s: float) -> None:
        """Forget the earlier samples, because the robot was placed elsewhere."""
        self._measured = self._plant.outline
        self._skip = False
        self._pillar = self._plant.pillar
        self._clear_until_s = now_s
        self._clearance_m = min(self._nearest_m(self._measured, self._present()), FAR_M)

    def look(self, now_s: float) -> Motion:
        """Return the present sample; every other one measures the clearance, and larger ones are given as `FAR_M`."""
        plant = self._plant
        outline, own_approach_m, appeared_m = plant.outline, 0.0, math.inf
        self._skip = not self._skip
        is_due = not self._skip and now_s >= self._clear_until_s
        if (is_due and (self._moving or outline != self._measured)) or plant.pillar != self._pillar:
            if plant.pillar != self._pillar:
                self._pillar = plant.pillar
                appeared_m = FloorPlan(self._pillars()).nearest(outline).distance_m
            present = self._present()
            clearance_m = self._nearest_m(outline, present)
            if clearance_m > FAR_M:
                self._clear_until_s = now_s + (clearance_m - FAR_M) / self._fastest_m_s
            else:
                own_approach_m = min(self._nearest_m(self._measured, present), FAR_M) - clearance_m
                self._clear_until_s = now_s
            self._clearance_m = min(clearance_m, FAR_M)
            self._measured = outline
        elif now_s < self._clear_until_s:
            self._measured = outline  # nothing is near: what comes up next comes from where it is by then
        velocity = plant.true_velocity
        return Motion(
            now_s,
            outline.x_m,
            outline.y_m,
            velocity.linear_m_s,
            velocity.angular_rad_s,
            self._clearance_m,
            own_approach_m,
            plant.hull_contacts > 0,
            appeared_m,
        )

    def _present(self) -> FloorPlan | None:
        """Return the present places of the objects that can move; None if there are none."""
        present, _ = survey(self._plant.model, self._plant.data, self._moving)
        present += self._pillars()
        return FloorPlan(present) if present else None

    def _pillars(self) -> list[Standing]:
        """Return the pillar, if it is placed."""
        pillar = self._plant.pillar
        return [] if pillar is None else [Standing("pillar", Circle(*pillar, self._plant.pillar_radius_m))]

    def _nearest_m(self, hull: Outline, present: FloorPlan | None) -> float:
        others_m = math.inf if present is None else present.nearest(hull).distance_m
        return min(self._standing.nearest(hull).distance_m, others_m)
