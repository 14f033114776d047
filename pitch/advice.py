"""What a decision means for the person at the machine."""

from pitch.situation import Cause, Decision

_PLAIN = {
    Cause.QUIET: "The cut is quiet. Nothing to do.",
    Cause.LATE: "A message came late and was ignored.",
    Cause.BAD_DATA: "The measurement can not be trusted just now, so the turret stays where it is.",
    Cause.NOT_ARMED: "There is chatter, but the control is not armed. Arm it to let turret 1 move.",
    Cause.OUT_OF_CUT: "The tools are not cutting, so the turret stays where it is.",
    Cause.NO_SPINDLE_SPEED: "The spindle speed is not known, so the shift can not be worked out. Check its encoder.",
    Cause.FORCED: (
        "This vibration keeps step with the spindle. It is not chatter, and moving the turret will not help: "
        "look for run-out, imbalance, an interrupted cut or a worn bearing."
    ),
    Cause.KIND_UNKNOWN: "Something vibrates. The turret stays until it is clear what it is.",
    Cause.NO_FREQUENCY: "Chatter is starting. The turret moves as soon as its frequency is known.",
    Cause.MOVING: "Turret 1 is on its way.",
    Cause.WAITING: "Turret 1 has moved. Waiting to see whether that was enough.",
    Cause.NOT_FOLLOWED: "Turret 1 is not where it was sent. Check the drive, its limits and the guard.",
}


def advise(decision: Decision) -> str:
    """Say in plain words what happens and, where the planner is at its end, what else would help.

    Parameters
    ----------
    decision : Decision
        An answer of the planner.

    Returns
    -------
    str
        One or two sentences.
    """
    if decision.cause == Cause.CHATTER:
        return f"{_capital(decision.reason)}. The depth of cut stays as it is."
    if decision.cause == Cause.NO_PITCH:
        return f"{_capital(decision.reason)}. {_speeds(decision)} or give turret 1 more room to move."
    if decision.cause == Cause.EXHAUSTED:
        return (
            f"{_capital(decision.reason)}. {_speeds(decision)}, support the bar, shorten it or change the depth of cut."
        )
    return _PLAIN[decision.cause]


def _speeds(decision: Decision) -> str:
    """Half a line of the comb away: at equal pitch the chatter lines lie two spindle frequencies apart."""
    if decision.frequency_hz is None or decision.spindle_hz is None:
        return "Change the spindle speed by a few per cent"
    if decision.advised_spindle_hz is not None:
        return f"Change the spindle speed to {60 * decision.advised_spindle_hz:.0f} 1/min"
    change = decision.spindle_hz / decision.frequency_hz
    slow, fast = (60 * decision.spindle_hz * (1 + sign * change) for sign in (-1, 1))
    return f"Change the spindle speed by about {100 * change:.1f} % (to {slow:.0f} or {fast:.0f} 1/min)"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
