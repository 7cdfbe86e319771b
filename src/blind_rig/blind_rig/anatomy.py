"""A simulated subject on a virtual rig is described by these numbers, in SI.

Each group is a NamedTuple of floats, so that the compiled loop takes it as it is. The defaults are
the paper's model and a faultless rig; an effect is a change of a few of these numbers (`effects`).
"""

from __future__ import annotations

from typing import Any, NamedTuple


class Muscle(NamedTuple):
    """Describes the torque of the joint itself against displacement x and velocity v of the foot.

    Attributes
    ----------
    K, B
        Stiffness [N.m/rad] and viscosity [N.m.s/rad] at the operating point.
    position_slope
        Relative change of K per rad of dorsiflexion [1/rad].
    hardening
        Relative change of K per squared displacement [1/rad^2].
    damping_asymmetry
        B * (1 + a) while the foot moves up, B * (1 - a) while it moves down [1].
    maxwell_k, maxwell_tau
        Spring [N.m/rad] in series with a dashpot, and its relaxation time [s]. bridge_k,
        bridge_yield, bridge_recovery: cross-bridges: stiffness [N.m/rad], stretch at which they
        yield [rad], re-attachment time [s].
    thixotropy_k, thixotropy_break, thixotropy_set
        Bonds that form at rest: stiffness [N.m/rad], travel that breaks them [rad], time to set
        [s].
    hysteresis_torque, hysteresis_travel
        Dry friction of tissues: its torque [N.m] and the travel over which it builds up [rad].
    tendon_share
        Share of the joint's compliance at rest that is the tendon's, in series with the contractile
        part [1]; 0 is a rigid tendon.
    contractile_b
        Viscosity of the contractile part behind a tendon [N.m.s/rad]; B then is that of the passive
        tissues beside both.
    """

    K: float = 100.0
    B: float = 0.63
    position_slope: float = 0.0
    hardening: float = 0.0
    damping_asymmetry: float = 0.0
    maxwell_k: float = 0.0
    maxwell_tau: float = 0.1
    bridge_k: float = 0.0
    bridge_yield: float = 0.006
    bridge_recovery: float = 0.3
    thixotropy_k: float = 0.0
    thixotropy_break: float = 0.01
    thixotropy_set: float = 0.5
    hysteresis_torque: float = 0.0
    hysteresis_travel: float = 0.005
    tendon_share: float = 0.0
    contractile_b: float = 5.0


class Reflex(NamedTuple):
    """Describes the stretch reflex: what the spindles see, what the cord makes of it, how the
    muscle answers.

    Attributes
    ----------
    G
        Torque per velocity [N.m.s/rad] at rest of the nonlinearities below.
    delay
        From stretch to the begin of torque [s].
    omega, zeta
        Second-order muscle dynamics [rad/s], [1].
    threshold
        Velocity below which nothing happens [rad/s].
    exponent
        Drive = v0 * (v / v0) ** exponent with v0 = 1 rad/s.
    saturation
        Velocity at which the drive levels off [rad/s]; 0 is never.
    depression, depression_recovery
        Share of the response used up per rad of stretch [1/rad], and its recovery time [s].
    position_gain
        Relative change of the response per rad of dorsiflexion [1/rad].
    antagonist_G, antagonist_delay
        The same arc in the other direction.
    late_G, late_delay
        Long-latency arc.
    length_G
        Torque per displacement of a delayed length reflex [N.m/rad].
    """

    G: float = 10.0
    delay: float = 0.040
    omega: float = 21.0
    zeta: float = 0.8
    threshold: float = 0.0
    exponent: float = 1.0
    saturation: float = 0.0
    depression: float = 0.0
    depression_recovery: float = 0.6
    position_gain: float = 0.0
    antagonist_G: float = 0.0
    antagonist_delay: float = 0.045
    late_G: float = 0.0
    late_delay: float = 0.095
    length_G: float = 0.0


class Interface(NamedTuple):
    """Describes the foot on its plate beyond what straps do.

    Attributes
    ----------
    slide_share
        Part of the foot's inertia that is only carried along while the plate moves up [1].
    slide_velocity
        Velocity that the direction must reach before the foot slides over [rad/s].
    lift_share
        Part of the stiffness that is lost while the heel is lifted [1].
    lift_angle, lift_return
        Dorsiflexion at which the heel lifts and at which it sticks again [rad].
    """

    slide_share: float = 0.0
    slide_velocity: float = 0.05
    lift_share: float = 0.0
    lift_angle: float = 0.008
    lift_return: float = 0.003


class Rig(NamedTuple):
    """Describes drive, plate and foot as MuJoCo bodies (`mechanics`).

    Attributes
    ----------
    foot_inertia, plate_inertia
        About the ankle's axis [kg.m^2].
    foot_mass, foot_forward, foot_below
        Mass [kg] and centre of mass from the axis [m].
    drive_hz, drive_zeta
        Second-order response of the drive to its reference.
    servo_k, servo_hz
        Stiffness of the position servo against load [N.m/rad] and its own natural frequency [Hz];
        a stiffness of 0 is the stiff servo of `mechanics`.
    cell_hz, cell_zeta
        Mode of the load on the torque cell.
    encoder_on_motor
        1 where the encoder sits on the motor's side of the cell, 0 on the plate's.
    strap_k, strap_b
        Straps and pad between plate and foot [N.m/rad], [N.m.s/rad]; 0 is a foot bolted to the
        plate.
    strap_gap
        Backlash of the foot around its resting place before it meets hard stops [rad]; 0 is no
        stops.
    bearing_friction
        Coulomb friction of the plate's bearing, beyond the cell [N.m].
    """

    foot_inertia: float = 0.0107
    plate_inertia: float = 0.0030
    foot_mass: float = 1.0
    foot_forward: float = 0.05
    foot_below: float = 0.04
    drive_hz: float = 35.0
    drive_zeta: float = 0.7
    servo_k: float = 0.0
    servo_hz: float = 40.0
    cell_hz: float = 700.0
    cell_zeta: float = 0.3
    encoder_on_motor: float = 0.0
    strap_k: float = 0.0
    strap_b: float = 0.0
    strap_gap: float = 0.0
    bearing_friction: float = 0.0


