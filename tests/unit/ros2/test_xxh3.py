"""The hash by which rmw_zenoh identifies an endpoint, at each boundary of its length."""

import pytest

from ros2.xxh3 import xxh3_128

# Of the reference implementation, through the package `xxhash` of PyPI.
KNOWN = {
    17: "3c0cd9de34e45f7341800863af673f26",
    128: "1af9e15d3073fb2dfbadb874c4101638",
    129: "e83bbac992508b1fd5557242d4ee054e",
    240: "4a6cad7a6181bfe6c81e1cd735e0ff17",
    241: "c1485357c3c814c69bd7b6ff9c1ebc29",
    1024: "ea47ff84dcf32ef298f01cabad8efe07",
    1025: "35a46937a869f843767cccda7c769dc8",
    1100: "c5ef0c58b3d52c1036a0bb12155f07a8",
    2049: "85293afa8a12834536e9218bfe8f3bfe",
}


@pytest.mark.parametrize("size", KNOWN)
def test_the_hash_is_that_of_the_reference_implementation(size: int) -> None:
    assert xxh3_128(bytes(i * 7 % 251 for i in range(size))).hex() == KNOWN[size]


def test_a_shorter_input_is_refused() -> None:
    with pytest.raises(ValueError, match="16 bytes are fewer than 17"):
        xxh3_128(bytes(16))
