"""The drive as a process: commands and the emergency stop in, wheels and `robot/drive` out.

One loop at a fixed rate is the watchdog: it goes round whether messages arrive or not.
"""

from __future__ import annotations

import math
import time
from collections import deque
from contextlib import ExitStack

from pydantic import ValidationError

from heel.schemas import DriveState, EndOfStream, EStop, MessageError, MotionCommand, Odometry, keys
from heel.services.drive.core import Drive
from heel.services.drive.drivers import OdometryReading, open_driver
from heel.services.drive.settings import DriveServiceSettings
from heel.services.drive.wheels import DriverError, Wheels
from heel.services.runtime import qos
from heel.services.runtime.inbox import Arrival
from heel.services.runtime.logs import StateLog
from heel.services.runtime.service import ServiceContext, run_service
from heel.services.runtime.settings import Loaded
from heel.services.runtime.stop_keeper import StopKeeper
from heel.services.runtime.stop_signals import end_within
from heel.services.runtime.stop_socket import StopSocket
from heel.services.runtime.streams import END_HOLD_S, Received

_EXIT_S = 1.0
"""From a failed driver to the end of the process, whatever else hangs."""
_MOST_PRESSED = 16
"""Stops by the socket that wait for the next round; one is enough."""


class DriveService:
    """Wires the drive core to its topics and its driver."""

    def __init__(
        self, context: ServiceContext[DriveServiceSettings], wheels: Wheels, resources: ExitStack
    ) -> None:
        self._context = context
        self._wheels = wheels
        self._commands = context.subscribe("command", keys.FOLLOW_COMMAND, qos.COMMAND)
        self._drive = Drive(context.settings, self._commands.gate)
        self._newest: Received[MotionCommand] | None = None
        self._state_log = StateLog(context.log)
        self._ended_s: float | None = None
        self._odometry_seq = 0
        self._out = context.publisher(keys.ROBOT_DRIVE, qos.DRIVE)
        context.watch_for_twin(keys.ROBOT_DRIVE, resources)
        self._odometry = context.publisher(keys.ROBOT_ODOMETRY, qos.ODOMETRY)
        self._stop = StopKeeper(context, resources, self._drive.set_estop)
        self._state: DriveState | None = None
        self._rounds = 0
        self._pressed: deque[EStop] = deque(maxlen=_MOST_PRESSED)
        resources.enter_context(StopSocket(context.robot, self._press, self._look, context.log))

    def run(self) -> None:
        """Drive until the service is stopped, then stand.

        Raises:
            DriverError: the driver failed.
        """
        reason = "the drive ends"
        try:
            self._stop.catch_up()
            self._context.announce()
            self._go_round()
        except DriverError as error:
            end_within(_EXIT_S)
            reason = str(error)[:96]
            raise
        finally:
            if not self._wheels.finish():
                self._context.log.error(
                    "the driver did not stop: this process ends, and the board's own watchdog "
                    "has to stop the wheels"
                )
            self._publish(self._drive.halt(reason, time.monotonic()), 0.0)

    def _go_round(self) -> None:
        period_s = 1.0 / self._context.settings.rate_hz
        due_s = time.monotonic()
        while self._context.running and not self._is_over():
            now_s = time.monotonic()
            if now_s >= due_s:
                self._round()
                due_s = max(due_s + period_s, now_s)
                continue
            arrival = self._context.inbox.get(due_s - now_s)
            stops = False
            with self._context.surviving("obeying"):
                stops = arrival is not None and self._stops(arrival)
            # Speeding up waits for its turn, a stop does not.
            if stops or self._pressed:
                self._round()

    def _round(self) -> None:
        started_s = time.monotonic()
        news = self._take_pressed(started_s)
        state = self._drive.step(started_s)
        self._wheels.turn(state.linear_mps, state.angular_radps)
        if news:
            self._stop.publish()
        self._state, self._rounds = state, self._rounds + 1
        self._publish(state, time.monotonic() - started_s)
        if (reading := self._wheels.odometry()) is not None:
            self._publish_odometry(reading)
        self._stop.save()
        self._stop.poll(started_s)

    def _look(self) -> tuple[DriveState | None, int]:
        """For the stop socket: what the wheels were told last, and the number of rounds."""
        return self._state, self._rounds

    def _press(self, stop: EStop) -> None:
        """For the stop socket: obey in a round of its own."""
        self._pressed.append(stop)
        self._context.inbox.interrupt()

    def _take_pressed(self, now_s: float) -> bool:
        """Whether a stop came by the socket that others have to hear of."""
        news = False
        while self._pressed:
            news |= self._stop.take(self._pressed.popleft(), now_s)
        return news

    def _publish(self, state: DriveState, busy_s: float) -> None:
        now_s = time.monotonic()
        age_s = 0.0 if self._newest is None else self._newest.age_s(now_s)
        self._out.send(state, age_s)
        self._context.statistics.output(now_s, busy_s, age_s)
        self._state_log.tell(f"{state.state}: {state.reason}", now_s)

    def _publish_odometry(self, reading: OdometryReading) -> None:
        try:
            message = Odometry(
                seq=self._odometry_seq,
                x_m=reading.x_m,
                y_m=reading.y_m,
                heading_rad=math.remainder(reading.heading_rad, 2.0 * math.pi),
                linear_mps=reading.linear_mps,
                angular_radps=reading.angular_radps,
            )
        except (ValidationError, ValueError) as error:
            self._context.warn.warning(
                "odometry", f"driver {self._context.settings.driver} gives no valid odometry "
                f"({' '.join(str(error).split())[:200]}): check the driver", time.monotonic(),
            )  # fmt: skip
            return
        self._odometry.send(message, 0.0)
        self._odometry_seq += 1

    def _stops(self, arrival: Arrival) -> bool:
        """Take a message; True if the wheels have to stand because of it."""
        if arrival.topic == "estop":
            before = self._stop.engaged
            self._stop.hear(arrival)
            return self._stop.engaged and not before
        if arrival.encoding == EndOfStream.encoding():
            return self._end(arrival)
        # The core judges which sender to obey and what is new.
        received = self._commands.message(arrival, MotionCommand, judged=False)
        if received is None:
            return False
        command = received.message
        stamp = received.stamp
        taken = self._drive.take(command, stamp.producer, arrival.arrived_s, stamp.line, stamp.turn)
        self._commands.report_rivals(arrival)
        if taken or self._drive.refusal:
            self._commands.report_refusal(arrival, self._drive.refusal)
        if not taken:
            return False
        self._ended_s = None
        self._newest = received
        self._context.statistics.input(arrival.arrived_s)
        stops = command.linear_mps == 0.0 and command.angular_radps == 0.0
        return stops and self._turns

    def _end(self, arrival: Arrival) -> bool:
        """Stop at once; whether the drive is to end shows when no command follows."""
        end = self._commands.end(arrival)
        if end is None:
            return False
        frame = None if self._newest is None else self._newest.message.frame
        if frame is not None and (end.epoch != frame.epoch or end.frames <= frame.seq):
            self._commands.refuse(arrival, MessageError(
                f"end: of epoch {end.epoch} after {end.frames} frames, but commands rest on frame "
                f"{frame.seq} of epoch {frame.epoch}: send it behind the last command"
            ))  # fmt: skip
            return False
        self._drive.end()
        self._ended_s = arrival.arrived_s
        return True

    def _is_over(self) -> bool:
        over = self._ended_s is not None and time.monotonic() - self._ended_s >= END_HOLD_S
        return over and self._context.settings.exit_at_end

    @property
    def _turns(self) -> bool:
        state = self._state
        return state is not None and bool(state.linear_mps or state.angular_radps)


def serve(context: ServiceContext[DriveServiceSettings]) -> None:
    """Drive until the service is stopped or its driver fails."""
    s = context.settings
    wheels = Wheels(open_driver(s.driver, s.driver_options), s.driver_deadline_s, s.ttl_s)
    with ExitStack() as resources:
        DriveService(context, wheels, resources).run()


def run(loaded: Loaded[DriveServiceSettings]) -> int:
    """Run the drive process; returns its exit code."""
    return run_service("drive", loaded, serve)
