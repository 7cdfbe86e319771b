"""A report says of each effect what it is, how large, and what it does to K and G."""

from ankle_physics.joint_profile import JointProfile
from model_discrepancy.report.effect_section import effect_sections, equations, exclusions

EFFECT = {
    "name": "fixation_compliance",
    "stated": "resonance in the load path",
    "family": "resonance in the load path",
    "belongs_to": "subject",
    "location": "coupling between footplate and foot",
    "parameters": {"k_s[N.m/rad]": [1063.7, 31.2], "b_s[N.m.s/rad]": [0.1, None]},
    "probability": 0.6,
    "family_probability": 0.69,
    "tentative": True,
    "set": ["fixation_compliance", "plate_appendage"],
    "excluded": {"tendon": "refitted in its place it leaves 160 % more error"},
    "sentence": "The straps give way.",
    "on_impedance": {"K[N.m/rad]": [121.1, 98.2, 13.0], "G[N.m.s/rad]": [9.58, 10.5, None]},
}


def test_an_effect_has_its_numbers_their_errors_and_what_they_mean():
    text = "".join(effect_sections([EFFECT]))
    assert "Fixation compliance</h3>" in text
    assert "The straps give way." in text
    assert "such as fixation compliance (probability 0.69)" in text
    assert "Not excluded: plate appendage." in text
    assert "Something else is missing" in text
    assert "1064 ± 31 N·m/rad" in text
    assert "It is the stiffness of the straps" in text
    assert text.count("at the end of its range") == 1
    hardening = {
        **EFFECT,
        "name": "hardening_stiffness",
        "parameters": {"k3[N.m/rad^3]": [3e4, 35.0]},
    }
    assert "30000 ± 35 N·m/rad³" in "".join(effect_sections([hardening]))


def test_k_and_g_stand_with_all_that_was_found_and_without_each_effect():
    rows = "".join(effect_sections([EFFECT])).split("stiffness and reflex gain")[1]
    assert "<td>with all that was found</td><td>98 ± 13</td><td>10.5</td>" in rows
    assert "<td>without fixation compliance</td><td>121</td><td>9.58</td>" in rows


def test_a_finding_without_a_term_has_no_equation():
    finding = {**EFFECT, "name": "position_gain", "set": ["position_gain"], "on_impedance": {}}
    text = "".join(effect_sections([finding]))
    assert "stiffness and reflex gain" not in text
    assert equations([finding]) == []
    assert "k_s (plate - foot)" in "".join(equations([EFFECT]))
    assert "tendon" in "".join(exclusions([EFFECT]))


def test_units_of_another_joint_are_written_in_its_own():
    linear = JointProfile("axis", position_unit="m", torque_unit="N")
    assert linear.in_units("1064 N·m/rad, 0.2 kg·m²") == "1064 N/m, 0.2 kg"
