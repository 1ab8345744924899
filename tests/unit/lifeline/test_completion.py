"""The words that the shells complete."""

from faults.classes import BY_NAME, real_classes
from lifeline.cli.look import CAMERAS, HULLS, layout_names, node_names, topic_names
from lifeline.cli.prove import class_names
from sim.config import Hull
from sim.layout import known
from sim.render import NAMES
from supervisor.config import SupervisorSection
from wire import topics


def test_topics_are_those_of_the_table_and_of_the_default_command_sources() -> None:
    sources = {f"{source.name}/cmd_vel" for source in SupervisorSection().sources}
    fixed = {topic.key for topic in topics.TOPICS if "<" not in topic.key}
    assert set(topic_names("")) == fixed | sources


def test_a_word_that_begins_like_an_absolute_name_is_completed_to_one() -> None:
    assert "/robot/scan" in topic_names("/")
    assert "robot/scan" in topic_names("rob")
    assert "scan" in topic_names("s")


def test_classes_follow_the_names_that_are_already_there() -> None:
    name = real_classes()[0].name
    assert name in BY_NAME
    assert name in class_names("")
    assert f"a,b,{name}" in class_names("a,b,te")


def test_the_other_words_are_those_that_the_commands_accept() -> None:
    assert CAMERAS == NAMES
    assert tuple(Hull) == HULLS
    assert layout_names() == known()
    assert node_names() == [topics.SUPERVISOR, topics.SIM, topics.TELEOP]
