"""XXH3 with 128 bits, by which rmw_zenoh makes the identity of an endpoint from its token (pure).

Source: the specification of xxHash (doc/xxhash_spec.md of github.com/Cyan4973/xxHash), with its default secret and no seed.
Inputs of up to 16 bytes, which are hashed in other ways, do not occur.
"""

import struct

_MASK = (1 << 64) - 1
_PRIME32_1, _PRIME32_2, _PRIME32_3 = 0x9E3779B1, 0x85EBCA77, 0xC2B2AE3D
_PRIME64_1, _PRIME64_2, _PRIME64_3 = 0x9E3779B185EBCA87, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9
_PRIME64_4, _PRIME64_5 = 0x85EBCA77C2B2AE63, 0x27D4EB2F165667C5
_PRIME_MX1 = 0x165667919E3779F9
_SECRET = bytes.fromhex(
    "b8fe6c3923a44bbe7c01812cf721ad1cded46de9839097db7240a4a4b7b3671fcb79e64eccc0e578825ad07dccff7221"
    "b8084674f743248ee03590e6813a264c3c2852bb91c300cb88d0658b1b532ea371644897a20df94e3819ef46a9deacd8"
    "a8fa763fe39c343ff9dcbbc7c70b4f1d8a51e04bcdb45931c89f7ec9d9787364eac5ac8334d3ebc3c581a0fffa1363eb"
    "170ddd51b7f0da49d316552629d4689e2b16be587d47a1fc8ff8b8d17ad031ce45cb3a8f95160428afd7fbcabb4b407e"
)
_SHORTEST, _MIDDLE, _LONG = 17, 129, 241
_STRIPE = 64
_STEP = 8
"""Bytes by which the secret advances with each stripe."""
_STRIPES = (len(_SECRET) - _STRIPE) // _STEP
_BLOCK = _STRIPE * _STRIPES


def xxh3_128(data: bytes) -> bytes:
    """Return the hash as 16 bytes: its low and its high half, each with the least significant byte first.

    Args:
        data: at least 17 bytes.

    Raises:
        ValueError: it is shorter.
    """
    size = len(data)
    if size < _SHORTEST:
        raise ValueError(f"{size} bytes are fewer than {_SHORTEST}")
    if size >= _LONG:
        low, high = _hash_long(data)
    else:
        low, high = _finish(size, *(_mix_short(data) if size < _MIDDLE else _mix_middle(data)))
    return struct.pack("<QQ", low, high)


def _u64(data: bytes, at: int) -> int:
    return int.from_bytes(data[at : at + 8], "little")


def _folded(a: int, b: int) -> int:
    product = a * b
    return (product & _MASK) ^ (product >> 64)


def _avalanche(value: int) -> int:
    value = (value ^ (value >> 37)) * _PRIME_MX1 & _MASK
    return value ^ (value >> 32)


def _mix16(data: bytes, at: int, secret_at: int) -> int:
    return _folded(
        _u64(data, at) ^ _u64(_SECRET, secret_at), _u64(data, at + 8) ^ _u64(_SECRET, secret_at + 8)
    )


def _mix32(low: int, high: int, data: bytes, first: int, second: int, secret_at: int) -> tuple[int, int]:
    """Mix the 16 bytes at `first` and those at `second` into the two halves."""
    low = (low + _mix16(data, first, secret_at) & _MASK) ^ (
        _u64(data, second) + _u64(data, second + 8) & _MASK
    )
    high = (high + _mix16(data, second, secret_at + 16) & _MASK) ^ (
        _u64(data, first) + _u64(data, first + 8) & _MASK
    )
    return low, high


def _mix_short(data: bytes) -> tuple[int, int]:
    """Mix 17 to 128 bytes, pairwise from both ends."""
    size = len(data)
    low, high = size * _PRIME64_1 & _MASK, 0
    for pair in reversed(range((size - 1) // 32 + 1)):
        low, high = _mix32(low, high, data, 16 * pair, size - 16 * (pair + 1), 32 * pair)
    return low, high


def _mix_middle(data: bytes) -> tuple[int, int]:
    """Mix 129 to 240 bytes."""
    size = len(data)
    low, high = size * _PRIME64_1 & _MASK, 0
    for at in range(0, 128, 32):
        low, high = _mix32(low, high, data, at, at + 16, at)
    low, high = _avalanche(low), _avalanche(high)
    for at in range(128, size - 31, 32):
        low, high = _mix32(low, high, data, at, at + 16, at - 128 + 3)
    return _mix32(low, high, data, size - 16, size - 32, 136 - 17 - 16)


def _finish(size: int, low: int, high: int) -> tuple[int, int]:
    mixed = low * _PRIME64_1 + high * _PRIME64_4 + size * _PRIME64_2 & _MASK
    return _avalanche(low + high & _MASK), -_avalanche(mixed) & _MASK


def _hash_long(data: bytes) -> tuple[int, int]:
    """Hash more than 240 bytes in stripes of 64 bytes."""
    size = len(data)
    lanes = [
        _PRIME32_3, _PRIME64_1, _PRIME64_2, _PRIME64_3, _PRIME64_4, _PRIME32_2, _PRIME64_5, _PRIME32_1,
    ]  # fmt: skip
    blocks = (size - 1) // _BLOCK
    for block in range(blocks):
        for stripe in range(_STRIPES):
            _accumulate(lanes, data, block * _BLOCK + stripe * _STRIPE, stripe * _STEP)
        for lane, value in enumerate(lanes):
            key = _u64(_SECRET, len(_SECRET) - _STRIPE + 8 * lane)
            lanes[lane] = (value ^ (value >> 47) ^ key) * _PRIME32_1 & _MASK
    for stripe in range((size - 1 - blocks * _BLOCK) // _STRIPE):
        _accumulate(lanes, data, blocks * _BLOCK + stripe * _STRIPE, stripe * _STEP)
    _accumulate(lanes, data, size - _STRIPE, len(_SECRET) - _STRIPE - 7)
    return (
        _merged(lanes, 11, size * _PRIME64_1),
        _merged(lanes, len(_SECRET) - _STRIPE - 11, ~(size * _PRIME64_2)),
    )


def _accumulate(lanes: list[int], data: bytes, at: int, secret_at: int) -> None:
    for lane in range(8):
        value = _u64(data, at + 8 * lane)
        key = value ^ _u64(_SECRET, secret_at + 8 * lane)
        lanes[lane ^ 1] = lanes[lane ^ 1] + value & _MASK
        lanes[lane] = lanes[lane] + (key & 0xFFFFFFFF) * (key >> 32) & _MASK


def _merged(lanes: list[int], secret_at: int, start: int) -> int:
    for pair in range(4):
        at = secret_at + 16 * pair
        start += _folded(lanes[2 * pair] ^ _u64(_SECRET, at), lanes[2 * pair + 1] ^ _u64(_SECRET, at + 8))
    return _avalanche(start & _MASK)
