"""From the sim's wheels to the observer, bypassing the network."""

from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from faults.real.rig.wheels import WheelPipe, WheelSample, WheelWriter, pack, unpack

SAMPLE = WheelSample._make((1.5, 2.0, 3.0, 0.1, 0.5, -0.2, 0.8, 0.01, 0.002, True, False, 3, 7))
numbers = st.floats(allow_nan=False)
samples = st.builds(
    WheelSample,
    *[numbers] * 9,
    st.booleans(),
    st.booleans(),
    st.integers(0, 255),
    st.integers(0, 1 << 40),
)


@given(st.lists(samples, max_size=4))
def test_what_is_packed_is_unpacked(ones: list[WheelSample]) -> None:
    assert list(unpack(b"".join(map(pack, ones)))) == ones


def test_samples_of_one_writer_after_the_other_arrive(tmp_path: Path) -> None:
    pipe = WheelPipe(tmp_path / "wheels")
    assert pipe.take() == []
    for collisions in range(3):
        WheelWriter(tmp_path / "wheels").tell(SAMPLE._replace(collisions=collisions))
    assert [sample.collisions for sample in pipe.take()] == [0, 1, 2]
    assert pipe.take() == []
    pipe.close()


def test_a_writer_that_nobody_reads_goes_on(tmp_path: Path) -> None:
    pipe = WheelPipe(tmp_path / "wheels")
    writer = WheelWriter(tmp_path / "wheels")
    for collisions in range(5000):
        writer.tell(SAMPLE._replace(collisions=collisions))
    kept = [sample.collisions for sample in pipe.take()]
    assert kept == list(range(len(kept)))
    assert 100 < len(kept) < 5000
    pipe.close()
