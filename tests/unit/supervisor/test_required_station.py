"""`python -m supervisor --estop-station`: a required station that the configuration does not name."""

from typing import Any

from supervisor.__main__ import require_station
from supervisor.config import SupervisorSection


def stations(document: dict[str, Any]) -> list[tuple[str, bool]]:
    require_station(document, "phone")
    section = SupervisorSection.model_validate(document["supervisor"])
    return [(station.name, station.required) for station in section.estop_stations or ()]


def test_a_station_is_required_beside_those_of_the_configuration() -> None:
    assert stations({}) == [("phone", True)]
    assert stations({"supervisor": {"estop_stations": [{"name": "door"}]}}) == [
        ("door", True),
        ("phone", True),
    ]


def test_a_station_that_the_configuration_names_is_as_the_configuration_says() -> None:
    named = {"supervisor": {"estop_stations": [{"name": "phone", "required": False}]}}
    assert stations(named) == [("phone", False)]
