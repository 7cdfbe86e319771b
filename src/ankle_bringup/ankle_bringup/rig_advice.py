"""What an operator does next after a command to the rig that did not lead on. No ROS."""

from __future__ import annotations

STATE_PATIENCE = 2.0
"""[s] Longest wait for the state that the driver has published last."""
FAULT = "fault"
_NEXT = {
    ("arm", "armed"): "it is armed already; go on with: ankle rig start",
    ("arm", "running"): "it runs already; to end that: ankle rig stop",
    ("start", "ready"): "arm it first: ankle rig arm",
    ("start", "running"): "it runs already; to end that: ankle rig stop",
    ("reset_fault", FAULT): "remove the cause, then: ankle rig reset-fault",
}
"""Next step by command and state of the driver; `_NEXT_FROM` has those of all other commands."""
_NEXT_FROM = {
    FAULT: "remove the cause, then: ankle rig reset-fault",
    "disabled": (
        "it gets ready by itself once it hears a rig that is switched on; to see when: "
        "ankle rig state"
    ),
    "stopping": "wait until the plate rests; to see when: ankle rig state",
}
NEVER_REFUSED = ("stop", "disarm")
"""Commands that the driver carries out from any state."""


def ends_in_fault(command: str, state: str) -> bool:
    """Return whether a command that is never refused found or left the driver in a fault.

    Parameters
    ----------
    command
        Name of the driver's service.
    state
        What the driver says of its state, as on ``rig/state``: ``fault: heartbeat lost``.
    """
    return command in NEVER_REFUSED and state.partition(":")[0] == FAULT


def with_advice(command: str, sentence: str, state: str, namespace: str = "") -> str:
    """Return the driver's answer with the reason of its state and the next step.

    Parameters
    ----------
    command
        Name of the driver's service.
    sentence
        The driver's answer.
    state
        What the driver says of its state, as on ``rig/state``; empty where it is not known.
    namespace
        Of the driver's laboratory; the commands of the next step name it.
    """
    word, _, reason = (part.strip() for part in state.partition(":"))
    parts = [sentence]
    if reason and reason not in sentence:
        parts[0] += f" ({reason})"
    if command == "reset_fault" and word != FAULT:
        return parts[0]
    step = _NEXT.get((command, word)) or _NEXT_FROM.get(word)
    if step:
        parts.append(f"{step} --namespace {namespace}" if namespace else step)
    return "; ".join(parts)
