"""`heel stop` and `heel resume`: they end within two seconds and report the state by then."""

from __future__ import annotations

import os
import secrets
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from heel.schemas import DriveState, EStop, FollowState, HeelError
from heel.services.commands.robot import RobotFlags, Where, for_robot
from heel.services.commands.robot_line import Heard, RobotLine
from heel.services.runtime.logs import printable
from heel.services.runtime.stop_socket import LocalAnswer, drives_here

_IN_ALL_S = 1.8
"""Seconds from the start of the process to its last line, a little below the two that are
promised."""
_AT_LEAST_S = 1.0
"""The same from the first message, on a computer that takes long to start a process; chosen by
hand."""
# A resume has no hurry.
_ASK_S = 1.2
"""Longest wait of a resume for drive and follower to answer [s]; chosen by hand."""
_OBEY_S = 1.0
"""Longest wait of a resume for drive and follower to obey [s]; chosen by hand."""
_SAID_AT_LEAST = 3
"""Times that a stop is sent even if the first was confirmed: a confirmation may be forged. Chosen
by hand."""
_HERE_S = 0.6
"""Longest wait for the drives of this machine [s]: a drive's loop goes round within half of it, or
hangs. The same for a renewed stop to be confirmed."""
_CLOSE_S = 0.15
"""Seconds for the line to close, and for the router's side of a stop that is confirmed here;
chosen by hand."""
_SOURCE = "heel command"


@for_robot
def stop(robot: RobotFlags) -> None:
    """Emergency stop: zero velocity until `heel resume`."""
    deadline_s = _deadline_s()
    where = robot.find()
    message = _stop_message()
    line = RobotLine(where)
    line.say([message])
    here = _Here(where, message)

    def enough(heard: Heard, now_s: float) -> bool:
        if here.confirmed:
            # The drive passes the stop on itself; the others are waited for a moment only.
            return heard.said >= _SAID_AT_LEAST or now_s >= here.done_s + _CLOSE_S
        if not here.done:
            return False
        return heard.failure != "" or (heard.said >= _SAID_AT_LEAST and is_stopped(heard, now_s))

    line.wait(enough, deadline_s)
    words, failed = told_of_stop(line.look(), here.answers, where.router, time.monotonic())
    _end(line, words, failed)


@for_robot
def resume(
    robot: RobotFlags,
    without_follower: Annotated[
        bool, typer.Option("--without-follower", help="release the drive though no follower is "
                           "there: another program sends commands")
    ] = False,
) -> None:  # fmt: skip
    """Release the emergency stop.

    Nothing is released unless drive and follower answer, and the stop is engaged again if one of
    them does not obey the release. A stop that was pressed after this was typed stays.
    """
    typed_s = time.monotonic() - _age_s()
    where = robot.find()
    deadline_s = time.monotonic() + _ASK_S
    line = RobotLine(where)
    here = _Here(where, None)
    line.wait(lambda heard, now_s: heard.failure != "" or (
        here.done
        and refusal(heard, here.answers, where.router, without_follower, typed_s, now_s) == ""
    ), deadline_s)  # fmt: skip
    heard = line.look()
    refused = heard.failure or refusal(
        heard, here.answers, where.router, without_follower, typed_s, time.monotonic()
    )
    if not here.done:
        refused = "the drive on this machine does not answer"
    if refused:
        _end(line, f"nothing was released: {refused}", True)
        return
    engagements = list(heard.engagements.values())
    line.say(_release_of(one) for one in engagements)
    parts = bool(heard.fresh_drives(time.monotonic())), not without_follower
    released = line.wait(
        lambda heard, now_s: is_released(heard, *parts, now_s), time.monotonic() + _OBEY_S
    )
    if released:
        _end(line, "resumed" if engagements else "resumed: no emergency stop was engaged", False)
        return
    again = _stop_message()
    line.say([again])
    _Here(where, again)
    line.wait(lambda heard, now_s: heard.said >= _SAID_AT_LEAST
              and is_stopped(heard, now_s), time.monotonic() + _HERE_S)  # fmt: skip
    _end(line, "not resumed: drive and follower did not both obey the release within 1 s, and the "
         "emergency stop is engaged again", True)  # fmt: skip


class _Here:
    """The drives of the robot on this machine, asked through their sockets in a thread."""

    def __init__(self, where: Where, press: EStop | None) -> None:
        self.answers: list[LocalAnswer] = []
        self.done_s = float("inf")
        self._done = threading.Event()

        def call() -> None:
            from heel.services.runtime.places import robot_name

            with suppress(HeelError):
                self.answers = drives_here(robot_name(where.zenoh), press, _HERE_S)
            self.done_s = time.monotonic()
            self._done.set()

        threading.Thread(target=call, name="stop-here", daemon=True).start()

    @property
    def done(self) -> bool:
        return self._done.is_set()

    @property
    def confirmed(self) -> bool:
        """Whether there are drives here, and all of them are stopped."""
        return self.done and _all_stand([answer.state for answer in self.answers])


def stopped(heard: Heard, here: list[LocalAnswer], now_s: float) -> bool | None:
    """Whether the drives confirm a stop; None without a state of any drive.

    The states of the drives on this machine, which cannot be forged, go before those that came
    over the network.
    """
    if here:
        return _all_stand([answer.state for answer in here])
    drives = heard.fresh_drives(now_s)
    return _all_stand(list(drives.values())) if drives else None


def is_stopped(heard: Heard, now_s: float) -> bool:
    """Whether a stop is confirmed over the network: by the drives, or where there are none."""
    confirmed = stopped(heard, [], now_s)
    if confirmed is None and heard.alive and "drive" not in heard.alive:
        return _stands(heard.fresh_follower(now_s))
    return confirmed is True


