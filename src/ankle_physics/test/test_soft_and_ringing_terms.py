"""Terms for human trials against integrations that share no code with them."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ankle_physics.linear_dynamics import LedSecondOrders
from ankle_physics.model import Model
from ankle_physics.signals import Signals
from ankle_physics.term import term_library

RATE = 2048.0
TIME = np.arange(int(RATE)) / RATE


def movement(t):
    """Position, velocity and acceleration of two sines that start at rest."""
    x, v, a = 0.0, 0.0, 0.0
    for size, frequency in ((0.012, 1.3), (0.004, 6.1)):
        w = 2 * np.pi * frequency
        x = x + size * (1 - np.cos(w * t))
        v = v + size * w * np.sin(w * t)
        a = a + size * w**2 * np.cos(w * t)
    return x, v, a


def torque_of(terms):
    x, v, a = movement(TIME)
    return Model.of(terms).torque(Signals(RATE, x, v, a))


def integrate(right, states):
    return solve_ivp(
        right, [0, TIME[-1]], states, t_eval=TIME, max_step=2e-3, rtol=1e-5, atol=1e-9
    ).y


def test_bonds_of_several_yields_follow_their_equations():
    yields, weights, recovery = (
        np.array([0.001, 0.003, 0.009, 0.027]),
        [40.0, 30.0, 20.0, 10.0],
        0.4,
    )

    def right(t, z):
        rate = movement(t)[1] - np.clip(z, -yields, yields) / recovery
        return np.where((np.abs(z) >= yields) & (rate * z > 0.0), 0.0, rate)

    expected = np.array(weights) @ integrate(right, np.zeros(4))
    given = {f"k{n}": k for n, k in enumerate(weights, 1)}
    found = torque_of({"distributed_short_range_stiffness": {**given, "recovery": recovery}})
    assert np.abs(found - expected).max() < 5e-3 * np.abs(expected).max()


THIXOTROPY = {"k": 200.0, "breaking": 0.01, "recovery": 0.3}


def test_bonds_that_movement_breaks_and_rest_rebuilds_follow_their_equations():
    def right(t, state):
        intact, stretch = state
        v = movement(t)[1]
        broken = abs(v) / THIXOTROPY["breaking"]
        built = (1.0 - intact) / THIXOTROPY["recovery"]
        return [built - broken * intact, intact * v - broken * stretch]

    expected = THIXOTROPY["k"] * integrate(right, [1.0, 0.0])[1]
    found = torque_of({"thixotropy": THIXOTROPY})
    assert np.abs(found - expected).max() < 5e-3 * np.abs(expected).max()


def test_bonds_that_form_at_rest_make_no_torque():
    x = np.clip(TIME, 0.0, 0.1) / 0.1 * 0.03
    v = np.gradient(x, TIME)
    made = Model.of({"thixotropy": THIXOTROPY}).torque(Signals(RATE, x, v, np.zeros(len(x))))
    held = made[TIME > 0.11]
    np.testing.assert_allclose(held, held[0], rtol=1e-9)


LOST = {"gap": 0.003}


def lost_motion(x, v, a):
    signals = Signals(RATE, x, v, a)
    Model.of({"lost_motion": LOST}).start(RATE).torque(signals)
    return signals


def test_a_plate_behind_a_loose_shaft_follows_its_equation():
    gap = LOST["gap"]

    def right(t, z):
        rate = movement(t)[1]
        return rate - np.abs(rate) * z / gap

    z = integrate(right, np.zeros(1))[0]
    x, v, a = movement(TIME)
    signals = lost_motion(x, v, a)
    expected = x - 0.5 * z
    assert np.abs(signals.position - expected).max() < 0.01 * gap
    np.testing.assert_array_equal(signals.measured_position, x)
    np.testing.assert_array_equal(signals.measured_velocity, v)
    np.testing.assert_array_equal(signals.foot_position, signals.position)


def test_velocity_and_acceleration_behind_a_loose_shaft_are_those_of_its_position():
    signals = lost_motion(*movement(TIME))
    velocity = np.gradient(signals.position) * RATE
    assert np.std((signals.velocity - velocity)[1:-1]) < 0.01 * np.std(velocity)
    acceleration = np.gradient(signals.velocity) * RATE
    # It jumps where the drive turns.
    turns = np.flatnonzero(np.diff(np.sign(signals.measured_velocity)))
    smooth = np.abs(np.arange(len(TIME))[:, None] - turns).min(axis=1) > 2
    smooth[[0, -1]] = False
    apart = (signals.acceleration - acceleration)[smooth]
    assert np.std(apart) < 0.01 * np.std(acceleration)


def test_a_loose_shaft_loses_its_gap_between_two_reversals():
    level = np.concatenate([np.zeros(10), np.linspace(0.0, 0.04, 200), np.linspace(0.04, 0.0, 200)])
    v = np.gradient(level) * RATE
    plate = lost_motion(level, v, np.gradient(v) * RATE).position
    up = np.interp(0.02, level[:210], plate[:210])
    down = np.interp(0.02, level[:209:-1], plate[:209:-1])
    assert down - up == pytest.approx(LOST["gap"], rel=0.02)


RECOVERING = {"gap": 0.003, "recovery": 0.15}


def behind_a_yielding_coupling(x, v, a, values=RECOVERING):
    signals = Signals(RATE, x, v, a)
    Model.of({"recovering_lost_motion": values}).start(RATE).torque(signals)
    return signals


def test_a_plate_behind_a_yielding_coupling_follows_its_equation():
    limit = 0.5 * RECOVERING["gap"]

    def right(t, z):
        rate = movement(t)[1]
        grows = np.where(z * rate > 0.0, 1.0 - (z / limit) ** 2, 1.0)
        return rate * grows - z / RECOVERING["recovery"]

    z = integrate(right, np.zeros(1))[0]
    x, v, a = movement(TIME)
    signals = behind_a_yielding_coupling(x, v, a)
    assert np.abs(signals.position - (x - z)).max() < 0.02 * limit
    np.testing.assert_array_equal(signals.measured_position, x)
    np.testing.assert_array_equal(signals.foot_position, signals.position)


def test_velocity_and_acceleration_behind_a_yielding_coupling_are_those_of_its_position():
    signals = behind_a_yielding_coupling(*movement(TIME))
    velocity = np.gradient(signals.position) * RATE
    assert np.std((signals.velocity - velocity)[1:-1]) < 0.01 * np.std(velocity)
    acceleration = np.gradient(signals.velocity) * RATE
    # It jumps where the drive turns and where the spring has come back to its middle.
    z = signals.measured_position - signals.position
    corners = np.flatnonzero(
        np.diff(np.sign(signals.measured_velocity)) + np.diff(np.sign(z)) != 0.0
    )
    smooth = np.abs(np.arange(len(TIME))[:, None] - corners).min(axis=1) > 3
    smooth[[0, -1]] = False
    apart = (signals.acceleration - acceleration)[smooth]
    assert np.std(apart) < 0.03 * np.std(acceleration)


def test_a_plate_behind_a_yielding_coupling_settles_back_at_rest():
    steps = np.concatenate([np.zeros(10), np.linspace(0.0, 0.03, 40), np.full(1500, 0.03)])
    v = np.gradient(steps) * RATE
    plate = behind_a_yielding_coupling(steps, v, np.gradient(v) * RATE).position
    lost = steps - plate
    assert lost[50] == pytest.approx(0.5 * RECOVERING["gap"], rel=0.15)
    later = 50 + round(RECOVERING["recovery"] * RATE)
    assert lost[later] == pytest.approx(lost[50] / np.e, rel=0.02)


def test_a_yielding_coupling_without_recovery_loses_its_gap_between_two_reversals():
    level = np.concatenate([np.zeros(10), np.linspace(0.0, 0.04, 200), np.linspace(0.04, 0.0, 200)])
    v = np.gradient(level) * RATE
    held = {**RECOVERING, "recovery": 20.0}
    plate = behind_a_yielding_coupling(level, v, np.gradient(v) * RATE, held).position
    up = np.interp(0.02, level[:210], plate[:210])
    down = np.interp(0.02, level[:209:-1], plate[:209:-1])
    assert down - up == pytest.approx(RECOVERING["gap"], rel=0.03)


def test_bonds_of_several_yields_are_the_stiffer_the_smaller_the_movement():
    stiffness = []
    for size in (0.0005, 0.006, 0.04):
        x = size * 0.5 * (1 - np.cos(2 * np.pi * TIME))
        v = np.gradient(x) * RATE
        model = Model.of({"distributed_short_range_stiffness": {"recovery": 20.0}})
        stiffness.append(np.ptp(model.torque(Signals(RATE, x, v, np.gradient(v) * RATE))) / size)
    assert stiffness[0] > 1.2 * stiffness[1] > 1.2 * 1.2 * stiffness[2]


def test_a_muscle_is_stiffer_while_its_reflex_contracts_it():
    arc, recovery = {"delay": 0.05, "omega": 15.0}, 0.3
    contraction = torque_of({"reflex": {"G": 1.0, "z": 0.8, **arc}})
    stretch = integrate(lambda t, z: movement(t)[1] - z / recovery, [0.0])[0]
    found = torque_of({"reflex_stiffening": {"kr": 200.0, "recovery": recovery, **arc}})
    expected = 200.0 * contraction * stretch
    assert np.abs(found - expected).max() < 5e-3 * np.abs(expected).max()


def test_noise_below_the_yield_does_not_let_bonds_forget():
    held = np.full(len(TIME), 0.001) + np.random.default_rng(1).normal(0.0, 1e-4, len(TIME))
    held[0] = 0.0
    model = Model.of({"short_range_stiffness": {"k": 100.0, "yield": 0.005, "recovery": 20.0}})
    torque = model.torque(Signals(RATE, held, np.gradient(held) * RATE, np.zeros(len(TIME))))
    assert np.mean(torque[-100:]) == pytest.approx(0.1 * np.exp(-TIME[-1] / 20.0), rel=0.02)


def test_a_part_that_hangs_on_the_plate_pulls_with_its_own_inertia():
    inertia, w, z = 0.003, 2 * np.pi * 17.0, 0.05

    def right(t, y):
        x, v, _ = movement(t)
        return [y[1], 2 * z * w * (v - y[1]) + w**2 * (x - y[0])]

    y = integrate(right, [0.0, 0.0])
    x, v, _ = movement(TIME)
    expected = inertia * (2 * z * w * (v - y[1]) + w**2 * (x - y[0]))
    found = torque_of({"plate_appendage": {"Ia": inertia, "frequency": 17.0, "damping": z}})
    # The acceleration jumps at the first sample; the appendage feels it half a sample later.
    assert np.abs(found - expected)[200:].max() < 0.02 * np.abs(expected).max()


@pytest.mark.parametrize("share", [0.1, 0.9])
def test_a_sensor_that_carries_a_share_rings_by_that_share(share):
    w, z = 2 * np.pi * 24.0, 0.1

    def right(t, y):
        return [y[1], w**2 * (80.0 * movement(t)[0] - y[0]) - 2 * z * w * y[1]]

    load = 80.0 * movement(TIME)[0]
    expected = (1 - share) * load + share * integrate(right, [0.0, 0.0])[0]
    found = torque_of(
        {
            "stiffness": {"K": 80.0},
            "partial_sensor_mode": {"frequency": 24.0, "damping": z, "share": share},
        }
    )
    assert np.abs(found - expected).max() < 1e-3 * np.abs(expected).max()


def test_a_sensor_mode_states_the_response_that_it_simulates():
    term = term_library()["partial_sensor_mode"]()
    values = {"frequency": 24.0, "damping": 0.1, "share": 0.4}
    signals = Signals(RATE, TIME, TIME, TIME)
    signals.torque = np.zeros(len(TIME))
    signals.torque[1] = RATE
    term.transform(signals, values, term.start(RATE))
    frequency = np.array([5.0, 20.0, 24.0, 40.0])
    made = np.array(
        [np.sum(signals.torque * np.exp(-2j * np.pi * f * (TIME - 1 / RATE))) for f in frequency]
    )
    assert np.abs(made / RATE - term.response(frequency, values)).max() < 0.02


def test_stiffness_follows_its_rhythm():
    x, _, _ = movement(TIME)
    found = torque_of(
        {"stiffness": {"K": 80.0}, "cyclic_stiffness": {"kc": 12.0, "ks": -9.0, "frequency": 0.5}}
    )
    stiffness = 80.0 + 15.0 * np.cos(2 * np.pi * 0.5 * TIME + np.arctan2(9.0, 12.0))
    assert np.abs(found - stiffness * x).max() < 1e-9


def _assert_newton(name, values, strap):
    """A foot behind a coupling moves as Newton's law says of this torque of the straps."""
    I, B, K = 0.0137, 0.63, 100.0

    def right(t, y):
        x, v, _ = movement(t)
        return [y[1], (strap(x - y[0], v - y[1]) - B * y[1] - K * y[0]) / I]

    foot = integrate(right, [0.0, 0.0])
    x, v, _ = movement(TIME)
    expected = strap(x - foot[0], v - foot[1])
    impedance = {"inertia": {"I": I}, "viscosity": {"B": B}, "stiffness": {"K": K}}
    found = torque_of({**impedance, name: values})
    assert np.abs(found - expected)[200:].max() < 5e-3 * np.abs(expected).max()


