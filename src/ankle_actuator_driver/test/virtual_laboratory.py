"""Driver and emulated controller in virtual time: two clocks, a line that can fail, no sockets and
no waiting.
"""

import numpy as np
from scipy.signal import cont2discrete, lfilter

from ankle_actuator_driver.link.protocol.driver_end import DriverEnd
from ankle_actuator_driver.link.protocol.packet import Heartbeat, Reference, parse
from ankle_actuator_driver.safety.bridge import Bridge
from ankle_actuator_driver.safety.limits import Limits
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings
from rig_emulator.emulated_device import EmulatedDevice
from rig_emulator.faults import Faults
from rig_emulator.faulty_line import FaultyLine
from rig_emulator.faulty_sensors import FaultySensors

RATE = 2048.0
EPOCH = 1.76e9  # s; ROS time at the start
STEP = 0.002  # s; of virtual time between looks at line and watchdogs
BLOCK = 32
OMEGA, DAMPING = 2 * np.pi * 30.0, 0.7


class SpringPlant:
    """A 30 Hz servo with a spring on it, as simple as can be; measured position and torque can be
    faked.
    """

    def __init__(self, stiffness=100.0):
        outputs = np.eye(2)
        a, b = (
            np.array([[0.0, 1.0], [-(OMEGA**2), -2 * DAMPING * OMEGA]]),
            np.array([[0.0], [OMEGA**2]]),
        )
        a, b, *_ = cont2discrete((a, b, outputs, np.zeros((2, 1))), 1 / RATE)
        denominator = np.poly(a)
        self._filters = [(self._numerator(a, b, row), denominator) for row in outputs]
        self._memory = [np.zeros(2), np.zeros(2)]
        self.stiffness, self.torque, self.position = stiffness, None, None
        self.velocity = np.zeros(0)
        self.faults, self._sensors = Faults(), FaultySensors(RATE, 3)

    @staticmethod
    def _numerator(a, b, row):
        return np.array([0.0, row @ b[:, 0], row @ (a - np.trace(a) * np.eye(2)) @ b[:, 0]])

    def run(self, command):
        motion = []
        for k, (numerator, denominator) in enumerate(self._filters):
            values, self._memory[k] = lfilter(
                numerator, denominator, command[:, 0], zi=self._memory[k]
            )
            motion.append(values)
        self.velocity = motion[1]
        samples = np.column_stack([motion[0], motion[1], self.stiffness * motion[0]])
        if self.position is not None:
            samples[:, 0], samples[:, 1] = self.position, 0.0
        if self.torque is not None:
            samples[:, 2] = self.torque
        return self._sensors.change(samples, self.faults)


class WatchedDevice(EmulatedDevice):
    """Keeps what the servo is told (rig's time, position, velocity, acceleration) and the plate's
    velocity at the end of each cycle.
    """

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.commands, self.velocities = [], []

    def _servo(self, now):
        motion = super()._servo(now)
        self.commands.append((now, *motion))
        return motion

    def _cycle(self):
        super()._cycle()
        self.velocities.append((self.commands[-1][0], float(self._plant.velocity[-1])))


