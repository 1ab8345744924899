"""Whether this machine can render without a display."""

import pytest

from sim.gl import NoGlError, choose


def has_gl() -> bool:
    try:
        choose()
    except NoGlError:
        return False
    return True


needs_gl = pytest.mark.skipif(not has_gl(), reason="neither EGL nor OSMesa: apt install libegl1 libegl-mesa0")