class Courses(NamedTuple):
    """Describes what changes in the course of a trial (`courses`).

    Attributes
    ----------
    torque_level
        Mean voluntary torque [N.m].
    voluntary_rms, voluntary_hz
        Its slow fluctuation [N.m] and its bandwidth [Hz].
    pink_rms
        1/f fluctuation of the voluntary torque [N.m].
    steps_rms, ramps_rms
        Voluntary torque that jumps to a new level every few seconds, or moves there evenly [N.m].
    bursts_peak
        Short voluntary contractions at random times, in either direction [N.m].
    tremor_rms, tremor_hz
        [N.m], [Hz].
    stretch_variation
        Standard deviation of the reflex' factor, drawn anew at each movement [1].
    jump_at, jump_muscle, jump_reflex
        Time [s] from which K and B, and the reflex, have these factors [1]; 0 s is never.
    fatigue
        Share of K, B and G that is lost from the first to the last sample [1].
    stiffness_follows
        Relative change of K and B per relative change of the voluntary torque [1].
    reflex_follows
        The same for the reflex.
    startle_share, startle_chance
        Relative stiffening after a movement, and how often it happens [1].
    burst_share
        Relative loss of the reflex in random bouts [1].
    delay_wander
        Rms of a slow wandering of the reflex delay [s].
    """

    torque_level: float = 4.0
    voluntary_rms: float = 0.2
    voluntary_hz: float = 0.5
    pink_rms: float = 0.0
    steps_rms: float = 0.0
    ramps_rms: float = 0.0
    bursts_peak: float = 0.0
    tremor_rms: float = 0.0
    tremor_hz: float = 9.0
    stretch_variation: float = 0.0
    jump_at: float = 0.0
    jump_muscle: float = 1.0
    jump_reflex: float = 1.0
    fatigue: float = 0.0
    stiffness_follows: float = 0.0
    reflex_follows: float = 0.0
    startle_share: float = 0.0
    startle_chance: float = 0.3
    burst_share: float = 0.0
    delay_wander: float = 0.0


class Sensors(NamedTuple):
    """Describes how true motion and torque become numbers (`sensors`).

    Attributes
    ----------
    position_snr, velocity_snr, torque_snr
        [dB].
    torque_delay
        Torque channel behind the position channel [s]; negative is ahead.
    torque_lag
        First-order lag of the torque channel [s].
    mode_hz, mode_zeta
        Lightly damped mode of the torque sensor; 0 Hz is none.
    position_gain
        Position reads true * (1 + gain) [1].
    encoder_backlash
        Backlash between shaft and encoder [rad].
    gear_error, gear_pitch, gear_skewness
        Largest angle [rad] by which the plate is ahead of encoder and tachometer, which sit before
        a gear; the angle [rad] after which this repeats; share of it with twice the pitch's
        frequency [1].
    mains
        50 Hz pick-up in torque, relative to the change of torque over 0.2 s [1].
    torque_step
        Quantisation step of the torque, with hysteresis [N.m].
    cable, cable_hz, cable_zeta
        Torque read per squared velocity [N.m.s^2/rad^2] through a resonance.
    """

    position_snr: float = 52.7
    velocity_snr: float = 37.7
    torque_snr: float = 30.0
    torque_delay: float = 0.0
    torque_lag: float = 0.0
    mode_hz: float = 0.0
    mode_zeta: float = 0.05
    position_gain: float = 0.0
    encoder_backlash: float = 0.0
    gear_error: float = 0.0
    gear_pitch: float = 0.03
    gear_skewness: float = 0.3
    mains: float = 0.0
    torque_step: float = 0.0
    cable: float = 0.0
    cable_hz: float = 17.0
    cable_zeta: float = 0.1


class Setup(NamedTuple):
    """Holds one subject on one rig."""

    muscle: Muscle = Muscle()
    reflex: Reflex = Reflex()
    interface: Interface = Interface()
    rig: Rig = Rig()
    courses: Courses = Courses()
    sensors: Sensors = Sensors()

    def get(self, path: str) -> float:
        """Return a number by its path, as ``muscle.K``."""
        group, field = path.split(".")
        return float(getattr(getattr(self, group), field))

    def replaced(self, changes: dict[str, float]) -> Setup:
        """Return the same setup with some numbers, named by path, changed.

        Raises
        ------
        AttributeError, ValueError
            No such group or field.
        """
        setup = self
        for path, value in changes.items():
            group, field = path.split(".")
            setup = setup._replace(
                **{group: getattr(setup, group)._replace(**{field: float(value)})}
            )
        return setup

    def as_dict(self) -> dict[str, Any]:
        """Return groups of numbers, for the sealed truth."""
        return {group: getattr(self, group)._asdict() for group in self._fields}