@pytest.mark.parametrize("curvature", [-60.0, 0.0, 60.0])
def test_a_foot_behind_a_strap_that_stiffens_follows_newton(curvature):
    k, b = 1500.0, 2.0

    def strap(e, rate):
        curve = np.expm1(curvature * e) / curvature if curvature else e
        return k * curve + b * rate

    _assert_newton("stiffening_fixation", {"k_s": k, "b_s": b, "curvature": curvature}, strap)


@pytest.mark.parametrize("k_stop", [600.0, 6000.0])
def test_a_foot_that_strikes_stops_follows_newton(k_stop):
    k, b, gap = 700.0, 2.0, 0.001
    struck = []

    def strap(e, rate):
        beyond = np.maximum(e - gap, 0.0) + np.minimum(e + gap, 0.0)
        struck.append(np.any(beyond != 0.0))
        return k * e + k_stop * beyond + b * rate

    _assert_newton("fixation_stops", {"k_s": k, "b_s": b, "gap": gap, "k_stop": k_stop}, strap)
    assert 0.05 < np.mean(struck) < 0.95


def test_friction_of_the_bearing_is_read_in_front_of_the_straps():
    soft = {"inertia": {"I": 0.0137}, "fixation_compliance": {"k_s": 600.0, "b_s": 1.0}}
    rubs = {**soft, "coulomb_friction": {"F": 1.5, "v0": 0.02}}
    friction = torque_of(rubs) - torque_of(soft)
    assert np.abs(friction - 1.5 * np.tanh(movement(TIME)[1] / 0.02)).max() < 1e-9


