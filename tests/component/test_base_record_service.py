"""A supervisor that knows nothing of its base, the first stop of the simulated robot, and the next supervisor."""

from pathlib import Path

import pytest

from sim.plant import Plant
from supervisor.base_record import BaseFile, BaseRecord
from supervisor.config import SupervisorSection
from tests.component.rig import Rig

LAW = SupervisorSection().law(is_base_known=False)
FAST = 0.9


def record(directory: Path) -> BaseRecord:
    return BaseRecord(BaseFile(directory, "robot", LAW))


async def test_the_first_stop_measures_the_base_also_for_the_next_supervisor(tmp_path: Path) -> None:
    rig, plant = Rig(), Plant()
    async with rig.sim(plant), rig.source():
        async with rig.supervisor(law=LAW, base_record=record(tmp_path)):
            await rig.drive(FAST)
            await rig.pass_time(1.0)
            assert rig.output() == pytest.approx((0.5, 0.0))
            assert rig.newest_status.causes == ["BASE_UNMEASURED"]
            rig.velocity = (0.0, 0.0)
            await rig.pass_time(1.0)
            await rig.drive(FAST)
            assert rig.output() == pytest.approx((FAST, 0.0))
            assert rig.newest_status.causes == []
            rig.velocity = (0.0, 0.0)
            await rig.pass_time(1.0)
        shown = record(tmp_path).at_start.braking
        assert len(shown.shown_m_s2) == 1
        assert shown.shown_m_s2[0] == pytest.approx(2.0, rel=0.1)
        assert shown.shown_dead_s == (0.0,)
        async with rig.supervisor(law=LAW, base_record=record(tmp_path)):
            await rig.drive(FAST)
            assert rig.output() == pytest.approx((FAST, 0.0))
