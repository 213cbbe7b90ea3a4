"""What is found out before anything is judged; see `findings`."""

from __future__ import annotations

from dataclasses import dataclass, field

from heel.schemas import CameraInfo, Health
from heel.services.commands.doctor.knock import Answer


@dataclass(frozen=True, slots=True)
class RouterFacts:
    """The router that this command would talk to.

    Attributes:
        endpoint: its address.
        named: whether a user or a run named it; if not it is the usual one.
        answer: what is found at the address; None where it is no TCP address and nothing was asked.
        entered: whether a session was opened.
        user: that was given.
        reason: why no session was opened, in Zenoh's words.
        uncertified: that the address needs certificates and none are given, in words.
        versions: of its software, by name; empty where it does not say.
        certificate_days: that this command's own certificate is still valid; None: it has none, or
            one that does not tell.
    """

    endpoint: str
    named: bool
    answer: Answer | None
    entered: bool
    user: str | None = None
    reason: str = ""
    uncertified: str = ""
    versions: dict[str, str] = field(default_factory=dict)
    certificate_days: float | None = None


@dataclass(frozen=True, slots=True)
class BusFacts:
    """What the services say of themselves.

    Attributes:
        services: newest health of each that is heard.
        problems: what is wrong with the chain of services, in words.
        clocks_s: by how much each sender's wall clock seems to be ahead of this one, seconds.
        camera: what is known of the camera; None where nothing is told.
        cameras: names of those that send.
    """

    services: tuple[Health, ...] = ()
    problems: tuple[str, ...] = ()
    clocks_s: dict[str, float] = field(default_factory=dict)
    camera: CameraInfo | None = None


@dataclass(frozen=True, slots=True)
class MachineFacts:
    """This computer.

    Attributes:
        cores: that this process may use.
        load: mean number of processes that want one, of the last minute.
        may_lock: whether as much memory may be locked as shared memory needs.
        locked_bytes: the limit of it; None: unlimited.
        shared_bytes: size of the shared memory; None: there is none.
        shared_share: of it in use, 0 to 1.
        shared_problem: why Zenoh cannot use it; None: it can.
        missing: modules that are not installed, by extra.
        free_bytes: of the disk, by folder.
        ports: whether each of Heel's usual ports can be listened on; without those of the robot.
        run_folder: what is wrong with the folder of runs; None: nothing.
        version: of Heel here.
    """

    cores: int
    load: float
    may_lock: bool
    locked_bytes: int | None
    shared_bytes: int | None
    shared_share: float | None
    shared_problem: str | None
    missing: dict[str, tuple[str, ...]]
    free_bytes: dict[str, int]
    ports: dict[int, bool]
    run_folder: str | None
    version: str


@dataclass(frozen=True, slots=True)
class CameraFacts:
    """A camera that was tried.

    Attributes:
        source: which.
        problem: why it does not open or gives no picture; None: it does.
        rate_hz: pictures per second.
        nominal_hz: that it says to give.
        width: pixels.
        height: pixels.
    """

    source: str
    problem: str | None = None
    rate_hz: float = 0.0
    nominal_hz: float = 0.0
    width: int = 0
    height: int = 0


@dataclass(frozen=True, slots=True)
class ModelFacts:
    """The network that finds people.

    Attributes:
        name: of it.
        problem: why it cannot be used; None: it can.
        look_ms: time for one picture here.
        engine: what runs it.
    """

    name: str
    problem: str | None = None
    look_ms: float = 0.0
    engine: str = ""


@dataclass(frozen=True, slots=True)
class Facts:
    """All of it; None is what was not looked at."""

    router: RouterFacts
    machine: MachineFacts
    bus: BusFacts | None = None
    camera: CameraFacts | None = None
    model: ModelFacts | None = None
    devices: tuple[str, ...] = ()
    """Cameras of this computer."""
