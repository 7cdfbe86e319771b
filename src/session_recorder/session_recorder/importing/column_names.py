"""What a column is by its name, in the languages that laboratories' files speak, and its unit."""

from __future__ import annotations

import re

from session_recorder.importing.laboratory_units import split_header, to_si

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
_ANKLE = re.compile(r"ankle|enkel|sprunggelenk|fu(ß|ss)|foot|voet|cheville")
_OTHER_JOINT = re.compile(r"knee|hip|knie|heup|h[üu]ft|genou|hanche")
_SIDES = {
    "left": r"\b(left|links|linkes|gauche|l)\b|\bl(sol|ta|gl|gm|lg|mg|ankle)",
    "right": r"\b(right|rechts|rechtes|droite?|r)\b|\br(sol|ta|gl|gm|lg|mg|ankle)",
}
_NO_SIGNAL = r"frame|index|count|sample ?(no|number|nr)|\brow\b|trial|marker|event|trigger"


def _plain(name: str) -> str:
    """Return a column's name as words."""
    text = split_header(name)[0]
    text = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text)
    return re.sub(r"[^0-9a-zäöüßé]+", " ", text.lower()).strip()


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
    if by_unit == "t" and said is not None and said != "t":
        return None
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


def has_unit_of(quantity: str, unit: str | None) -> bool:
    """Return whether a unit can be one of a quantity; none at all can."""
    if unit is None or quantity in MUSCLES:
        return True
    return _quantity_of_unit(unit) == quantity.removeprefix("reference_")


def likeliest(names: list[str]) -> list[str]:
    """Return the names that say the ankle; without any, those that say no other joint; else all."""
    ankle = [name for name in names if _ANKLE.search(_plain(name))]
    return ankle or [name for name in names if not _OTHER_JOINT.search(_plain(name))] or names


def side_of(name: str) -> str | None:
    """Return ``left`` or ``right`` where a column's name says it."""
    words = _plain(name)
    return next((side for side, pattern in _SIDES.items() if re.search(pattern, words)), None)


def is_commanded(name: str) -> bool:
    """Return whether a column's name says that it is a command, whatever is commanded."""
    return re.search(_REFERENCE, _plain(name)) is not None


def counts_samples(name: str) -> bool:
    """Return whether a column's name says that it is a counter or a mark, no signal."""
    return re.search(_NO_SIGNAL, _plain(name)) is not None