class VirtualLaboratory:
    """Reference, driver, line and rig; time passes by `run`.

    Attributes
    ----------
    now
        Of the driver's steady clock [s].
    valid
        Rig's times at which it obeyed a packet.
    sent
        Samples of every reference packet that the driver sent.
    obeyed
        Samples of every reference packet that the rig obeyed.
    blocks
        What the driver published, shape (n, 4) each.
    changes
        Every state of the driver with its reason.
    """

    def __init__(
        self,
        drift=50e-6,
        offset=1000.0,
        limits=None,
        plant=None,
        delay=0.0003,
        seed=1,
        lead=0.1,
        key=b"",
    ):
        self.now, self.drift, self.offset, self.epoch = 0.0, drift, offset, EPOCH
        self.lead, self.delay, self.limits = lead, delay, limits or Limits()
        self.plant = plant or SpringPlant()
        self.key = key
        self.device = WatchedDevice(self.plant, self.limits, RATE, 77, self.rig_time, key)
        self.bridge = Bridge(self.limits, 0.5, 0.0)
        self.end = DriverEnd(4711, key)
        self.down, self.up = FaultyLine(seed), FaultyLine(seed + 1)
        self.valid, self.sent, self.obeyed, self.blocks, self.changes, self.notes = (
            [],
            [],
            [],
            [],
            [],
            [],
        )
        self.packets, self.stretches = [], []
        self.sending = True
        self.talking = True
        self.hearing = True
        self.signal = PulseStep(Settings(rate=RATE, seed=seed))
        self.scale = 1.0
        self._count = 0

    @property
    def ros(self):
        return self.epoch + self.now

    @property
    def rig_time(self):
        return self.offset + self.now * (1.0 + self.drift)

    @property
    def state(self):
        return self.bridge.states.state.value

    def run(self, seconds):
        end = self.now + seconds
        while self.now < end - 1e-9:
            self.now += STEP
            self._step()
        return self

    def _step(self):
        self._refer()
        if self.hearing:
            for data in self.up.due(self.now - self.delay):
                self.take(data)
            if self.talking and self.bridge.advance(self.now, self.ros):
                self.end.restart_clock()
        self.send()
        self.blocks += self.bridge.samples
        self.changes += self.bridge.states.changes
        self.notes += self.bridge.notes
        self.bridge.samples, self.bridge.states.changes, self.bridge.notes = [], [], []
        for data in self.down.due(self.now - self.delay):
            self.deliver(data)
        for data in self.device.advance(self.rig_time):
            self.up.send(data, self.now)

    def take(self, data):
        """Bytes that come to the driver."""
        for event in self.end.take(data, self.now, self.ros):
            self.bridge.take(event, self.now)

    def send(self):
        for order in self.bridge.take_orders(self.now):
            if order.stretch is not None:
                self.stretches.append(order.stretch)
            for data in self.end.packets(order, self.now, self.ros):
                packet = parse(data, self.key)
                if isinstance(packet, Reference):
                    self.sent.append(packet.motion)
                if self.talking:
                    self.packets.append(data)
                    self.down.send(data, self.now)

    def new_driver(self, session):
        """The driver's process starts anew."""
        self.bridge, self.end = Bridge(self.limits, 0.5, 0.0), DriverEnd(session, self.key)

    def faults(self, **switches):
        """Switch faults of controller, sensors and line."""
        faults = Faults(**switches)
        self.device.faults = self.plant.faults = faults
        self.up.faults = self.down.faults = faults

    def deliver(self, data):
        obeyed = self.device.receive(data, self.rig_time)
        if isinstance(obeyed, Heartbeat):
            self.valid.append(self.rig_time)
        # What is not for this start of the rig is a greeting: answered, and nothing more.
        if isinstance(obeyed, Reference) and obeyed.rig:
            self.obeyed.append(obeyed.motion)
        return obeyed

    def _refer(self):
        while self._count * BLOCK / RATE < self.now + self.lead:
            time = EPOCH + (self._count * BLOCK + np.arange(BLOCK)) / RATE
            motion = self.signal.next(BLOCK) * self.scale
            self._count += 1
            if self.sending:
                self.bridge.reference(time, motion, self.now, self.ros)

    def command(self, name):
        answer = self.bridge.command(name, self.now, self.ros)
        self.send()
        return answer

    def until(self, state, seconds=3.0):
        end = self.now + seconds
        while self.state != state:
            assert self.now < end, f"not {state} but {self.state}: {self.bridge.states.reason}"
            self.run(STEP)
        return self

    def armed(self):
        self.until("ready")
        assert self.command("arm").done
        return self.run(0.1)

    def running(self, seconds=1.5):
        """Armed and started; the plate follows the reference for so long."""
        self.armed()
        assert self.command("start").done
        self.run(seconds)
        assert self.state == "running", self.bridge.states.reason
        return self

    def until_moving(self, speed=1.0):
        """Until the servo is told to move at least so fast [rad/s]."""
        end = self.now + 3.0
        while abs(self.device.command[1]) < speed:
            assert self.now < end, "no movement came"
            self.run(STEP)
        return self

    def commands(self, since=0.0):
        """Commands later than a rig's time, shape (n, 4): rig's time, position, velocity,
        acceleration.
        """
        commands = np.array(self.device.commands)
        return commands[commands[:, 0] > since]

    def moves_until(self, since):
        """Seconds after a rig's time at which servo and plate still moved, shape (2,); 0 where they
        did not.
        """
        commands = self.commands(since)
        plate = np.array([entry for entry in self.device.velocities if entry[0] > since])
        commanded, real = (
            commands[np.abs(commands[:, 2]) > 0, 0],
            plate[np.abs(plate[:, 1]) > 1e-3, 0],
        )
        return np.array([times.max() - since if len(times) else 0.0 for times in (commanded, real)])


def unchecked(laboratory, **options):
    """A running rig that checks nothing, and a reference that waits to be given by hand."""
    lab = laboratory(**options)
    lab.device.faults = lab.faults(unchecked=1.0) or lab.device.faults
    lab.running()
    return lab