def test_a_part_beside_the_load_path_is_imitated_by_a_foot_in_its_straps():
    swings = {
        "inertia": {"I": 0.006},
        "plate_appendage": {"Ia": 0.009, "frequency": 60.0, "damping": 0.08},
    }
    (straps,) = term_library()["plate_appendage"].imitated_by(swings).values()
    expected, found = torque_of(swings), torque_of(straps)
    settled = slice(400, None)  # the acceleration jumps at the first sample
    assert np.abs(found - expected)[settled].max() < 0.01 * np.abs(expected).max()


def test_several_signals_pass_a_led_second_order_alike():
    w, z, lead = 2 * np.pi * 30.0, 0.2, 0.004

    def right(t, y):
        x, v, _ = movement(t)
        return [y[1], w**2 * (x + lead * v - y[0]) - 2 * z * w * y[1]]

    expected = integrate(right, [0.0, 0.0])[0]
    both = np.array([movement(TIME)[0], -2.0 * movement(TIME)[0]])
    filters = LedSecondOrders(RATE, 2)
    parts = [filters.run(part, w, z, lead) for part in np.split(both, [700], axis=1)]
    found = np.concatenate(parts, axis=1)
    assert np.abs(found - [expected, -2.0 * expected]).max() < 1e-3 * np.abs(expected).max()


