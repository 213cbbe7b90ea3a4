"""Settings of the bridge to ROS 2: which topics of the robot, and where its camera is."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, StringConstraints

from heel.services.runtime.settings import ServiceSettings

Topic = Annotated[str, StringConstraints(pattern=r"^$|^/?[A-Za-z][A-Za-z0-9_/]{0,254}$")]
"""A ROS topic; empty: none."""


class Ros2Settings(ServiceSettings):
    """A robot that speaks ROS 2."""

    delivery: Literal["live"] = Field("live", description="a robot does not wait")
    check: bool = Field(
        False,
        description="say which topics, types and QoS the robot has and what does not fit; end",
    )
    rmw: Literal["dds", "zenoh"] = Field(
        "dds", description="how the robot's ROS speaks: dds by rclpy, with the middleware of its "
        "RMW_IMPLEMENTATION; zenoh as rmw_zenoh does, without any ROS here"
    )  # fmt: skip
    ros_router: str = Field(
        "tcp/127.0.0.1:7447", max_length=256, description="router of the robot's rmw_zenoh, with "
        "rmw zenoh"
    )  # fmt: skip
    node: str = Field(
        "heel", pattern=r"^[A-Za-z][A-Za-z0-9_]{0,63}$", description="name of the ROS node"
    )
    domain_id: int | None = Field(
        None, ge=0, le=232, description="ROS domain; ROS_DOMAIN_ID unless given"
    )
    image_topic: Topic = Field(
        "camera/image_raw", description="sensor_msgs/Image, or CompressedImage where its name ends "
        "in /compressed; empty: another service sends pictures"
    )  # fmt: skip
    camera_info_topic: Topic = Field(
        "camera/camera_info", description="sensor_msgs/CameraInfo: the lens; empty: none"
    )
    depth_topic: Topic = Field(
        "", description="sensor_msgs/Image of depth, aligned to the picture, 16UC1 (mm) or 32FC1 "
        "(m); where scan_topic is empty and the mounting is known, free distances are those of it; "
        "empty: none"
    )  # fmt: skip
    scan_topic: Topic = Field("scan", description="sensor_msgs/LaserScan; empty: no ranges")
    odometry_topic: Topic = Field("odom", description="nav_msgs/Odometry; empty: none")
    estop_topic: Topic = Field(
        "", description="std_msgs/Bool: true engages the emergency stop; `heel resume` or the page "
        "releases it; empty: none"
    )  # fmt: skip
    command_topic: Topic = Field("cmd_vel", description="where velocities go")
    command_stamped: bool = Field(
        False, description="send TwistStamped instead of Twist, which newer robots want"
    )
    command_frame: str = Field(
        "base_link", pattern=r"^[A-Za-z0-9_/]{0,128}$", description="frame of TwistStamped"
    )
    target_topic: Topic = Field(
        "", description="geometry_msgs/PoseStamped: where the target is, for Nav2's following; "
        "empty: none"
    )  # fmt: skip
    people_topic: Topic = Field(
        "", description="visualization_msgs/MarkerArray: where people stand, for RViz and "
        "Foxglove; empty: none"
    )  # fmt: skip
    detections_topic: Topic = Field(
        "", description="vision_msgs/Detection2DArray: people's boxes in the picture, with ids; "
        "empty: none"
    )  # fmt: skip
    diagnostics_topic: Topic = Field(
        "", description="diagnostic_msgs/DiagnosticArray: every part's health once a second, "
        "usually diagnostics; empty: none"
    )  # fmt: skip
    scan_yaw_deg: float = Field(
        0.0, ge=-180, le=180, description="where the scanner looks, degrees from ahead, left is "
        "positive"
    )  # fmt: skip
    fps: float = Field(30.0, gt=0, le=240, description="nominal pictures per second")
    jpeg_quality: int = Field(
        90, ge=1, le=100, description="quality of the JPEGs that go to other hosts, percent"
    )
    horizontal_fov_deg: float | None = Field(
        None, gt=0, lt=180, description="field of view, degrees, where camera_info tells none"
    )
    mount_height_m: float | None = Field(None, ge=0, le=100, description="camera above ground, m")
    mount_pitch_deg: float | None = Field(
        None, ge=-90, le=90, description="camera pitch, degrees, down is positive"
    )
