"""What a column is by its name, in the languages that laboratories' files speak, and its unit."""

from __future__ import annotations

import re

from ankle_interfaces.units import to_si
from session_recorder.importing.laboratory_units import split_header

# Words for each quantity, in the languages that laboratories' files speak. The first that fits
# decides; torque stands before angle, because "ankle torque" has both.
_WORDS = {
    "t": r"\b(time|t|zeit|tijd|temps|timestamps?|x[ _]value|elapsed|sec(onds)?)\b",
    "velocity": r"vel(ocity)?\b|speed|omega|geschwindigkeit|snelheid|vitesse|angvel|\bdpos",
    "acceleration": r"acc(el|eleration)?\b|beschleunigung|versnelling",
    "torque": r"torq|\btrq|\btq\b|moment|mom\b|koppel|couple|drehm",
    "position": r"angle|pos(ition)?\b|\bpos|winkel|hoek|theta|rotation|encoder|flexion|\bang\b",
}
_REFERENCE = r"ref(erence)?\b|\bref|command|\bcmd|target|set ?point|desired|soll|doel|stimulus"
MUSCLES = {
    "SOL": r"\b[lr]?sol\b|soleus",
    "TA": r"\b[lr]?ta\b|tibialis|tib ?ant",
    "GL": r"\b(r?gl|r?lg|gasl|lgas|lgm)\b|gas\w* ?lat|lat\w* ?gas",
    "GM": r"\b(r?gm|r?mg|gasm|mgas|mgm)\b|gas\w* ?med|med\w* ?gas",
}
_NO_SIGNAL = r"frame|index|count|sample ?(no|number|nr)|\brow\b|trial|marker|event|trigger"


def _plain(name: str) -> str:
    """Return a column's name as words."""
    text = split_header(name)[0]
    text = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text)
    return re.sub(r"[^0-9a-zäöüé]+", " ", text.lower()).strip()


def quantity_of(name: str, unit: str | None) -> str | None:
    """Return the quantity that a column's name and unit say, None where they say nothing.

    Parameters
    ----------
    name
        Of the column, as the file has it.
    unit
        As the file states it; None: not at all.
    """
    words = _plain(name)
    for muscle, pattern in MUSCLES.items():
        if re.search(pattern, words) and (unit is None or unit in ("V", "mV", "uV")):
            return muscle
    said = next((key for key, pattern in _WORDS.items() if re.search(pattern, words)), None)
    if said is None and re.search(_NO_SIGNAL, words):
        return None
    by_unit = _quantity_of_unit(unit)
    if by_unit is not None and by_unit != said:
        # The unit is surer than a word: "reference [N.m]", "ankle [deg]".
        said = by_unit if said is None or by_unit != "position" else said
        if unit and _quantity_of_unit(unit) != said:
            return None
    if said is None:
        return None
    if re.search(_REFERENCE, words):
        return f"reference_{said}" if said in ("position", "velocity", "acceleration") else None
    return None if said == "acceleration" else said


def _quantity_of_unit(unit: str | None) -> str | None:
    if unit is None:
        return None
    try:
        si = to_si(unit)[0]
    except ValueError:
        return None
    return {
        "s": "t",
        "rad": "position",
        "rad/s": "velocity",
        "rad/s^2": "acceleration",
        "N.m": "torque",
    }.get(si)


def is_commanded(name: str) -> bool:
    """Return whether a column's name says that it is a command, whatever is commanded."""
    return re.search(_REFERENCE, _plain(name)) is not None


def counts_samples(name: str) -> bool:
    """Return whether a column's name says that it is a counter or a mark, no signal."""
    return re.search(_NO_SIGNAL, _plain(name)) is not None
