"""`python -m sim`: starts program.py, or says how to install the simulation."""

import gc

if __name__ == "__main__":
    gc.disable()  # until run_process: what the imports create stays

from wire.host.command_line import refuse
from wire.host.installation import how_to_install, missing_extra


def main() -> None:
    try:
        from sim.program import main as run  # noqa: PLC0415 - it needs MuJoCo, which may be missing
    except ModuleNotFoundError as error:
        extra = missing_extra(error)
        if extra is None:
            raise
        refuse("sim", f"this needs an extra: {how_to_install(extra)}")
    run()


if __name__ == "__main__":
    main()