def _all_stand(states: list[DriveState | None]) -> bool:
    return bool(states) and all(state is not None and state.estop for state in states)


def told_of_stop(
    heard: Heard, here: list[LocalAnswer], router: str, now_s: float
) -> tuple[str, bool]:
    """Result of a stop as text for a user, and whether it failed."""
    confirmed = stopped(heard, here, now_s)
    if confirmed:
        states = [answer.state for answer in here] or list(heard.fresh_drives(now_s).values())
        turning = any(state is not None and state.linear_mps for state in states)
        how = "the drive brakes" if turning else "the wheels stand"
        beside = _beside(heard, now_s)
        return f"stopped: {how}; `heel resume` releases it{beside}", False
    if any(answer.state is None for answer in here):
        hung = ", ".join(str(answer.pid) for answer in here if answer.state is None)
        return f"the drive hangs (process {hung}): cut the power of the wheels", True
    drives = heard.fresh_drives(now_s)
    if len(drives) > 1:
        loose = ", ".join(name or "?" for name, state in drives.items() if not state.estop)
        return f"not every drive confirms: {printable(loose, 200)} does not", True
    if drives:
        return "the drive answers and does not stop: cut the power of the wheels", True
    if not heard.connected:
        why = heard.failure or f"no Zenoh router at {router} answers within 2 s"
        return f"NOT stopped: {why}; no drive is on this machine", True
    follower = heard.fresh_follower(now_s)
    if follower is None:
        return f"NOT stopped: no drive and no follower answers at {router}: is the robot on?", True
    if not follower.estop:
        return "NOT stopped: the follower answers and does not stop", True
    if "drive" in heard.alive:
        return "the follower sends zero, but the drive does not confirm: it may hang", True
    return (
        "stopped: the follower sends zero; no `heel drive` is here, the robot's own end has to "
        "obey; `heel resume` releases it"
    ), False


def _beside(heard: Heard, now_s: float) -> str:
    if heard.failure or not heard.connected:
        return " (the router does not answer)"
    loose = [name for name, state in heard.fresh_drives(now_s).items() if not state.estop]
    if loose:
        return f" (another drive says that it does not stop: {printable(', '.join(loose), 200)})"
    follower = heard.fresh_follower(now_s)
    if follower is None:
        return " (no follower answers)"
    return "" if follower.estop else " (the follower has not confirmed yet)"


def refusal(
    heard: Heard, here: list[LocalAnswer], router: str, without_follower: bool, typed_s: float,
    now_s: float,
) -> str:  # fmt: skip
    """Why the emergency stop may not be released now; "" if it may.

    Args:
        heard: state received by now.
        here: of the drives on this machine.
        router: in words.
        without_follower: whether there may be none.
        typed_s: when the release was asked for, monotonic.
        now_s: monotonic.
    """
    drives, follower = heard.fresh_drives(now_s), heard.fresh_follower(now_s)
    if not heard.connected:
        return f"no Zenoh router at {router} answers"
    if any(answer.state is None for answer in here) or ("drive" in heard.alive and not drives):
        return "the drive does not answer"
    if follower is None and ("follower" in heard.alive or not without_follower):
        return (
            "no follower answers: is it running? --without-follower releases the drive all the same"
        )
    if not drives and follower is None:
        return "no drive and no follower answers: is the robot on?"
    if any(since_s > typed_s for since_s in heard.held_since_s.values()):
        return "STOP was pressed after this was typed: resume again if that is meant"
    stands = any(state.estop for state in drives.values()) or _stands(follower)
    return "nobody tells which engagement holds" if stands and not heard.engagements else ""


def is_released(heard: Heard, drive: bool, follower: bool, now_s: float) -> bool:
    """Whether every process that has to obey reports that no emergency stop holds.

    Args:
        heard: state received by now.
        drive: whether there is a drive.
        follower: whether there has to be a follower.
        now_s: monotonic.
    """
    drives, following = heard.fresh_drives(now_s), heard.fresh_follower(now_s)
    if any(state.estop for state in drives.values()) or _stands(following):
        return False
    return (bool(drives) or not drive) and (following is not None or not follower)


def _stands(follower: FollowState | None) -> bool:
    return follower is not None and follower.estop


def _stop_message() -> EStop:
    return EStop(
        engaged=True, source=_SOURCE, t_ns=time.time_ns(), id=secrets.token_hex(8)
    )  # fmt: skip


def _release_of(held: EStop) -> EStop:
    return EStop(
        engaged=False, source=_SOURCE, t_ns=max(time.time_ns(), held.t_ns), id=held.id
    )  # fmt: skip


def _deadline_s() -> float:
    now_s = time.monotonic()
    return max(now_s + _AT_LEAST_S, now_s - _age_s() + _IN_ALL_S)


def _age_s() -> float:
    """Seconds since this process was started, 0 where the system does not know."""
    try:
        ticks = int(Path("/proc/self/stat").read_text().rpartition(")")[2].split()[19])
        boot_s = time.clock_gettime(time.CLOCK_BOOTTIME)
    except (OSError, ValueError, IndexError, AttributeError):
        return 0.0
    return max(0.0, boot_s - ticks / os.sysconf("SC_CLK_TCK"))


def _end(line: RobotLine, words: str, failed: bool) -> None:
    """Print the result and end, also where Zenoh blocks.

    Raises:
        HeelError: it failed.
    """
    if not line.close(_CLOSE_S):
        # A process that waits for Zenoh now waits ten seconds.
        print(f"heel: {words}" if failed else words, file=sys.stderr if failed else sys.stdout)
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError):
                stream.flush()
        os._exit(1 if failed else 0)
    if failed:
        raise HeelError(words)
    typer.echo(words)
