"""Writes files as laboratories have them that are refused, with the words that mend each."""

import numpy as np
from laboratory_trial import DEG, TRIAL, N, text


def irregular(path):
    random = np.random.default_rng(2)
    t = np.cumsum(random.uniform(0.0006, 0.0034, N))
    values = np.interp(t, TRIAL["t"], DEG)
    path.with_suffix(".csv").write_text(
        text(
            [t, values, np.interp(t, TRIAL["t"], TRIAL["torque"])],
            header=["Time (s),Angle (deg),Torque (Nm)"],
        )
    )


def no_rate(path):
    path.with_suffix(".csv").write_text(
        text([DEG, TRIAL["torque"]], header=["Angle (deg),Torque (Nm)"])
    )


def decimal_commas_between_commas(path):
    rows = [
        ",".join(f"{v:.3f}".replace(".", ",") for v in row)
        for row in zip(TRIAL["t"], DEG, TRIAL["torque"], strict=True)
    ]
    path.with_suffix(".csv").write_text("\n".join(["Time,Angle,Torque", *rows]))


def nothing_known(path):
    random = np.random.default_rng(1)
    path.with_suffix(".csv").write_text(
        text([TRIAL["t"], *random.standard_normal((2, N))], header=["Time (s),Alpha,Beta"])
    )


def only_text(path):
    path.with_suffix(".csv").write_text("subject,answer\nA,yes\nB,no\n")


def two_trials(path):
    half = len(DEG) // 2
    blocks = [
        text(
            [TRIAL["t"][:half], DEG[part], TRIAL["torque"][part]],
            header=[f"Trial {number}", "Time (s),Angle (deg),Torque (Nm)"],
        )
        for number, part in ((1, slice(half)), (2, slice(half, None)))
    ]
    path.with_suffix(".csv").write_text("\n".join(blocks))


def torque_by_body_mass(path):
    path.with_suffix(".csv").write_text(
        text(
            [TRIAL["t"], DEG, TRIAL["torque"] / 70],
            header=["Time (s),Angle (deg),Ankle moment (Nm/kg)"],
        )
    )


def angle_in_volts(path):
    path.with_suffix(".csv").write_text(
        text([TRIAL["t"], DEG / 5, TRIAL["torque"]], header=["Time (s),Angle (V),Torque (Nm)"])
    )


def unknown_unit_of_torque(path):
    path.with_suffix(".csv").write_text(
        text([TRIAL["t"], DEG, TRIAL["torque"]], header=["Time (s),Angle (deg),Torque (ozf.in)"])
    )


def number_for_a_missing_value(path):
    torque = np.where(np.arange(N) == 700, 9999.0, TRIAL["torque"])
    path.with_suffix(".csv").write_text(
        text([TRIAL["t"], DEG, torque], header=["Time (s),Angle (deg),Torque (Nm)"])
    )


def one_group_of_thousands(path):
    """``1,000`` may be a thousand or one: nothing is guessed."""
    rows = [
        f'"{k:,}";{a:.9g};{m:.9g}' for k, a, m in zip(range(N), DEG, TRIAL["torque"], strict=True)
    ]
    path.with_suffix(".csv").write_text("\n".join(["Time (ms);Angle (deg);Torque (Nm)", *rows]))


REFUSED = {
    irregular: "--resample 499",
    no_rate: "--rate 2048",
    decimal_commas_between_commas: "save it with ';' or tabs",
    nothing_known: "--column 'position[deg]=NAME'",
    only_text: "holds no rows of numbers",
    two_trials: "--section 'Trial 1'",
    torque_by_body_mass: "multiply it by the subject's body mass",
    angle_in_volts: "multiply it by the factor of its sensor",
    unknown_unit_of_torque: "is in ozf.in, which is no unit that is known: convert it",
    number_for_a_missing_value: "is 9999 written where a value is missing",
    one_group_of_thousands: "line 1002: '1,000' in column 'Time (ms)', a group of thousands or",
}
