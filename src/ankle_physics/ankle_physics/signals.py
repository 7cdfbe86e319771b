"""Signals describe a stretch of time along the path from the footplate to the torque sensor."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass
class Signals:
    """Holds a stretch of n samples on its way through a model; terms change it in place.

    Signs: position, velocity and torque positive in dorsiflexion; torque is what is needed to move
        the ankle.

    Attributes
    ----------
    rate
        Sampling rate of all arrays [Hz].
    position
        Footplate angle [rad], shape (n,).
    velocity
        Footplate velocity [rad/s], shape (n,).
    acceleration
        Footplate acceleration [rad/s^2], shape (n,).
    activation
        Muscle activation as the background torque that goes with it [N.m], shape (n,); zero at
        rest.
    cocontraction
        Course of the stiffness that opposing muscles add together, with a mean of 0 and a root mean
        square of 1 over the recording [1], shape (n,); zero where nobody knows it.
    foot_position, foot_velocity, foot_acceleration
        The same for the foot; equal to the footplate's until a coupling term moves the foot
        differently.
    drive
        Stretch velocity that the spindles signal [rad/s], shape (n,); the foot's velocity until a
        reflex-input term shapes it. The reflex rectifies it.
    torque
        Torque at the footplate [N.m], shape (n,); filled when the torque terms are summed.
    measured_position, measured_velocity
        What the sensors in the drive report [rad, rad/s], each of shape (n,).
    """

    rate: float
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    activation: np.ndarray | None = None
    cocontraction: np.ndarray | None = None
    foot_position: np.ndarray = field(init=False)
    foot_velocity: np.ndarray = field(init=False)
    foot_acceleration: np.ndarray = field(init=False)
    drive: np.ndarray = field(init=False)
    torque: np.ndarray = field(init=False)
    measured_position: np.ndarray = field(init=False)
    measured_velocity: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        if self.activation is None:
            self.activation = np.zeros(len(self.position))
        if self.cocontraction is None:
            self.cocontraction = np.zeros(len(self.position))
        self.measured_position, self.measured_velocity = self.position, self.velocity
        self.torque = np.zeros(len(self.position))
        self.move_foot(self.position, self.velocity, self.acceleration)

    def between(self, start: int, stop: int) -> Signals:
        """Return a stretch of the plate's motion and the muscles' contraction; foot, drive and
        torque begin anew.

        Parameters
        ----------
        start, stop
            Number of its first sample, and of the one behind its last.
        """
        part = slice(start, stop)
        assert self.activation is not None
        assert self.cocontraction is not None
        return Signals(
            self.rate,
            self.position[part],
            self.velocity[part],
            self.acceleration[part],
            self.activation[part],
            self.cocontraction[part],
        )

    def move_plate(
        self, position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray
    ) -> None:
        """Give plate and foot another motion than the sensors in the drive report.

        Parameters
        ----------
        position, velocity, acceleration
            [rad], [rad/s], [rad/s^2], each of shape (n,).
        """
        self.position, self.velocity, self.acceleration = position, velocity, acceleration
        self.move_foot(position, velocity, acceleration)

    def move_foot(
        self, position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray
    ) -> None:
        """Give the foot a motion of its own; the spindles feel it."""
        self.foot_position, self.foot_velocity, self.foot_acceleration = (
            position,
            velocity,
            acceleration,
        )
        self.drive = velocity
