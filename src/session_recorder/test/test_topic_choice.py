"""Which topics of a graph a recorder takes, and by which name they stand in its bag."""

from session_recorder.topic_choice import TopicChoice


def test_a_recorder_takes_its_own_laboratory_and_what_ros_shares():
    choice = TopicChoice([], "/left")
    assert choice.wants("/left/ankle/samples")
    assert choice.wants("/rosout")
    assert choice.wants("/tf")
    assert not choice.wants("/right/ankle/samples")
    assert not choice.wants("/leftover/ankle/samples")
    assert TopicChoice([], "/").wants("/right/ankle/samples")


def test_a_bag_has_the_names_of_the_root_whatever_the_namespace_was():
    choice = TopicChoice([], "/left")
    assert choice.name_in_bag("/left/ankle/samples") == "/ankle/samples"
    assert choice.name_in_bag("/rosout") == "/rosout"
    assert TopicChoice([], "/").name_in_bag("/ankle/samples") == "/ankle/samples"


def test_named_topics_are_taken_alone_and_missed_until_they_are_connected():
    choice = TopicChoice(["/ankle/samples", "/emg/samples"], "/")
    assert choice.wants("/emg/samples")
    assert not choice.wants("/rosout")
    assert choice.missing({"/emg/samples": "type"}) == ["/ankle/samples"]
    assert TopicChoice([], "/").missing([]) == []