UNEVEN = {"s": 4e-4, "c": -3e-4, "p": 0.018, "xc": 0.002}


def behind_uneven_gear(x, v, a):
    signals = Signals(RATE, x, v, a)
    Model.of({"cyclic_angle_error": UNEVEN}).start(RATE).torque(signals)
    return signals


def test_an_angle_error_repeats_as_the_plate_turns_and_has_its_size():
    x = np.linspace(-0.03, 0.03, 6001)
    error = behind_uneven_gear(x, np.zeros_like(x), np.zeros_like(x)).position - x
    once = round(UNEVEN["p"] / (x[1] - x[0]))
    np.testing.assert_allclose(error[once:], error[:-once], atol=1e-9)
    assert np.ptp(error) == pytest.approx(2 * 5e-4, rel=1e-3)
    assert np.interp(UNEVEN["xc"], x, error) == pytest.approx(UNEVEN["c"], rel=1e-6)


def test_the_plate_behind_an_uneven_gear_moves_as_its_angle_says():
    signals = behind_uneven_gear(*movement(TIME))
    np.testing.assert_array_equal(signals.measured_position, movement(TIME)[0])
    for rate, angle in (
        (signals.velocity, signals.position),
        (signals.acceleration, signals.velocity),
    ):
        expected = np.gradient(angle) * RATE
        assert np.std((rate - expected)[1:-1]) < 0.005 * np.std(expected)


