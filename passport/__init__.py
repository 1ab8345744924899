"""The stop-time passport: how far a robot moves after each fault, measured before a flat wall.

    record.py       the record of a measurement, and its JSON form
    cells.py        which faults from which speeds, and the free area that each needs
    stops.py        computes one run from what was recorded around a fault
    instrument.py   the uncertainty of wall and odometry
    child.py        a program that ends with the measurement
    pilot.py        the operator's program, which is killed, stopped and cut off
    link.py         the operator's link, which is cut
    bypass.py       a hub in place of the supervisor that judges nothing
    ros2_bypass.py  the same in place of the process `ros2`
    without.py      puts them there, and Lifeline back
    injection.py    injects and lifts the faults
    rounds.py       drives one run, and back
    results.py      the file of the runs, and how a measurement continues
    measure.py      the command `measure`

    statistics.py   upper limits of stops without an assumption about their distribution
    summary.py      one row for each cell, and one sentence for all faults
    drawing.py      pictures of runs
    statement.py    the statement that is signed
    page.py         the page with all of these
    compare.py      which limits became worse
    reading.py      the commands `report`, `verify` and `diff`

All are pure but child.py, pilot.py, link.py, bypass.py, ros2_bypass.py, without.py, injection.py, rounds.py, results.py and the two of the commands.
"""
