"""Renders the measurements as tables and verdicts (pure)."""

import math
from collections.abc import Iterator, Mapping

from bench.link.conditions import JITTER, Condition, Link
from bench.link.results import HOUR_S, Measured, Results
from bench.rig.sheet import Sheet, Verdict
from bench.rig.stored import origin

TARGETS = {0.02: 1.0, 0.05: 10.0}
"""Maximum number of false stops an hour over QUIC, by loss, at `TARGET_ROUND_TRIP_S`."""
TARGET_ROUND_TRIP_S = 0.02
MANY = 10


def sheets(results: Results) -> list[Sheet]:
    """Return the rates and the ages for each lease, then the rounds."""
    found: list[Sheet] = []
    for lease_s, together in by_lease(results).items():
        found += [stops(together, lease_s), ages(together, lease_s)]
    return [*found, effort(results).with_note(origin(results.run))]


def by_lease(results: Results) -> dict[float, dict[Condition, Measured]]:
    """Return the sums over all rounds, by the lease of the sessions [s]."""
    found: dict[float, dict[Condition, Measured]] = {}
    for condition, one in results.together().items():
        found.setdefault(condition.lease_s, {})[condition] = one
    return dict(sorted(found.items()))


def stops(together: Mapping[Condition, Measured], lease_s: float) -> Sheet:
    """Return the rates of false stops: a row for each loss and round trip, a column for each link."""
    return Sheet(
        f"False stops an hour of one operator's commands at 20 Hz, lease {lease_s:g} s",
        ("round trip", "loss", *_names(together), "measured hours"),
        tuple(
            (
                *_place(row),
                *(_rate(one) for one in found),
                ", ".join(f"{one.flow_s / HOUR_S:.2f}" for one in found if one is not None),
            )
            for row, found in _rows(together, lease_s)
        ),
        (
            "A false stop: the age of the newest fresh command exceeds 0.2 s.",
            f"In brackets: the 95 % upper bound of rates with fewer than {MANY} stops.",
            "loss: share of packets lost, each way.",
            f"round trip: mean; the standard deviation of each delay is {100 * JITTER:g} %, so packets overtake each other.",
            "QUIC: mutual TLS, commands as datagrams. UDP: without TLS, as a reference.",
            "measured hours: of all flows of a link together, in the order of the columns.",
        ),
    )


def ages(together: Mapping[Condition, Measured], lease_s: float) -> Sheet:
    """Return the worst age and the lost links, in the order of `stops`."""
    return Sheet(
        f"Worst age of the newest fresh command in s, and (links lost), lease {lease_s:g} s",
        ("round trip", "loss", *_names(together)),
        tuple(
            (
                *_place(row),
                *("" if one is None else f"{one.worst_age_s:.2f} ({one.links_lost})" for one in found),
            )
            for row, found in _rows(together, lease_s)
        ),
        (
            "The age does not contain the smallest delay of the link, because the clocks of two hosts are not compared.",
            "links lost: how often the liveliness token of a living operator was deleted, because the lease ended.",
        ),
    )


def _links(together: Mapping[Condition, Measured]) -> list[Link]:
    return [link for link in Link if any(one.link == link for one in together)]


def _names(together: Mapping[Condition, Measured]) -> list[str]:
    return [link.upper() for link in _links(together)]


def _rows(
    together: Mapping[Condition, Measured], lease_s: float
) -> Iterator[tuple[tuple[float, float], list[Measured | None]]]:
    """Yield round trip [s] and loss of each row, with the measurement of each link."""
    links = _links(together)
    for round_trip_s, loss in sorted({(one.round_trip_s, one.loss) for one in together}):
        yield (
            (round_trip_s, loss),
            [together.get(Condition(link, loss, round_trip_s, lease_s)) for link in links],
        )


def _place(row: tuple[float, float]) -> tuple[str, str]:
    round_trip_s, loss = row
    return f"{1000 * round_trip_s:g} ms", f"{100 * loss:g} %"


def _rate(one: Measured | None) -> str:
    if one is None or math.isnan(one.per_hour):
        return ""
    rate = f"{one.per_hour:.0f}" if one.per_hour >= 10 else f"{one.per_hour:.2g}"
    return rate if one.stops >= MANY else f"{rate} (≤ {one.upper_per_hour:.2g})"


def effort(results: Results) -> Sheet:
    """Return one row for each round: its size, and the lateness of the bench itself."""
    return Sheet(
        "Rounds, and the lateness of the bench itself [ms]",
        (
            "date",
            "flows",
            "seconds",
            "busy",
            "disturbed [s]",
            "packets",
            "router p99",
            "max",
            "sender p99",
            "max",
            "receiver p99",
            "max",
        ),
        tuple(
            (
                one.date,
                str(one.flows),
                f"{one.seconds:.0f}",
                f"{one.busy_percent:.0f} %",
                f"{one.disturbed_s:.1f}",
                f"{one.packets:,}",
                f"{one.router_late_p99_ms:.2f}",
                f"{one.router_late_max_ms:.0f}",
                f"{one.sender_late_p99_ms:.2f}",
                f"{one.sender_late_max_ms:.0f}",
                f"{one.receiver_late_p99_ms:.2f}",
                f"{one.receiver_late_max_ms:.0f}",
            )
            for one in results.rounds
        ),
        (
            "disturbed: time near moments at which a part of the bench was more than 20 ms late; its stops are not counted.",
        ),
    )


def verdicts(results: Results) -> list[Verdict]:
    """Return the verdicts on QUIC, for each lease."""
    return [
        verdict for lease_s, together in by_lease(results).items() for verdict in _verdicts(together, lease_s)
    ]


def _verdicts(together: Mapping[Condition, Measured], lease_s: float) -> Iterator[Verdict]:
    for loss, target in TARGETS.items():
        found = together.get(Condition(Link.QUIC, loss, TARGET_ROUND_TRIP_S, lease_s))
        if found is not None:
            hours = found.flow_s / HOUR_S
            where = f"{100 * loss:g} % loss, {1000 * TARGET_ROUND_TRIP_S:g} ms, lease {lease_s:g} s"
            what = f"QUIC, {where}, {hours:.1f} flow-hours: false stops"
            yield Verdict(what, found.per_hour, target, "an hour")
