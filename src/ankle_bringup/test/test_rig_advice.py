"""What `ankle rig` says after a command that did not lead on."""

import pytest

from ankle_actuator_driver.safety.states import SafetyStates, State
from ankle_bringup.rig_advice import ends_in_fault, with_advice

STATES = [state.value for state in State]


def advised(command, state, namespace=""):
    word, _, reason = state.partition(": ")
    driver = SafetyStates()
    driver.state, driver.reason = State(word), reason
    answer = getattr(driver, command)(0.0)
    return with_advice(command, answer.sentence, state, namespace)


def test_a_start_that_is_not_armed_names_the_command_that_arms():
    assert advised("start", "ready") == (
        "start is refused: the driver is ready; arm it first: ankle rig arm"
    )
    assert advised("start", "ready", "left").endswith("ankle rig arm --namespace left")


@pytest.mark.parametrize("command", ["stop", "disarm", "arm", "start"])
def test_a_fault_is_named_once_with_its_reason_and_the_command_that_resets_it(command):
    sentence = advised(command, "fault: heartbeat lost")
    assert sentence.count("heartbeat lost") == 1
    assert sentence.endswith("remove the cause, then: ankle rig reset-fault")


@pytest.mark.parametrize("state", STATES)
def test_a_stop_ends_well_unless_the_driver_is_in_a_fault(state):
    assert ends_in_fault("stop", f"{state}: a reason") is (state == "fault")
    assert not ends_in_fault("arm", state)


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("command", ["arm", "start"])
def test_every_refusal_names_a_next_step(command, state):
    carried_out = {("arm", "ready"), ("start", "armed")}
    if (command, state) not in carried_out:
        assert "ankle rig " in advised(command, state)


def test_without_a_known_state_the_answer_stays_as_it_is():
    assert with_advice("start", "start is refused", "") == "start is refused"
