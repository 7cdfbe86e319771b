"""Plan and table of the study of a servo that gives way."""

import math

from simulation_study.servo_bias import INSTRUMENTS, STIFFNESSES, report, subjects


def test_a_longer_study_goes_on_with_the_shorter_one():
    assert subjects(5, 3)[:2] == subjects(2, 3)
    assert subjects(2, 3) != subjects(2, 4)


def test_the_table_states_the_bias_with_its_standard_error_for_every_servo():
    def result(error):
        near = {INSTRUMENTS[0]: [100.0, 10.0]}
        return {
            "truth": [100.0, 10.0],
            "estimates": near | {INSTRUMENTS[1]: [100.0 * (1.0 + error), 10.0 * (1.0 - error)]},
        }

    results = {k: [result(0.04), result(0.06)] for k in STIFFNESSES}
    lines = report(results, "command").splitlines()
    assert "| 1000 | +0.0 ± 0.0 | +0.0 ± 0.0 | +5.0 ± 1.0 | -5.0 ± 1.0 |" in lines
    assert lines[-1].startswith("| rigid |")
    assert math.isinf(STIFFNESSES[-1])
