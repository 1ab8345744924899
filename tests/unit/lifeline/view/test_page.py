"""The policy of the web viewer's page."""

from lifeline.view.window import policy


def test_the_page_may_connect_to_its_data_and_nowhere_else() -> None:
    rules = dict(rule.split(" ", 1) for rule in policy(9091).split("; "))
    assert rules["connect-src"] == "'self' http://127.0.0.1:9091 http://localhost:9091"
    assert rules["default-src"] == "'none'"
    hosts = [place for rule in rules.values() for place in rule.split() if "//" in place]
    assert hosts == ["http://127.0.0.1:9091", "http://localhost:9091"]