CURVE = {"e3": 4e-4, "e7": -3e-4, "e8": 5e-4, "span": 0.06, "xc": 0.004}


def behind_an_uneven_potentiometer(x, v, a, values=CURVE):
    signals = Signals(RATE, x, v, a)
    Model.of({"uneven_angle": values}).start(RATE).torque(signals)
    return signals


def test_an_uneven_angle_has_neither_offset_nor_slope():
    straight = {f"e{k}": 2e-4 + 1e-4 * k for k in range(1, 14)} | {"span": 0.06, "xc": 0.0}
    x = np.linspace(-0.05, 0.05, 1001)
    still = np.zeros_like(x)
    plate = behind_an_uneven_potentiometer(x, still, still, straight).position
    np.testing.assert_allclose(plate, x, atol=1e-12)


def test_an_uneven_angle_is_largest_at_its_knot_and_ends_beyond_its_span():
    x = np.linspace(-0.08, 0.08, 3201)
    still = np.zeros_like(x)
    one = {"e7": 9e-4, "span": 0.06, "xc": 0.004}
    error = behind_an_uneven_potentiometer(x, still, still, one).position - x
    assert x[np.argmax(error)] == pytest.approx(one["xc"], abs=2e-4)
    np.testing.assert_array_equal(error[np.abs(x - one["xc"]) > 0.041], 0.0)


def test_the_plate_behind_an_uneven_potentiometer_moves_as_its_angle_says():
    signals = behind_an_uneven_potentiometer(*movement(TIME))
    np.testing.assert_array_equal(signals.measured_position, movement(TIME)[0])
    assert np.ptp(signals.position - signals.measured_position) > 2e-4
    for rate, angle in (
        (signals.velocity, signals.position),
        (signals.acceleration, signals.velocity),
    ):
        expected = np.gradient(angle) * RATE
        assert np.std((rate - expected)[1:-1]) < 0.005 * np.std(expected)
