"""Terms for human trials against integrations that share no code with them."""

import numpy as np
import pytest
from two_sines import RATE, TIME, integrate, movement

from ankle_physics.linear_dynamics import LedSecondOrders
from ankle_physics.model import Model
from ankle_physics.signals import Signals
from ankle_physics.term import term_library
from ankle_physics.terms.coulomb_friction import direction


def torque_of(terms):
    x, v, a = movement(TIME)
    return Model.of(terms).torque(Signals(RATE, x, v, a))


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


@pytest.mark.parametrize("power", [0.3, 2.0])
def test_damping_follows_a_power_of_fast_movements_and_is_a_viscosity_at_rest(power):
    def torque(velocity):
        v = np.full(3, velocity)
        damping = {"power_damping": {"D": 3.0, "p": power}}
        return Model.of(damping).torque(Signals(RATE, v, v, np.zeros(3)))[0]

    assert torque(1.0) == pytest.approx(3.0, rel=0.01)
    assert torque(-4.0) == pytest.approx(-3.0 * 4.0**power, rel=0.01)
    assert torque(2e-4) == pytest.approx(2.0 * torque(1e-4), rel=1e-3)


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


@pytest.mark.parametrize("lift", [0.0005, 0.001])
def test_a_foot_that_lifts_off_the_plate_follows_newton(lift):
    k, b, k_lift = 1500.0, 2.0, 300.0
    lifted = []

    def pressed(e):
        return np.where(e > lift, k * (e - lift), k_lift * (e - lift))

    def strap(e, rate):
        lifted.append(np.any(e < lift))
        return pressed(e) - pressed(0.0) + b * rate

    _assert_newton("heel_lift", {"k_s": k, "b_s": b, "k_lift": k_lift, "lift": lift}, strap)
    assert 0.05 < np.mean(lifted) < 0.95


def test_friction_of_the_bearing_is_read_in_front_of_the_straps():
    soft = {"inertia": {"I": 0.0137}, "fixation_compliance": {"k_s": 600.0, "b_s": 1.0}}
    rubs = {**soft, "coulomb_friction": {"F": 1.5, "v0": 0.02}}
    friction = torque_of(rubs) - torque_of(soft)
    # It is the mean over each sample, which differs a little where the friction turns.
    assert np.abs(friction - 1.5 * np.tanh(movement(TIME)[1] / 0.02)).max() < 2e-3


def test_friction_is_the_mean_over_a_sample_in_which_it_turns():
    rate, velocity, acceleration = 500.0, np.array([-0.01, 0.004, 1.0]), np.array([20.0, -9.0, 3.0])
    signals = Signals(rate, np.zeros(3), velocity, acceleration)
    within = np.linspace(-0.5, 0.5, 20001)[:, np.newaxis] / rate
    turning = velocity + acceleration * (within + 0.0005)
    expected = np.trapezoid(np.tanh(turning / 0.005), dx=1.0 / 20000, axis=0)
    assert direction(signals, 0.005, 0.0005) == pytest.approx(expected, abs=1e-6)
    still = Signals(rate, np.zeros(3), velocity, np.zeros(3))
    assert direction(still, 0.005, 0.0) == pytest.approx(np.tanh(velocity / 0.005), abs=1e-6)


def test_how_friction_turns_changes_nothing_while_the_plate_moves():
    moving = Signals(2048.0, np.zeros(2), np.array([0.3, -0.3]), np.array([5.0, 5.0]))
    turned = term_library()["friction_turning"]().torque(moving, {}, {})
    assert np.abs(list(turned.values())).max() < 1e-6
    slow = Signals(2048.0, np.zeros(2), np.array([0.005, -0.005]), np.zeros(2))
    assert (
        np.abs(list(term_library()["friction_turning"]().torque(slow, {}, {}).values())).max() > 0.1
    )


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
