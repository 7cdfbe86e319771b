"""Faults of line, clocks and sensors, and several at once, and what is promised for each."""

from __future__ import annotations

from campaign_acts import (
    LEAD,
    Fault,
    blocks,
    commands,
    line,
    new_driver,
    new_rig,
    nothing,
    rig_clock,
    ros_time,
    stranger,
    switch,
    together,
)
from campaign_laboratory import Campaign

from ankle_actuator_driver.safety.rig import Wanted

FIRST_MOVEMENT = 1.0  # s; from the order to start, softly
STATES_OF_THE_LINE = (
    Fault("line cut both ways", "faults", line(drop=1.0)),
    Fault("line cut to the rig", "faults", line(up=0.0, drop=1.0)),
    Fault("line cut from the rig", "faults", line(down=0.0, drop=1.0)),
    Fault("line cut both ways, armed", "faults", line(drop=1.0), moment="armed"),
    Fault("line cut both ways, starting", "faults", line(drop=1.0), moment="starting"),
    Fault("line cut both ways, stopping", "ends off", line(drop=1.0), moment="stopping"),
    Fault(
        "2 % of packets lost, 10 % doubled, 2 % damaged",
        "goes on",
        line(drop=0.02, duplicate=0.1, corrupt=0.02),
    ),
    Fault("20 % of packets lost", "any", line(drop=0.2), notice=0.6),
    Fault("half of the packets lost", "any", line(drop=0.5), notice=0.6),
    Fault("half of the packets doubled", "goes on", line(duplicate=0.5)),
    Fault("10 % of packets overtaken", "any", line(reorder=0.1)),
    Fault("half of the packets damaged", "any", line(corrupt=0.5), notice=0.6),
    Fault("bursts of 40 ms on the line", "goes on", line(burst=0.04)),
    Fault("bursts of 80 ms on the line", "any", line(burst=0.08), lasts=1.2),
    Fault("bursts of 300 ms on the line", "faults", line(burst=0.3), lasts=1.2, notice=1.0),
    *(
        Fault(
            f"recorded packets are sent again, {moment}",
            promise,
            **stranger(Campaign.eavesdropper),
            moment=moment,
        )
        for moment, promise in (
            ("running", "goes on"),
            ("armed", "stays armed"),
            ("ready", "stays ready"),
        )
    ),
    Fault(
        "rig restarts and recorded packets are sent again",
        "faults",
        **stranger(together(Campaign.eavesdropper, new_rig)),
        new_stream=True,
    ),
    Fault(
        "driver restarts and recorded packets are sent again",
        "faults",
        **stranger(together(Campaign.eavesdropper, new_driver)),
        new_stream=True,
    ),
    Fault(
        "another driver wants the plate held",
        "goes on",
        **stranger(lambda lab: lab.another_driver(Wanted.HOLD)),
    ),
    Fault(
        "another driver wants the drive off",
        "goes on",
        **stranger(lambda lab: lab.another_driver(Wanted.OFF)),
    ),
    Fault(
        "another driver takes a rig that is ready",
        "ends off",
        lambda lab: lab.another_driver(Wanted.OFF),
        lambda lab: lab.strangers.clear(),
        moment="ready",
    ),
    Fault("another rig reports to the driver", "goes on", **stranger(Campaign.another_rig)),
    Fault(
        "another rig reports to the driver, ready",
        "stays ready",
        **stranger(Campaign.another_rig),
        moment="ready",
    ),
    Fault("any bytes on the line", "goes on", **stranger(lambda lab: lab.noise(5))),
)
CLOCKS = (
    *(
        Fault(
            f"ROS time set by {s:+g} s, {moment}",
            promise,
            ros_time(s),
            nothing,
            moment=moment,
            new_stream=True,
        )
        for s, moment, promise in (
            (3.0, "running", "faults"),
            (-3.0, "running", "faults"),
            (0.1, "running", "faults"),
            (-0.1, "running", "faults"),
            (3600.0, "running", "faults"),
            (-3600.0, "armed", "faults"),
            (3.0, "starting", "faults"),
            (-3.0, "ready", "ends off"),
            (3.0, "stopping", "ends off"),
        )
    ),
    Fault("ROS time set by +5 ms", "goes on", ros_time(0.005), nothing, new_stream=True),
    *(
        Fault(
            f"rig's clock set by {s:+g} s, {moment}",
            promise,
            rig_clock(s),
            nothing,
            moment=moment,
            new_stream=True,
        )
        for s, moment, promise in (
            (30.0, "running", "faults"),
            (-30.0, "running", "faults"),
            (0.2, "running", "stops or faults"),
            (-0.2, "running", "stops or faults"),
            (30.0, "armed", "faults"),
            (-30.0, "ready", "ends off"),
            (30.0, "stopping", "ends off"),
        )
    ),
)
MOMENTS = ("running", "starting", "armed", "ready")
CHANNEL_FAULTS = (
    (
        "not a number",
        {"position_nan": 1.0, "velocity_nan": 1.0, "torque_nan": 1.0},
        ("faults", "faults", "faults", "ends off"),
    ),
    (
        "stuck",
        {"encoder_stuck": 1.0, "velocity_stuck": 1.0, "torque_stuck": 1.0},
        ("faults", "faults", "stays armed", "stays ready"),
    ),
    (
        "saturated",
        {"position_saturated": 1.0, "velocity_saturated": 1.0, "torque_saturated": 1.0},
        ("faults", "faults", "faults", "stays ready"),
    ),
    (
        "spikes in 1 sample of 500",
        {"encoder_spikes": 0.002, "velocity_spikes": 0.002, "torque_spikes": 0.002},
        ("any", "any", "any", "stays ready"),
    ),
)
"""How a channel fails, its switches for position, velocity and torque, and the promises at
`MOMENTS`. A sensor that is stuck is seen in motion only."""
NAMES = ("position", "velocity", "torque")
CHANNELS = tuple(
    Fault(
        f"{channel} {kind}, {moment}",
        promise,
        switch(**{name: size}),
        moment=moment,
        lasts=1.5 if moment == "starting" else 0.6,
        notice=FIRST_MOVEMENT if moment == "starting" else 0.0,
    )
    for kind, switches, promises in CHANNEL_FAULTS
    for channel, (name, size) in zip(
        ("position", "velocity", "torque"), switches.items(), strict=True
    )
    for moment, promise in zip(MOMENTS, promises, strict=True)
)
SENSORS = (
    Fault("all channels NaN", "faults", switch(nan=1.0)),
    Fault("position slips by 0.03 rad", "faults", switch(encoder_slip=0.03)),
    Fault("position slips by 0.03 rad, armed", "faults", switch(encoder_slip=0.03), moment="armed"),
    Fault("torque dead", "faults", switch(torque_dead=1.0)),
    Fault(
        "torque dead from the start",
        "faults",
        switch(torque_dead=1.0),
        moment="starting",
        lasts=1.5,
        notice=FIRST_MOVEMENT,
    ),
    Fault("torque swings by 50 N.m", "faults", switch(torque_swings=0.5)),
    Fault("torque swings by 50 N.m, armed", "faults", switch(torque_swings=0.5), moment="armed"),
    Fault("state packets without samples", "faults", switch(no_samples=1.0)),
    Fault("state packets without samples, armed", "faults", switch(no_samples=1.0), moment="armed"),
    *CHANNELS,
)
FAULT_PAIRS = (
    Fault(
        "rig's clock set by -30 s and driver killed",
        "ends off",
        together(rig_clock(-30.0), new_driver),
        nothing,
        lasts=1.2,
        new_stream=True,
    ),
    Fault(
        "driver killed and position stuck",
        "ends off",
        together(switch(encoder_stuck=1.0), new_driver),
        lasts=1.2,
        new_stream=True,
    ),
    Fault(
        "line cut from the rig and a stop",
        "ends off",
        together(line(down=0.0, drop=1.0), commands("stop")),
    ),
    Fault(
        "line cut to the rig and a stop",
        "ends off",
        together(line(up=0.0, drop=1.0), commands("stop")),
    ),
    Fault(
        "rig checks nothing and torque saturated",
        "faults",
        switch(unchecked=1.0, torque_saturated=1.0),
    ),
    Fault(
        "rig checks nothing and a second generator",
        "faults",
        together(switch(unchecked=1.0), blocks("second generator")["begin"]),
        together(lambda lab: lab.faults(), blocks("")["end"]),
    ),
    Fault(
        "rig checks nothing, ignores OFF, and a stop",
        "faults",
        together(switch(unchecked=1.0, ignore_off=1.0), commands("stop")),
        lasts=1.2,
    ),
    Fault(
        "generator stopped and 20 % of packets lost",
        "any",
        together(line(drop=0.2), lambda lab: setattr(lab, "sending", False)),
        together(lambda lab: lab.faults(), lambda lab: setattr(lab, "sending", True)),
        lasts=1.1,
        notice=LEAD,
    ),
)
