"""Mismatches of types and of QoS, in plain words."""

from ros2.reports import clause, names, wrong_qos, wrong_types
from ros2.ros import BOOL, TWIST, TWIST_STAMPED, Endpoint, twist_type

TELEOP = Endpoint("/teleop", TWIST, b"1" * 16)
JOY = Endpoint("/joy", TWIST_STAMPED, b"2" * 16)


def test_the_names_of_nodes_are_a_sorted_list_in_words() -> None:
    assert names([]) == "none"
    assert names([TELEOP]) == "/teleop"
    assert names([TELEOP, JOY]) == "/joy and /teleop"


def test_the_verb_agrees_with_the_number_of_nodes() -> None:
    assert clause([TELEOP], "listen") == "/teleop listens"
    assert clause([TELEOP], "publish") == "/teleop publishes"
    assert clause([TELEOP, JOY], "publish") == "/joy and /teleop publish"


def test_endpoints_of_the_expected_type_are_no_problem() -> None:
    assert wrong_types("/cmd_vel", TWIST, [], "stamped") is None
    assert wrong_types("/cmd_vel", TWIST, [TELEOP], "stamped") is None


def test_the_other_kind_of_twist_names_the_option_to_set() -> None:
    assert wrong_types("/cmd_vel", TWIST, [TELEOP, JOY], "stamped") == (
        "/joy uses geometry_msgs/msg/TwistStamped on /cmd_vel, but geometry_msgs/msg/Twist is expected, "
        "so they are not connected: set stamped = true"
    )
    sentence = wrong_types("/cmd_vel", TWIST_STAMPED, [TELEOP, JOY], "stamped of the source joy")
    assert sentence is not None
    assert sentence.startswith("/teleop uses geometry_msgs/msg/Twist on /cmd_vel")
    assert sentence.endswith("set stamped of the source joy = false")


def test_another_type_needs_a_topic_of_the_expected_type() -> None:
    other = TELEOP._replace(type_name=BOOL)
    for option in ("stamped", ""):
        sentence = wrong_types("/cmd_vel", TWIST, [other], option)
        assert sentence is not None
        assert sentence.endswith("give it a topic with geometry_msgs/msg/Twist")
    sentence = wrong_types("/cmd_vel", TWIST, [JOY], "")
    assert sentence is not None
    assert sentence.endswith("give it a topic with geometry_msgs/msg/Twist")


def test_only_a_subscription_that_requests_old_messages_is_a_mismatch_of_qos() -> None:
    assert wrong_qos("/cmd_vel", []) is None
    assert wrong_qos("/cmd_vel", [TELEOP, JOY]) is None
    assert wrong_qos("/cmd_vel", [TELEOP, JOY._replace(is_transient=True)]) == (
        "/joy requests /cmd_vel with durability transient local, which would also deliver an old command, "
        "so they are not connected: set its durability to volatile"
    )


def test_the_type_of_a_command_topic_follows_the_option() -> None:
    assert (twist_type(stamped=False), twist_type(stamped=True)) == (TWIST, TWIST_STAMPED)


def test_of_many_endpoints_the_first_four_are_named_and_the_others_counted() -> None:
    many = [Endpoint(f"/n{number}", "geometry_msgs/msg/Twist", bytes(16)) for number in range(7)]
    assert names(many[:4]) == "/n0 and /n1 and /n2 and /n3"
    assert names(many) == "/n0 and /n1 and /n2 and /n3 and 3 more"
