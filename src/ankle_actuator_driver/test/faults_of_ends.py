"""Faults of driver, operator, generator and rig, and what is promised for each."""

from __future__ import annotations

from campaign_acts import (
    COMMANDS,
    LEAD,
    OPERATOR,
    Fault,
    blocks,
    commands,
    emergency_stop,
    generator_clock,
    late_blocks,
    line,
    new_driver,
    new_generator,
    new_rig,
    nothing,
    sets,
    switch,
    together,
    vanishing,
)

BUTTON = {"begin": emergency_stop(True), "end": emergency_stop(False)}
HANGS = tuple(
    Fault(f"driver hangs for {1e3 * s:.0f} ms", promise, **sets("hearing", False, True), lasts=s)
    for s, promise in (
        (0.05, "goes on"),
        (0.09, "goes on"),
        (0.15, "any"),
        (0.3, "faults"),
        (0.5, "faults"),
    )
)
DRIVER = (
    Fault("driver stopped (SIGSTOP), goes on", "faults", **sets("hearing", False, True)),
    *HANGS,
    Fault("driver hangs while it arms", "faults", **sets("hearing", False, True), moment="arming"),
    Fault(
        "driver hangs while it starts", "faults", **sets("hearing", False, True), moment="starting"
    ),
    Fault(
        "driver hangs while it stops", "ends off", **sets("hearing", False, True), moment="stopping"
    ),
    Fault("driver killed and restarted", "faults", new_driver, nothing, new_stream=True),
    *(
        Fault(
            f"driver killed and restarted, {moment}",
            promise,
            new_driver,
            nothing,
            moment=moment,
            lasts=1.2,
            new_stream=True,
        )
        for moment, promise in (
            ("ready", "ends off"),
            ("armed", "faults"),
            ("starting", "faults"),
            ("stopping", "ends off"),
            ("fault", "ends off"),
        )
    ),
    Fault("driver's packets stay away", "faults", **sets("talking", False, True)),
    Fault(
        "driver takes no commands",
        "stops",
        **vanishing("commands_come"),
        lasts=1.6,
        notice=COMMANDS,
    ),
    Fault("operator's page is lost", "stops", **vanishing("operator"), lasts=2.6, notice=OPERATOR),
)
COMMANDS_OF_THE_OPERATOR = (
    Fault("stop while an arming is pending", "stops", commands("stop"), nothing, moment="arming"),
    Fault("stop while a start is pending", "stops", commands("stop"), nothing, moment="starting"),
    Fault("stop while it stops", "stops", commands("stop"), nothing, moment="stopping"),
    Fault("stop in a fault", "stays in fault", commands("stop"), nothing, moment="fault"),
    Fault("start without arming", "stays ready", commands("start"), nothing, moment="ready"),
    Fault(
        "arm and start at the same moment",
        "stays armed",
        commands("arm", "start"),
        nothing,
        moment="ready",
    ),
    Fault("arm while it runs", "goes on", commands("arm"), nothing),
    Fault("start twice", "goes on", commands("start", "start"), nothing),
    Fault(
        "disarm and arm within 20 ms",
        "stops",
        commands("disarm", "arm", apart=0.02),
        nothing,
        moment="armed",
    ),
    Fault(
        "stop, arm, start as fast as possible", "stops", commands("stop", "arm", "start"), nothing
    ),
    Fault("arm in a fault", "stays in fault", commands("arm"), nothing, moment="fault"),
    Fault(
        "reset of a fault whose cause is there",
        "stays in fault",
        together(emergency_stop(True), lambda lab: lab.run(0.1), commands("reset_fault")),
        emergency_stop(False),
        moment="fault",
    ),
    Fault(
        "reset of a fault while the rig is silent",
        "stays in fault",
        together(line(drop=1.0), lambda lab: lab.run(0.2), commands("reset_fault")),
        moment="fault",
    ),
)
GENERATOR = (
    Fault("generator stopped", "stops", **sets("sending", False, True), lasts=1.1, notice=LEAD),
    *(
        Fault(f"generator hangs for {1e3 * s:.0f} ms", "goes on", **late_blocks(s), lasts=s)
        for s in (0.05, 0.2, 0.4)
    ),
    Fault(
        "generator hangs for 700 ms", "stops or faults", **late_blocks(0.7), lasts=0.7, notice=LEAD
    ),
    Fault("generator killed and restarted", "faults", new_generator, nothing, notice=LEAD),
    Fault(
        "generator restarted while it starts",
        "any",
        new_generator,
        nothing,
        moment="starting",
        notice=LEAD,
    ),
    Fault(
        "generator's clock set by +3 s",
        "stops or faults",
        generator_clock(3.0),
        generator_clock(-3.0),
        notice=LEAD,
    ),
    Fault(
        "generator's clock set by -3 s",
        "stops or faults",
        generator_clock(-3.0),
        generator_clock(3.0),
        notice=LEAD,
    ),
    Fault(
        "generator's clock set by +0.3 s",
        "any",
        generator_clock(0.3),
        nothing,
        notice=LEAD,
    ),
    Fault("blocks of a second generator", "faults", **blocks("second generator")),
    Fault(
        "blocks of a second generator at the same times",
        "goes on",
        **blocks("second generator in step"),
    ),
    Fault(
        "a second node publishes the reference",
        "faults",
        together(
            lambda lab: setattr(lab, "commands_come", True),
            lambda lab: setattr(lab, "sources", ["/one", "/two"]),
        ),
        lambda lab: setattr(lab, "sources", ["/one"]),
        notice=0.1,
    ),
    Fault("blocks of the reference doubled", "goes on", **blocks("doubled")),
    Fault("blocks of the reference reordered", "any", **blocks("reordered"), notice=LEAD),
    Fault("one block of the reference in 20 lost", "any", **blocks("lost"), notice=LEAD),
    Fault(
        "blocks of the reference without their first 3 samples",
        "goes on",
        **blocks("cut"),
        notice=LEAD,
    ),
    Fault(
        "blocks of the reference not finite",
        "stops",
        **blocks("not finite"),
        lasts=1.1,
        notice=LEAD,
    ),
    Fault("blocks of the reference of a slow clock", "faults", **blocks("slow"), notice=LEAD),
    Fault("blocks of the reference beyond the angle limit", "faults", **blocks("beyond")),
)
RIG = (
    Fault("rig's communication hangs", "faults", switch(freeze=1.0)),
    Fault("rig's communication hangs for 60 ms", "goes on", switch(freeze=1.0), lasts=0.06),
    Fault("rig's communication hangs, armed", "faults", switch(freeze=1.0), moment="armed"),
    Fault("rig's communication hangs, ready", "ends off", switch(freeze=1.0), moment="ready"),
    Fault("rig's communication hangs, stopping", "ends off", switch(freeze=1.0), moment="stopping"),
    *(
        Fault(f"rig restarts, {moment}", promise, new_rig, nothing, moment=moment, new_stream=True)
        for moment, promise in (
            ("running", "faults"),
            ("starting", "faults"),
            ("armed", "faults"),
            ("ready", "ends off"),
            ("stopping", "ends off"),
            ("fault", "stays in fault"),
        )
    ),
    Fault(
        "rig ignores OFF (and a stop)",
        "faults",
        together(switch(ignore_off=1.0), commands("stop")),
    ),
    Fault(
        "rig ignores OFF (and a disarm), armed",
        "faults",
        together(switch(ignore_off=1.0), commands("disarm")),
        moment="armed",
        lasts=1.2,
    ),
    Fault(
        "rig ignores OFF and is ordered to stop, starting",
        "faults",
        together(switch(ignore_off=1.0), commands("stop")),
        moment="starting",
        lasts=1.2,
    ),
    Fault("rig does not follow", "faults", switch(ignore_reference=1.0)),
    Fault(
        "rig does not follow from the start",
        "faults",
        switch(ignore_reference=1.0),
        moment="starting",
        lasts=1.5,
        notice=1.0,
    ),
    Fault("emergency stop pressed", "faults", **BUTTON),
    *(
        Fault(f"emergency stop pressed, {moment}", promise, **BUTTON, moment=moment)
        for moment, promise in (
            ("ready", "ends off"),
            ("arming", "faults"),
            ("armed", "faults"),
            ("starting", "faults"),
            ("stopping", "ends off"),
        )
    ),
)
