"""From the sim's wheels to the observer, bypassing the network."""

from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from faults.real.rig.wheels import WheelPipe, WheelSample, WheelWriter, pack, unpack
from faults.seen import Motion

SAMPLE = WheelSample(Motion(1.5, 2.0, 3.0, 0.5, -0.2, 0.8, 0.01, is_touching=True), is_driven=False, reason=3)
numbers = st.floats(allow_nan=False)
motions = st.builds(Motion, *[numbers] * 7, st.booleans(), numbers)
samples = st.builds(WheelSample, motions, st.booleans(), st.integers(0, 255))


def at(time_s: float) -> WheelSample:
    return SAMPLE._replace(motion=SAMPLE.motion._replace(time_s=time_s))


@given(st.lists(samples, max_size=4))
def test_what_is_packed_is_unpacked(ones: list[WheelSample]) -> None:
    assert list(unpack(b"".join(map(pack, ones)))) == ones


def test_samples_of_one_writer_after_the_other_arrive(tmp_path: Path) -> None:
    pipe = WheelPipe(tmp_path / "wheels")
    assert pipe.take() == []
    for time_s in range(3):
        WheelWriter(tmp_path / "wheels").tell(at(time_s))
    assert [sample.motion.time_s for sample in pipe.take()] == [0, 1, 2]
    assert pipe.take() == []
    pipe.close()


def test_a_writer_that_nobody_reads_goes_on(tmp_path: Path) -> None:
    pipe = WheelPipe(tmp_path / "wheels")
    writer = WheelWriter(tmp_path / "wheels")
    for time_s in range(5000):
        writer.tell(at(time_s))
    kept = [sample.motion.time_s for sample in pipe.take()]
    assert kept == list(range(len(kept)))
    assert 100 < len(kept) < 5000
    pipe.close()
